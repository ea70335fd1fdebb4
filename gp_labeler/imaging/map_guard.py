"""Files that are mapped into memory, and cut by another program meanwhile: an error instead of a crash.

To read a page of a map that the file does not reach any more raises the signal SIGBUS, which ends a process;
so does a page that a failing disk or a lost network drive cannot deliver. A handler puts pages of zeros in
the place of those that are gone, and marks the map as broken; whoever reads it asks for the mark afterwards.

Faults come in any thread and in the middle of compiled loops, where no Python may run. The handler is
therefore a small compiled function. It is built by llvmlite, which Numba brings and which loads fast.
"""

from __future__ import annotations

import ctypes
import mmap
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any, Final

import numpy as np

__all__ = ["GuardedMap", "maps_can_be_guarded"]

_SIGBUS: Final = {"linux": 7, "darwin": 10}
_SA_SIGINFO: Final = {"linux": 4, "darwin": 0x40}
_ADDRESS_IN_SIGINFO: Final = {"linux": 16, "darwin": 24}
"""Byte offset of ``si_addr``, 64 bit."""

_MAP_FIXED_PRIVATE_ANONYMOUS: Final = {"linux": 0x10 | 0x02 | 0x20, "darwin": 0x10 | 0x02 | 0x1000}
_PROT_READ: Final = 1

_NAME: Final = "gp_on_sigbus"
_MOST_MAPS: Final = 64
_START, _END, _BROKEN = range(3)
_table = np.zeros((_MOST_MAPS + 1, 3), dtype=np.int64)
"""What the handler knows of each map: first and end address, whether it is broken. The last row is no map."""

_lock = threading.Lock()
_installed: list[Any] = []
"""What must live as long as the handler may be called."""


def maps_can_be_guarded() -> bool:
    """Whether a map of this process survives that its file is cut; on Windows, files in use cannot be cut."""
    if sys.platform == "win32":
        return True
    if sys.platform not in _SIGBUS or sys.maxsize < 1 << 32:
        return False
    with _lock:
        if not _installed:
            try:
                _install()
            except (ImportError, OSError, RuntimeError, AttributeError):
                return False
    return True


class GuardedMap:
    """A file mapped for reading; NumPy arrays of it keep it alive.

    Parameters
    ----------
    fileno : int
        File descriptor, which may be closed afterwards.
    length : int
        Bytes to map, from the beginning of the file.
    page_by_page : bool
        Whether the system reads no more than what is asked for. A file that the memory holds is read sooner
        as a whole; of a larger one, each voxel of a row would bring megabytes after it.

    Raises
    ------
    OSError
        The file cannot be mapped, or too many are.
    ValueError
        The file is shorter.
    """

    def __init__(self, fileno: int, length: int, *, page_by_page: bool = False) -> None:
        self._map = mmap.mmap(fileno, length, access=mmap.ACCESS_READ)
        self._length = length
        self._start = int(np.frombuffer(self._map, np.uint8).ctypes.data)
        self._usual_advice = "MADV_RANDOM" if page_by_page else "MADV_NORMAL"
        self._advise(self._usual_advice)
        end = self._start + -(-length // mmap.PAGESIZE) * mmap.PAGESIZE
        self.__array_interface__ = {
            "data": (self._start, True),
            "shape": (length,),
            "typestr": "|u1",
            "version": 3,
        }
        with _lock:
            free = np.flatnonzero(_table[:_MOST_MAPS, _START] == 0)
            if not len(free):
                raise OSError(f"more than {_MOST_MAPS} files are mapped at a time")
            self._row = int(free[0])
            _table[self._row, [_END, _BROKEN]] = end, 0
            _table[self._row, _START] = self._start

    @property
    def broken(self) -> bool:
        """Whether some of what was read was not there any more, and came as zeros."""
        return bool(_table[self._row, _BROKEN])

    def fetch(self, address: int, n_bytes: int) -> None:
        """Have the system read a part of the file ahead, in one piece.

        Parameters
        ----------
        address : int
            Of the first byte, in memory.
        n_bytes : int
            How many.
        """
        begin = max(0, address - self._start) // mmap.PAGESIZE * mmap.PAGESIZE
        end = min(address - self._start + n_bytes, self._length)
        if hasattr(mmap, "MADV_WILLNEED") and end > begin:
            with suppress(OSError, ValueError):
                self._map.madvise(mmap.MADV_WILLNEED, begin, end - begin)

    @contextmanager
    def page_by_page(self) -> Iterator[None]:
        """Have the system read no more than the pages that are asked for, until the context ends."""
        self._advise("MADV_RANDOM")
        try:
            yield
        finally:
            self._advise(self._usual_advice)

    def _advise(self, advice: str) -> None:
        """Tell the system how the file will be read, where it can be told."""
        if hasattr(mmap, advice):
            self._map.madvise(getattr(mmap, advice))

    def close(self) -> None:
        """Let go of the file; raises no error where arrays still hold it."""
        with suppress(BufferError):
            self._map.close()

    def __del__(self) -> None:
        if hasattr(self, "_row"):
            _table[self._row, _START] = 0


def _install() -> None:
    """Compile the handler, and have the system call it; what was there before gets all other faults."""
    libc = ctypes.CDLL(None, use_errno=True)
    before = ctypes.create_string_buffer(256)
    engine = _compiled(str(_handler(ctypes.addressof(before), _address(libc.sigaction), _address(libc.mmap))))
    action = _action(engine.get_function_address(_NAME))
    if libc.sigaction(_SIGBUS[sys.platform], action, before) != 0:
        raise OSError("the system does not allow a handler")
    _installed.extend((engine, before, action))


def _address(function: Any) -> int:
    return ctypes.cast(function, ctypes.c_void_p).value or 0


def _action(handler: int) -> ctypes.Array[ctypes.c_char]:
    """Return a ``struct sigaction`` (glibc and musl; macOS) that calls the handler."""
    mask = bytes(4 if sys.platform == "darwin" else 128)
    flags = _SA_SIGINFO[sys.platform].to_bytes(4, "little")
    return ctypes.create_string_buffer(handler.to_bytes(8, "little") + mask + flags, 256)


def _compiled(module: str) -> Any:
    """Compile a module to machine code; return the engine that holds it."""
    import llvmlite.binding as llvm

    with suppress(RuntimeError):  # no longer needed, and refused, from llvmlite 0.45 on
        llvm.initialize()
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    machine = llvm.Target.from_default_triple().create_target_machine()
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(module), machine)
    engine.finalize_object()
    return engine


def _handler(before: int, sigaction: int, map_: int) -> Any:
    """Return ``void gp_on_sigbus(int signal, siginfo_t *info, void *context)`` in LLVM's language.

    It looks for the map that holds the address of the fault, and puts zeros there. A fault elsewhere is left
    to the handler before, which the system calls when the same instruction fails again.

    Parameters
    ----------
    before : int
        Address of the ``struct sigaction`` that was in effect before.
    sigaction, map_ : int
        Addresses of the system's functions ``sigaction`` and ``mmap``.
    """
    from llvmlite import ir

    i32, i64 = ir.IntType(32), ir.IntType(64)
    module = ir.Module("gp_map_guard")
    function = ir.Function(module, ir.FunctionType(ir.VoidType(), [i32, i64, i64]), _NAME)
    names = ("begin", "look", "is_end", "next", "found", "elsewhere")
    begin, look, is_end, next_, found, elsewhere = map(function.append_basic_block, names)

    def number_at(build: Any, address: Any, offset: int) -> Any:
        return build.inttoptr(build.add(address, i64(offset)), i64.as_pointer())

    build = ir.IRBuilder(begin)
    fault = build.load(number_at(build, function.args[1], _ADDRESS_IN_SIGINFO[sys.platform]))
    build.branch(look)
    build = ir.IRBuilder(look)
    row = build.phi(i64)
    start = build.load(number_at(build, row, 8 * _START))
    end = build.load(number_at(build, row, 8 * _END))
    not_before = build.icmp_unsigned("<=", start, fault)
    inside = build.and_(not_before, build.icmp_unsigned("<", fault, end))
    build.cbranch(build.and_(inside, build.icmp_unsigned("!=", start, i64(0))), found, is_end)
    build = ir.IRBuilder(is_end)
    last = i64(int(_table[_MOST_MAPS:].ctypes.data))
    build.cbranch(build.icmp_unsigned("==", row, last), elsewhere, next_)
    build = ir.IRBuilder(next_)
    row.add_incoming(build.add(row, i64(_table.strides[0])), next_)
    row.add_incoming(i64(int(_table.ctypes.data)), begin)
    build.branch(look)

    build = ir.IRBuilder(found)
    build.store(i64(1), number_at(build, row, 8 * _BROKEN))
    _put_zeros(build, map_, build.and_(fault, i64(-mmap.PAGESIZE)), end)
    build.ret_void()
    build = ir.IRBuilder(elsewhere)
    kind = ir.FunctionType(i32, [i32, i64, i64])
    restore = build.inttoptr(i64(sigaction), kind.as_pointer())
    build.call(restore, [function.args[0], i64(before), i64(0)])
    build.ret_void()
    return module


def _put_zeros(build: Any, map_: int, page: Any, end: Any) -> None:
    """Map pages of zeros from a page to the end of its map: one call, however many pages are gone."""
    from llvmlite import ir

    i32, i64 = ir.IntType(32), ir.IntType(64)
    kind = ir.FunctionType(i64, [i64, i64, i32, i32, i32, i64])
    flags = i32(_MAP_FIXED_PRIVATE_ANONYMOUS[sys.platform])
    function = build.inttoptr(i64(map_), kind.as_pointer())
    build.call(function, [page, build.sub(end, page), i32(_PROT_READ), flags, i32(-1), i64(0)])
