"""What turns one document into another: small enough to write down at every edit."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from gp_labeler.document.specimen_json import Document

__all__ = ["Changes", "difference", "dumped", "patched"]

Changes = dict[str, list[Any]]


def dumped(value: Any) -> str:
    """Return the one JSON text of a value."""
    return json.dumps(value, separators=(",", ":"), allow_nan=False)


def difference(old: Mapping[str, Any], new: Mapping[str, Any]) -> Changes:
    """Return what turns document `old` into `new`: ``{"set": [[path, value], ...], "drop": [path, ...]}``."""
    changes: Changes = {"set": [], "drop": []}
    _collect(old, new, [], changes)
    return changes


def _collect(old: Mapping[str, Any], new: Mapping[str, Any], path: list[str], changes: Changes) -> None:
    for key, value in new.items():
        here = [*path, key]
        if key in old and isinstance(value, dict) and isinstance(old[key], dict):
            _collect(old[key], value, here, changes)
        elif key not in old or not _is_same(old[key], value):
            changes["set"].append([here, value])
    changes["drop"].extend([*path, key] for key in old if key not in new)


def _is_same(one: Any, other: Any) -> bool:
    """Whether two values are written alike: as text, for -0.0, 1 and 1.0, True and 1."""
    return repr(one) == repr(other) or dumped(one) == dumped(other)


def patched(document: Document, changes: Changes) -> Document:
    """Return a copy of `document` with these changes; parts that stay are shared with it."""
    result = dict(document)
    for path, value in changes["set"]:
        _parent(result, document, path)[path[-1]] = value
    for path in changes["drop"]:
        _parent(result, document, path).pop(path[-1], None)
    return result


def _parent(result: Document, original: Document, path: list[str]) -> Document:
    """Return the dict that holds the end of `path`, copied on the way where it is still the original's."""
    target, source = result, original
    for key in path[:-1]:
        shared = source.get(key)
        if target.get(key) is shared:
            target[key] = dict(shared or {})  # it lacks where the record that made it is lost
        target, source = target[key], shared if isinstance(shared, dict) else {}
    return target
