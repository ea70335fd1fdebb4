"""How commands take their words: a wrong one is refused in one line, as everything else is."""

from __future__ import annotations

import argparse
from typing import NoReturn

from gp_core.terminal import printable

__all__ = ["CommandParser"]


class CommandParser(argparse.ArgumentParser):
    """A parser that says what is wrong in one line, with status 2; its subcommands do the same."""

    def error(self, message: str) -> NoReturn:
        """Say what is wrong and where the help is, then end."""
        text = printable(" ".join(message.split()))
        self.exit(2, f"{self.prog.split()[0]}: {text}. See {self.prog} --help.\n")
