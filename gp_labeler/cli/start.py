"""Where both commands begin: nothing is imported yet, so Ctrl-C is one line from the start on."""

from __future__ import annotations

import os
import sys

TYPE_CHECKING = False  # `typing` and `signal` take as long to import as all the rest of this module
if TYPE_CHECKING:
    from collections.abc import Callable
    from types import FrameType
    from typing import Any

try:
    from _signal import SIGINT, signal  # type: ignore[import-not-found, unused-ignore]
except ImportError:  # another Python
    from signal import SIGINT, signal

__all__ = ["collect_seldom", "core", "labeler", "window"]


def core() -> int:
    """Run ``gp-core``."""
    before = _stop_at_once("gp-core")
    main = _main_of("gp_core.cli", "gp-core")
    signal(SIGINT, before)
    return int(main())


def labeler() -> int:
    """Run ``gp-labeler``, to be stopped at once at any time: each edit is in the journal, files are whole."""
    _stop_at_once("gp-labeler")
    collect_seldom()
    return int(_main_of("gp_labeler.cli.entry", "gp-labeler")())


def window() -> int:
    """Run ``gp-labeler`` from a desktop, where a program may have no streams to write to."""
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115, PTH123
    return labeler()


def collect_seldom() -> None:
    """Look for cycles of objects seldom: those of a thousand modules are made at the start, and stay."""
    import gc

    gc.set_threshold(50_000)


def _main_of(module: str, command: str) -> Callable[[], int]:
    """Return a command's main function, or one that says in a line that NumPy or the like is damaged."""
    try:
        from importlib import import_module

        main: Callable[[], int] = import_module(module).main
    except ImportError as error:
        first = str(error).strip().splitlines()[0]
        mend = "pip install --upgrade --force-reinstall gp-labeler"
        sys.stderr.write(f"{command}: the installation is damaged ({first}). Run {mend}\n")
        return lambda: 2
    return main


def _stop_at_once(command: str) -> Any:
    """End at Ctrl-C without an exception, which NumPy, Qt or VTK would report as a fault of their own."""

    def stop(_: int, __: FrameType | None) -> None:
        os.write(sys.__stderr__.fileno() if sys.__stderr__ else 2, f"{command}: stopped\n".encode())
        os._exit(130)

    return signal(SIGINT, stop)
