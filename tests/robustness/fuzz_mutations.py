"""How a good file is made a bad one: bytes, numbers, lines and JSON values, and files that are none."""

from __future__ import annotations

import json
import os
import re
from pathlib import Path
from typing import Any

import numpy as np

__all__ = ["replace_by_oddity", "spoil"]

_TOKENS = [
    b"", b"\0", b"\r", b"\n\n", b",", b";", b'"', b"'", b"nan", b"-inf", b"1e999", b"-0", b"1e308", b"1e-308",
    b"{", b"}", b"[", b"]", b"\xff\xfe", b"\xef\xbb\xbf", b"#", b"\t", b"S1", b"CA", b"null", b"true", b"-1",
    b"0", b"65536", b"2147483648", b"9" * 400, b"\x1b[31m", b"\x9b", b"=1+1", b"1,5", b"\xc3\xa4",
    b"A" * 5000,
]  # fmt: skip
_VALUES: list[Any] = [
    None, True, False, 0, -1, 1e308, -1e308, 10**400, "", "CA", "S2", "s2", "\x1b[31m", "x" * 3000, "\ud800",
    [], {}, [1, 2], [[[]]], {"a": {}}, float("nan"), float("inf"), "defined", "LPS", "mm", -0.5, 3, "/etc",
]  # fmt: skip
_NUMBER = re.compile(rb"-?\d+\.?\d*(?:[eE][-+]?\d+)?")


def spoil(content: bytes, rng: np.random.Generator) -> bytes:
    """Return the content of a file with one to three things wrong in it."""
    for _ in range(int(rng.integers(1, 4))):
        change = _CHANGES[int(rng.integers(len(_CHANGES)))]
        content = change(content, rng)[:5_000_000]
    return content


def _flip(content: bytes, rng: np.random.Generator) -> bytes:
    changed = bytearray(content)
    for _ in range(int(rng.integers(1, 8)) if changed else 0):
        changed[int(rng.integers(len(changed)))] ^= 1 << int(rng.integers(8))
    return bytes(changed)


def _flip_head(content: bytes, rng: np.random.Generator) -> bytes:
    return _flip(content[:400], rng) + content[400:]


def _cut(content: bytes, rng: np.random.Generator) -> bytes:
    return content[: int(rng.integers(len(content) + 1))]


def _put(content: bytes, rng: np.random.Generator) -> bytes:
    at, gone = int(rng.integers(len(content) + 1)), int(rng.integers(0, 30))
    return content[:at] + _TOKENS[int(rng.integers(len(_TOKENS)))] + content[at + gone :]


def _double(content: bytes, rng: np.random.Generator) -> bytes:
    a, b = sorted(rng.integers(0, len(content) + 1, 2).tolist())
    return content[:b] + content[a:]


def _number(content: bytes, rng: np.random.Generator) -> bytes:
    found = list(_NUMBER.finditer(content[:100_000]))
    if not found:
        return _put(content, rng)
    match = found[int(rng.integers(len(found)))]
    return content[: match.start()] + _TOKENS[int(rng.integers(len(_TOKENS)))] + content[match.end() :]


def _lines(content: bytes, rng: np.random.Generator) -> bytes:
    lines = content.split(b"\n")
    a, b = rng.integers(0, len(lines), 2).tolist()
    way = int(rng.integers(4))
    if way == 0:
        lines[a], lines[b] = lines[b], lines[a]
    elif way == 1:
        del lines[a]
    elif way == 2:
        lines.insert(a, lines[b])
    else:
        lines = lines[: a + 1] * int(rng.integers(2, 5))
    return b"\n".join(lines)


def _encode(content: bytes, rng: np.random.Generator) -> bytes:
    text = content.decode("latin-1")
    way = ("utf-16", "utf-16-be", "utf-8-sig", "cp1252", "utf-32")[int(rng.integers(5))]
    return text.replace("\n", "\r\n").encode(way, errors="replace")


def _json(content: bytes, rng: np.random.Generator) -> bytes:
    try:
        tree = json.loads(content)
    except (ValueError, RecursionError):
        return _number(content, rng)
    place, key = {"top": tree}, "top"
    inner: Any = place
    while isinstance(inner[key], (dict, list)) and inner[key] and rng.random() < 0.85:
        inner = inner[key]
        keys = list(inner) if isinstance(inner, dict) else list(range(len(inner)))
        key = keys[int(rng.integers(len(keys)))]
    if rng.random() < 0.15:
        del inner[key]
    else:
        inner[key] = _VALUES[int(rng.integers(len(_VALUES)))]
    return json.dumps(place.get("top")).encode()


_CHANGES = (_flip, _flip_head, _cut, _put, _double, _number, _number, _lines, _encode, _json, _json, _json)


def replace_by_oddity(path: Path, rng: np.random.Generator) -> str:
    """Put something in the place of a file that is no such file; return what."""
    odd = (
        "pipe",
        "zero",
        "folder",
        "loop",
        "huge",
        "empty",
        "deep",
        "deeper",
        "rubbish",
        "many",
        "hole",
        "gone",
    )
    what = odd[int(rng.integers(len(odd)))]
    path.unlink()
    if what == "pipe":
        os.mkfifo(path)
    elif what in ("zero", "loop"):
        path.symlink_to("/dev/zero" if what == "zero" else path.name)
    elif what == "folder":
        path.mkdir()
    elif what == "huge":
        with path.open("wb") as file:
            file.truncate(3_000_000_000)
    elif what == "hole":
        path.write_bytes(bytes(int(rng.integers(1, 100_000))))
    elif what != "gone":
        path.write_bytes(_oddity(what, rng))
    return what


def _oddity(what: str, rng: np.random.Generator) -> bytes:
    if what == "deep":
        return b"[" * 300_000
    if what == "deeper":
        return b'{"a":' * 100_000 + b"1" + b"}" * 100_000
    if what == "many":
        return b"OS,1,2,3\n" * 300_000
    return rng.bytes(int(rng.integers(1, 3000))) if what == "rubbish" else b""
