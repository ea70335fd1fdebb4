"""What the installed distribution asks for, read by the standard library alone: anything else may be missing.

Only what our own metadata hold is understood: bounds of versions, and markers with ``extra`` and
``python_version``.
"""

from __future__ import annotations

import operator
import re
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from importlib import metadata

__all__ = ["Requirement", "requirements_of"]

_LINE = re.compile(r"(?P<name>[\w.-]+)(?:\[[^]]*\])?\s*(?P<bounds>[^;]*)(?:;(?P<marker>.*))?")
_BOUND = re.compile(r"(>=|<=|==|!=|<|>)\s*([\d.]+)")
_EXTRA = re.compile(r"""extra\s*==\s*['"]([\w-]+)['"]""")
_PYTHON = re.compile(r"""python_version\s*(>=|<=|==|!=|<|>)\s*['"]([\d.]+)['"]""")
_COMPARE = {
    ">=": operator.ge,
    "<=": operator.le,
    "==": operator.eq,
    "!=": operator.ne,
    "<": operator.lt,
    ">": operator.gt,
}


@dataclass(frozen=True)
class Requirement:
    """A package that is asked for.

    Parameters
    ----------
    name : str
        Of the distribution, such as ``"scikit-image"``.
    bounds : str
        Of its version, such as ``">=0.25"``; empty where any will do.
    """

    name: str
    bounds: str

    def installed(self) -> str | None:
        """Return the version that is installed; None without any."""
        try:
            return metadata.version(self.name)
        except metadata.PackageNotFoundError:
            return None

    def allows(self, version: str) -> bool:
        """Whether a version is within the bounds."""
        return all(_holds(version, sign, bound) for sign, bound in _BOUND.findall(self.bounds))


def requirements_of(lines: Iterable[str], extras: Iterable[str]) -> list[Requirement]:
    """Return what this Python needs of a distribution.

    Parameters
    ----------
    lines : iterable of str
        Of its metadata (``Requires-Dist``), as `importlib.metadata.requires` returns them.
    extras : iterable of str
        Extras that are asked for, beside what is needed without any.

    Returns
    -------
    list of Requirement
        In the order of the metadata.
    """
    wanted = frozenset(extras)
    found = (_LINE.fullmatch(line.strip()) for line in lines)
    return [
        Requirement(line["name"], line["bounds"].strip())
        for line in found
        if line is not None and _applies(line["marker"] or "", wanted)
    ]


def _applies(marker: str, extras: frozenset[str]) -> bool:
    extra = _EXTRA.search(marker)
    here = "{}.{}".format(*sys.version_info[:2])
    return (extra is None or extra[1] in extras) and all(
        _holds(here, sign, bound) for sign, bound in _PYTHON.findall(marker)
    )


def _holds(version: str, sign: str, bound: str) -> bool:
    ours, theirs = _numbers(version), _numbers(bound)
    width = max(len(ours), len(theirs))
    result: bool = _COMPARE[sign](ours + (0,) * (width - len(ours)), theirs + (0,) * (width - len(theirs)))
    return result


def _numbers(version: str) -> tuple[int, ...]:
    """Return the numbers of a release: 9.7.0rc1 is 9.7.0."""
    release = re.match(r"\d+(?:\.\d+)*", version)
    return tuple(int(part) for part in release[0].split(".")) if release else ()
