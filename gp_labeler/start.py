"""Where both commands begin: nothing heavy is imported yet, so Ctrl-C is one line from the start on."""

from __future__ import annotations

import os
import signal
import sys
from importlib import import_module
from types import FrameType
from typing import Any

__all__ = ["core", "labeler"]


def core() -> int:
    """Run ``gp-core``."""
    before = _stop_at_once("gp-core")
    main = import_module("gp_core.cli").main
    signal.signal(signal.SIGINT, before)
    return int(main())


def labeler() -> int:
    """Run ``gp-labeler``, to be stopped at once at any time: each edit is in the journal, files are whole."""
    _stop_at_once("gp-labeler")
    return int(import_module("gp_labeler.__main__").main())


def _stop_at_once(command: str) -> Any:
    """End at Ctrl-C without an exception, which NumPy, Qt or VTK would report as a fault of their own."""

    def stop(_: int, __: FrameType | None) -> None:
        os.write(sys.__stderr__.fileno() if sys.__stderr__ else 2, f"{command}: stopped\n".encode())
        os._exit(130)

    return signal.signal(signal.SIGINT, stop)
