"""The argument parser of all commands: a wrong command line is rejected in one line."""

from __future__ import annotations

import argparse
from typing import NoReturn

from gp_core.terminal import printable

__all__ = ["CommandParser"]


class CommandParser(argparse.ArgumentParser):
    """A parser that reports errors in one line with status 2; its subcommands do the same."""

    def error(self, message: str) -> NoReturn:
        """Report what is wrong and where to find help, then exit with status 2.

        Parameters
        ----------
        message : str
            What argparse found.
        """
        text = printable(" ".join(message.split()))
        self.exit(2, f"{self.prog.split()[0]}: {text}. See {self.prog} --help.\n")
