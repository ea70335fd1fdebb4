"""Where voxels come from: plane after plane, so that loading can tell how far it is, stop, and skip."""

from __future__ import annotations

import bz2
import io
import zlib
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, Literal, Protocol

import numpy as np
from numpy.typing import DTypeLike, NDArray

from gp_core.errors import GpError
from gp_labeler.imaging.mapped_file import MappedFile, can_map
from gp_labeler.imaging.progress import Report
from gp_labeler.imaging.readers.grey import to_grey
from gp_labeler.imaging.readers.options import ImportOptions, Region
from gp_labeler.imaging.readers.problems import Problem, VolumeError, failing_as_volume_error

__all__ = [
    "Compression",
    "FileSource",
    "Mapped",
    "RawSource",
    "SliceSource",
    "assemble",
    "in_threads",
    "mapped_part",
    "nearest_there",
    "open_stream",
    "wanted_planes",
    "window",
]

Plane = NDArray[Any]
Mapped = tuple[Plane, MappedFile]
"""The (z, y, x) values, and the file that holds them."""

_CHUNK = 1 << 18
_DECODERS = 4
_DEFLATE_AT_MOST = 1032
"""How many times deflate can shrink data (RFC 1951: 258 bytes in two bits)."""

Compression = Literal["none", "gzip", "zlib", "bzip2"]


class SliceSource(Protocol):
    """Something that yields grey planes."""

    def planes(self, wanted: Sequence[int]) -> Iterator[Plane]:
        """Yield the (y, x) grey planes with the numbers `wanted`, which rise."""
        ...


@dataclass(frozen=True)
class RawSource:
    """Voxels that lie in one file as they are, or compressed as one stream.

    Parameters
    ----------
    path : Path
        File that holds them.
    offset : int
        Bytes of the file before the voxels, or before their compressed stream.
    dtype : dtype
        Of one stored value, with its byte order.
    plane_shape : tuple
        (y, x), or (y, x, channels).
    n_planes : int
        How many there are.
    compression : str
        How the stream is packed.
    plane_step : int, optional
        Bytes from one plane to the next where they do not touch.
    finish : callable, optional
        Applied to each plane: scaling, inversion, choice of a channel.
    skip : int
        Bytes of the unpacked stream before the first voxel.
    """

    path: Path
    offset: int
    dtype: np.dtype[Any]
    plane_shape: tuple[int, ...]
    n_planes: int
    compression: Compression = "none"
    plane_step: int | None = None
    finish: Callable[[Plane], Plane] = to_grey
    skip: int = 0

    @property
    def plane_bytes(self) -> int:
        """Bytes of one stored plane."""
        return int(np.prod(self.plane_shape)) * self.dtype.itemsize

    @property
    def bytes_needed(self) -> int:
        """Bytes up to the end of the last plane, unpacked."""
        return (
            self.offset
            + self.skip
            + (self.plane_step or self.plane_bytes) * (self.n_planes - 1)
            + self.plane_bytes
        )

    def shortage(self) -> tuple[Problem, ...]:
        """Return the problem that the file is too short for its voxels, if it is, packed or not."""
        have, need = self.path.stat().st_size, self.bytes_needed
        if self.compression in ("gzip", "zlib"):
            have = self.offset + _DEFLATE_AT_MOST * max(0, have - self.offset)
        if self.compression == "bzip2" or have >= need:
            return ()
        if self.compression != "none":
            have = self.path.stat().st_size
            text = (
                f"{self.path.name} holds {have:,} packed bytes, which cannot make {need:,}: it is incomplete"
            )
            return (Problem("short-file", text, remedy="Copy it again."),)
        text = f"{self.path.name} holds {have:,} bytes, but {need:,} are needed: it is incomplete"
        return (Problem("short-file", text, remedy="Copy it again."),)

    @property
    def is_mappable(self) -> bool:
        """Whether its values can be shown as they are stored, and files can be mapped at all."""
        as_stored = self.compression == "none" and self.finish is to_grey and len(self.plane_shape) == 2
        return as_stored and can_map()

    def mapped(self) -> Mapped | None:
        """Return the (z, y, x) file as a map, if its values can be shown as they are stored."""
        if not self.is_mappable:
            return None
        file = MappedFile(self.path, self.bytes_needed)
        shape = (self.n_planes, *self.plane_shape)
        return file.array(self.dtype, self.offset + self.skip, shape, self.plane_step), file

    def planes(self, wanted: Sequence[int]) -> Iterator[Plane]:
        """Yield the (y, x) grey planes with the numbers `wanted`, which rise; each is good until the next."""
        buffer = bytearray(self.plane_bytes)
        stored: Plane = np.frombuffer(buffer, self.dtype).reshape(self.plane_shape)
        step = self.plane_step or self.plane_bytes
        position = 0
        with open_stream(self.path, self.compression, self.offset) as stream:
            for number in wanted:
                start = self.skip + step * number
                if start != position:
                    _advance(stream, position, start, self.offset if self.compression == "none" else None)
                if _fill(stream, buffer) < len(buffer):
                    raise VolumeError(
                        f"it ends within slice {number + 1} of {self.n_planes}",
                        file=self.path,
                        remedy="The file is incomplete: copy it again.",
                    )
                position = start + len(buffer)
                yield self.finish(stored)
            if isinstance(stream, _Unpacked) and self.offset + position == self.bytes_needed:
                stream.compare_checksum(self.plane_bytes)


@dataclass(frozen=True)
class FileSource:
    """One plane a file; a missing one is stood in for by its nearest neighbour.

    Parameters
    ----------
    files : tuple of Path or None
        In slice order.
    decode : callable
        Reads the grey plane of one file.
    """

    files: tuple[Path | None, ...]
    decode: Callable[[Path], Plane]

    def planes(self, wanted: Sequence[int]) -> Iterator[Plane]:
        """Yield the (y, x) grey planes with the numbers `wanted`, which rise."""
        there = [file for file in self.files if file is not None]
        stands_in = nearest_there([file is not None for file in self.files])
        nearest = [there[stands_in[number]] for number in wanted]
        shape: tuple[int, ...] | None = None
        for file, plane in zip(nearest, in_threads(self._decode, nearest), strict=True):
            shape = shape or plane.shape
            if plane.shape != shape:
                raise VolumeError(f"it is {_times(plane.shape)}, the other slices {_times(shape)}", file=file)
            yield plane

    def _decode(self, file: Path) -> Plane:
        with failing_as_volume_error(file):
            return self.decode(file)


def nearest_there(there: Sequence[bool]) -> list[int]:
    """Return for each slice the nearest of those that are there, counted among these; of two the lower."""
    places = np.flatnonzero(there)
    after = np.searchsorted(places, np.arange(len(there))).clip(0, len(places) - 1)
    before = (after - 1).clip(0)
    far = np.arange(len(there)) - places[before] > places[after] - np.arange(len(there))
    nearer: list[int] = np.where(far | (places[after] == np.arange(len(there))), after, before).tolist()
    return nearer


def in_threads(make: Callable[[Any], Plane], things: Iterable[Any]) -> Iterator[Plane]:
    """Yield ``make(thing)`` for each thing in order, a few of them made ahead by other threads."""
    with ThreadPoolExecutor(_DECODERS, thread_name_prefix="gp-decode") as pool:
        ahead: deque[Future[Plane]] = deque()
        try:
            for thing in things:
                ahead.append(pool.submit(make, thing))
                if len(ahead) > 2 * _DECODERS:
                    yield ahead.popleft().result()
            while ahead:
                yield ahead.popleft().result()
        finally:
            for future in ahead:
                future.cancel()


def assemble(
    source: SliceSource, size: tuple[int, int, int], dtype: DTypeLike, options: ImportOptions, report: Report
) -> Plane:
    """Read the wanted part of a volume of `size` (x, y, z) into one (z, y, x) array of `dtype`."""
    i, j, k = window(size, options)
    volume = np.empty((len(k), len(j), len(i)), dtype)
    for n, plane in enumerate(wanted_planes(source, size, options, report)):
        volume[len(k) - 1 - n if options.reverse else n] = plane
    report(1.0)
    return volume


def wanted_planes(
    source: SliceSource, size: tuple[int, int, int], options: ImportOptions, report: Report
) -> Iterator[Plane]:
    """Yield the wanted part of each wanted plane in the order of the files: the last first, if reversed."""
    i, j, k = window(size, options)
    nz = size[2]
    wanted = [nz - 1 - n for n in reversed(k)] if options.reverse else list(k)
    ys, xs = slice(j.start, j.stop, j.step), slice(i.start, i.stop, i.step)
    for n, plane in enumerate(source.planes(wanted)):
        report(n / len(wanted))
        if plane.shape != (size[1], size[0]):
            raise VolumeError(
                f"slice {wanted[n] + 1} is {_times(plane.shape)}, not {size[0]} x {size[1]} pixels"
            )
        yield plane[ys, xs]


def mapped_part(source: SliceSource, size: tuple[int, int, int], options: ImportOptions) -> Mapped | None:
    """Return the wanted part of a volume of `size` (x, y, z) in its mapped file; None if it cannot be."""
    mapped = source.mapped() if isinstance(source, RawSource) else None
    if mapped is None:
        return None
    whole, file = mapped
    i, j, k = window(size, options)
    planes = whole[: size[2]][:: -1 if options.reverse else 1]  # a list of volumes begins with the first
    return planes[k.start : k.stop : k.step, j.start : j.stop : j.step, i.start : i.stop : i.step], file


def window(size: tuple[int, int, int], options: ImportOptions) -> tuple[range, range, range]:
    """Return the voxels to keep along i, j, k, counted in the whole (reversed, if asked) volume.

    Raises
    ------
    GpError
        The region reaches beyond the volume.
    """
    region: Region = options.region or ((0, size[0]), (0, size[1]), (0, size[2]))
    for (low, high), n, axis in zip(region, size, "ijk", strict=True):
        if high > n:
            raise GpError(f"the region must lie within the volume: {axis} is 0 to {n}, got {low} to {high}")
    i, j, k = (range(low, high, options.stride) for low, high in region)
    return i, j, k


def open_stream(path: Path, compression: Compression, offset: int = 0) -> IO[bytes] | io.RawIOBase:
    """Open the bytes of a file from `offset` on, unpacked."""
    file = path.open("rb", buffering=0)
    file.seek(offset)
    if compression == "none":
        return file
    return _Unpacked(file, bz2.BZ2Decompressor if compression == "bzip2" else _inflator)


def _inflator() -> Any:
    return zlib.decompressobj(zlib.MAX_WBITS | 32)  # zlib or gzip, as the stream begins; checks its checksum


class _Unpacked(io.RawIOBase):
    """A packed stream, of several pieces perhaps, unpacked while it is read.

    The modules gzip and bz2 do the same at half the speed, for they read 8 KB at a time.
    """

    def __init__(self, file: io.RawIOBase, unpacker: Callable[[], Any]) -> None:
        self._file, self._unpacker = file, unpacker
        self._piece = unpacker()
        self._packed = b""

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int:
        while True:
            if self._piece.eof:  # another piece may follow, or padding
                self._packed = self._piece.unused_data or self._file.read(_CHUNK) or b""
                if not self._packed.strip(b"\0"):
                    return 0
                self._piece = self._unpacker()
            data, goes_on = self._unpack(len(buffer))
            if data:
                buffer[: len(data)] = data
                return len(data)
            if not goes_on:
                return 0  # it ends early; whoever reads finds the plane short

    def compare_checksum(self, within: int) -> None:
        """Go on to the end of a piece all of which was read: unpacking compares the checksum that is there.

        Bytes that changed on the way may unpack to others without any error; only the checksum tells. A piece
        that goes on for more than `within` bytes holds more than was asked for, and is not compared.
        """
        goes_on = True
        while goes_on and not self._piece.eof and within >= 0:
            data, goes_on = self._unpack(_CHUNK)
            within -= len(data)

    def _unpack(self, most: int) -> tuple[bytes, bool]:
        """Return the next bytes, so many at most, and whether any may follow."""
        full = not getattr(self._piece, "needs_input", True)  # bz2 keeps what it could not give out yet
        packed = b"" if full else self._packed or self._file.read(_CHUNK) or b""
        data = self._piece.decompress(packed, most)
        self._packed = getattr(self._piece, "unconsumed_tail", b"")
        return data, bool(packed) or full or self._piece.eof

    def close(self) -> None:
        self._file.close()
        super().close()


def _fill(stream: IO[bytes] | io.RawIOBase, buffer: bytearray) -> int:
    view, filled = memoryview(buffer), 0
    while filled < len(buffer):
        got = stream.readinto(view[filled:])  # type: ignore[union-attr]
        if not got:
            break
        filled += got
    return filled


def _advance(stream: IO[bytes] | io.RawIOBase, position: int, to: int, seek_base: int | None) -> None:
    """Go to byte `to` of the unpacked stream: by seeking where it is not packed, else by reading on."""
    if seek_base is not None:
        stream.seek(seek_base + to)
        return
    while position < to:
        got = _fill(stream, bytearray(min(to - position, 1 << 20)))
        if not got:
            return  # the next plane will be short, and say so
        position += got


def _times(shape: Sequence[int]) -> str:
    return " x ".join(str(n) for n in reversed(shape)) + " pixels"
