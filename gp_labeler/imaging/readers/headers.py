"""What the readers of NRRD, MetaImage and NIfTI share: a header's result, its text, the layout of voxels.

These formats are read without ITK: its libraries write to the terminal, read numbers by the locale, and end
the process on headers and names that they do not expect.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from gp_labeler.imaging.readers.grey import to_grey
from gp_labeler.imaging.readers.plan import Geometry
from gp_labeler.imaging.readers.problems import Problem, VolumeError
from gp_labeler.imaging.readers.source import Plane, SliceSource
from gp_labeler.imaging.readers.spacing import unit_in_mm

__all__ = [
    "HEADER_BYTES",
    "Header",
    "Layout",
    "beside",
    "decoded",
    "file_series",
    "lengths_in_mm",
    "not_a",
    "numbers",
    "text_fields",
]

HEADER_BYTES = 1 << 20
_PATTERN = re.compile(r"(.*%0?\d{0,2}[diu].*?)((?:\s+-?\d+)*)\s*")
_COUNTER = re.compile(r"%(0?)(\d{0,2})[diu]")


@dataclass(frozen=True, eq=False)
class Header:
    """All that a header says.

    Parameters
    ----------
    size : (3,) int
        Voxels along x, y, z.
    dtype : dtype
        Of the grey values; float32 where they are scaled while they are read.
    source : SliceSource
        Where the planes come from.
    files : tuple of Path
        The file, and those beside it that hold the voxels.
    geometry : Geometry
        Where the voxels lie.
    found, notes : tuple
        What stands against loading it, and what was decided.
    channels, n_volumes : int
        Values of a voxel, and volumes in the file.
    format : str, optional
        For people, where it is not the one that the name speaks of.
    """

    size: tuple[int, int, int]
    dtype: np.dtype[Any]
    source: SliceSource
    files: tuple[Path, ...]
    geometry: Geometry
    found: tuple[Problem, ...] = ()
    notes: tuple[str, ...] = ()
    channels: int = 1
    n_volumes: int = 1
    format: str | None = None


@dataclass(frozen=True)
class Layout:
    """In which order values follow each other in a file.

    Parameters
    ----------
    sizes : tuple of int
        Values along each axis, the fastest first.
    space : (3,) int
        Which of the axes are x, y and z.
    listed : bool
        Whether the values of a voxel are volumes of a list, not colours.
    """

    sizes: tuple[int, ...]
    space: tuple[int, int, int]
    listed: bool = False

    @property
    def size(self) -> tuple[int, int, int]:
        """Voxels along x, y, z."""
        x, y, z = (self.sizes[axis] for axis in self.space)
        return x, y, z

    @property
    def plane_shape(self) -> tuple[int, ...]:
        """Shape of what is stored of one plane, the slowest axis first."""
        return tuple(reversed(self.sizes[: self.space[2]]))

    @property
    def channels(self) -> int:
        """Values of one voxel."""
        return int(np.prod(self.plane_shape)) // (self.size[0] * self.size[1])

    @property
    def n_volumes(self) -> int:
        """Volumes that follow each other."""
        return int(np.prod(self.sizes[self.space[2] + 1 :], dtype=np.int64))

    @property
    def n_planes(self) -> int:
        """Planes of all volumes."""
        return self.size[2] * self.n_volumes

    def finish(self, channel: int | None) -> Callable[[Plane], Plane]:
        """Return what makes the (y, x) grey plane of a stored one."""
        more = [axis for axis in range(self.space[2]) if axis not in self.space]
        if not more:
            return to_grey if channel is None else lambda plane: to_grey(plane, channel)
        last = self.space[2] - 1
        taken = 0 if channel is None and self.listed else channel
        return lambda plane: to_grey(np.moveaxis(plane, last - more[0], -1), taken)


def text_fields(text: str, separators: str) -> dict[str, str]:
    """Return the fields of a text header; names in lower case and without blanks: writers differ."""
    fields: dict[str, str] = {}
    for line in text.splitlines():
        match = re.match(rf"([^{separators}]*)[{separators}](?!=)(.*)", line)
        if match and not line.startswith("#"):
            fields["".join(match[1].lower().split())] = match[2].strip()
    return fields


def numbers(fields: dict[str, str], name: str, n: int | None = None, *, whole: bool = False) -> list[float]:
    """Return the numbers of a field, which must be there.

    Raises
    ------
    VolumeError
        They are not `n` (whole) numbers.
    """
    said = fields.get("".join(name.lower().split()), "")
    try:
        values = [float(int(word) if whole else float(word)) for word in re.split(r"[\s,()]+", said) if word]
    except ValueError:
        values = []
    if not values or (n is not None and len(values) != n):
        needed = f"{n or 'some'} {'whole ' if whole else ''}number{'' if n == 1 else 's'}"
        raise VolumeError(f"its {name} is {said!r}, where {needed} must be", remedy="Correct its header.")
    return values


def lengths_in_mm(units: Sequence[str]) -> tuple[list[float], str, tuple[str, ...]]:
    """Return each unit's length in mm, the unit that is none (or ``""``), and a note where one is not mm."""
    factors = [unit_in_mm(unit) for unit in units]
    unknown = next((u for u, f in zip(units, factors, strict=True) if f is None and u.strip(" ?")), "")
    other = dict.fromkeys(u for u, f in zip(units, factors, strict=True) if f not in (None, 1.0))
    note = (f"lengths were converted from {', '.join(other)} to mm",) if other else ()
    return [1.0 if f is None else f for f in factors], unknown, note


def decoded(head: bytes) -> str:
    """Return the text of a header; bytes that are not UTF-8 are kept, as in the names of files."""
    return head.decode("utf-8", "surrogateescape")


def in_latin(text: str) -> str:
    """Return text whose bytes were not UTF-8 as Latin-1."""
    return text.encode("utf-8", "surrogateescape").decode("latin-1") if _is_escaped(text) else text


def _is_escaped(text: str) -> bool:
    return any("\udc80" <= letter <= "\udcff" for letter in text)


def beside(path: Path, name: str) -> Path:
    """Return the file that holds the voxels of a detached header.

    Raises
    ------
    VolumeError
        It is not there.
    """
    for spelling in (name, name.replace("\\", "/"), in_latin(name).replace("\\", "/")):
        file = path.parent / spelling
        if file.is_file():
            return file
    raise VolumeError(
        f"the voxels should be in {name}, which is not there",
        file=path,
        remedy=f"Put {Path(name.replace(chr(92), '/')).name} into the folder of the header.",
    )


def file_series(path: Path, said: str, listed: Sequence[str], most: int) -> list[Path] | None:
    """Return the files of a detached header that names several, or None where it names one.

    Parameters
    ----------
    path : Path
        The header.
    said : str
        What stands where the name should: ``LIST``, or a pattern such as ``slice%03d.raw 1 40 1``.
    listed : sequence of str
        The lines after it.
    most : int
        Planes that there are; more files than that cannot be.

    Raises
    ------
    VolumeError
        One is missing, or there are too many.
    """
    if re.match(r"LIST\b", said, re.IGNORECASE):
        return [beside(path, name.strip()) for name in listed[: most + 1] if name.strip()]
    match = _PATTERN.fullmatch(said)
    if match is None or (path.parent / said).is_file():  # a name with a per cent sign in it
        return None
    given = [int(n) for n in match[2].split()]
    first, last, step = (*given[:3], *(1, most, 1)[len(given) :])
    counted = range(first, last + (1 if step > 0 else -1), step) if step else range(0)
    if not 0 < len(counted) <= most:
        raise VolumeError(
            f"its pattern {said!r} names {len(counted)} files for {most} slices", remedy="Correct its header."
        )
    return [beside(path, _COUNTER.sub(partial(_padded, n), match[1])) for n in counted]


def _padded(number: int, counter: re.Match[str]) -> str:
    return str(number).rjust(int(counter[2] or 0), counter[1] or " ")


def not_a(kind: str, path: Path) -> VolumeError:
    """Return the error that a file is not what its name says."""
    return VolumeError(
        f"it is not a {kind} file, though its name says so", file=path, remedy="Check what it is."
    )
