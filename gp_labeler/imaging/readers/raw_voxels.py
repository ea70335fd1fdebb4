"""Voxels of detached and attached headers: in one file or several, as bytes or as text."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from gp_labeler.imaging.readers.headers import Layout
from gp_labeler.imaging.readers.problems import Problem, VolumeError, failing_as_volume_error, warning
from gp_labeler.imaging.readers.source import Compression, Plane, RawSource, SliceSource

__all__ = ["Chain", "StoredVoxels", "Whole", "length_problems", "voxels_in"]

_LONGEST_LINE = 1 << 20
_LIST_COMMA = re.compile(rb",(?=\s)")
"""Between numbers, as Teem reads it; a decimal comma has a digit behind it."""


@dataclass(frozen=True)
class StoredVoxels:
    """How voxels are written into each of their files.

    Parameters
    ----------
    dtype : dtype
        Of one value, with its byte order.
    packing : str
        Compression, or ``"text"`` for numbers and ``"hex"`` for bytes written out.
    offset : int
        Bytes of the file before the voxels, or before their compressed stream.
    lines : int
        Lines to skip from there.
    skip : int
        Bytes to skip after that, of the unpacked stream.
    tail : int, optional
        Bytes after the voxels, which then are counted from the end of the file.
    """

    dtype: np.dtype[Any]
    packing: str = "none"
    offset: int = 0
    lines: int = 0
    skip: int = 0
    tail: int | None = None


@dataclass(frozen=True)
class Chain:
    """Planes of several files, one after the other."""

    parts: tuple[RawSource, ...]

    def planes(self, wanted: Sequence[int]) -> Iterator[Plane]:
        """Yield the (y, x) grey planes with the numbers `wanted`, which rise."""
        first = 0
        for part in self.parts:
            here = [number - first for number in wanted if first <= number < first + part.n_planes]
            if here:
                with failing_as_volume_error(part.path):
                    yield from part.planes(here)
            first += part.n_planes


@dataclass(frozen=True)
class Whole:
    """Planes of voxels that can only be read all at once.

    Parameters
    ----------
    load : callable
        Returns the stored planes.
    finish : callable
        Makes the (y, x) grey plane of a stored one.
    """

    load: Callable[[], Plane]
    finish: Callable[[Plane], Plane]

    def planes(self, wanted: Sequence[int]) -> Iterator[Plane]:
        """Yield the (y, x) grey planes with the numbers `wanted`."""
        stored = self.load()
        for number in wanted:
            yield self.finish(stored[number])


def voxels_in(
    files: Sequence[Path], stored: StoredVoxels, layout: Layout, finish: Callable[[Plane], Plane]
) -> SliceSource:
    """Return the source of voxels that lie in one file, or in several of as many planes each.

    Raises
    ------
    VolumeError
        The planes cannot be shared out among the files, or the lines to skip are not there.
    """
    if stored.packing in ("text", "hex"):
        if len(files) > 1:
            raise VolumeError("its voxels are text in several files", remedy="Save it as one file.")
        return Whole(partial(_typed_out, files[0], stored, layout), finish)
    each, rest = divmod(layout.n_planes, max(1, len(files)))
    if rest or not each or not files:
        raise VolumeError(
            f"its {layout.n_planes} slices cannot be shared out among {len(files)} files",
            remedy="Correct its header.",
        )
    parts = tuple(_raw(file, stored, layout, each, finish) for file in files)
    return parts[0] if len(parts) == 1 else Chain(parts)


def length_problems(source: SliceSource, stored: StoredVoxels) -> tuple[Problem, ...]:
    """Return the problem that a file is too short for its voxels, or too long, of the first that is."""
    parts = source.parts if isinstance(source, Chain) else (source,)
    raw = [part for part in parts if isinstance(part, RawSource)]
    short = next((problems for part in raw if (problems := part.shortage())), ())
    if short or stored.tail is not None:  # voxels that are counted from the end may lie behind anything
        return short
    return next((problems for part in raw if (problems := _surplus(part))), ())


def _surplus(part: RawSource) -> tuple[Problem, ...]:
    """Return a warning of bytes that are left over; a question where they may be voxels."""
    rest = 0 if part.compression != "none" else part.path.stat().st_size - part.bytes_needed
    if rest <= 0:
        return ()
    text = f"{part.path.name} holds {rest:,} bytes more than its voxels need"
    if rest % (part.plane_bytes * part.n_planes):
        return (warning("rest", f"{text}; they are left out"),)
    remedy = "Correct its header, or accept that the rest is left out (--accept rest)."
    text += f", {rest // (part.plane_bytes * part.n_planes) + 1} times as many: its type or size may be wrong"
    return (Problem("rest", text, remedy=remedy, resolved_by=("accept",)),)


def _raw(
    file: Path, stored: StoredVoxels, layout: Layout, n_planes: int, finish: Callable[[Plane], Plane]
) -> RawSource:
    packing: Compression = stored.packing  # type: ignore[assignment]
    source = RawSource(
        path=file,
        offset=_after_lines(file, stored),
        dtype=stored.dtype,
        plane_shape=layout.plane_shape,
        n_planes=n_planes,
        compression=packing,
        finish=finish,
        skip=stored.skip,
    )
    if stored.tail is None:
        return source
    end = file.stat().st_size - stored.tail
    return replace(source, offset=max(0, end - source.plane_bytes * n_planes), skip=0)


def _after_lines(file: Path, stored: StoredVoxels) -> int:
    if not stored.lines:
        return stored.offset
    with file.open("rb") as opened:
        opened.seek(stored.offset)
        for n in range(stored.lines):
            if not opened.readline(_LONGEST_LINE).endswith(b"\n"):
                raise VolumeError(f"it has no {stored.lines} lines to skip, only {n}", file=file)
        return opened.tell()


def _typed_out(file: Path, stored: StoredVoxels, layout: Layout) -> Plane:
    """Read voxels that are written out, as numbers or as hexadecimal bytes."""
    with file.open("rb") as opened:
        opened.seek(_after_lines(file, stored) + stored.skip)
        text = opened.read()
    shape = (layout.n_planes, *layout.plane_shape)
    n = int(np.prod(shape))
    try:
        if stored.packing == "hex":
            values = np.frombuffer(bytes.fromhex(text.decode("ascii")), stored.dtype)
        else:
            words = _LIST_COMMA.sub(b" ", text).split(maxsplit=n)
            values = np.array(words[:n], dtype=np.float64)
    except ValueError:
        raise VolumeError("its voxels, written as text, are not numbers", file=file) from None
    if len(values) < n:
        raise VolumeError(
            f"it holds {len(values):,} values, but {n:,} are needed: it is incomplete",
            file=file,
            remedy="Copy it again.",
        )
    planes: Plane = values[:n].astype(stored.dtype).reshape(shape)
    return planes
