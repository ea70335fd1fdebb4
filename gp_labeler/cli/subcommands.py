"""The commands of ``gp-labeler`` beside the window, by name; each module is imported when it is needed."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any

__all__ = ["SUBCOMMANDS", "Subcommand", "with_subcommands"]


@dataclass(frozen=True)
class Subcommand:
    """Where a command is written.

    Parameters
    ----------
    module : str
        Of `gp_labeler.cli`.
    name : str
        The module has functions ``run_NAME``, which takes the words after the command and returns the
        status, and ``make_NAME_parser``.
    summary : str
        One line for lists of commands.
    """

    module: str
    name: str
    summary: str

    def run(self, arguments: Sequence[str]) -> int:
        """Run the command, and return its exit status."""
        status: int = self._function(f"run_{self.name}")(arguments)
        return status

    def parser(self) -> argparse.ArgumentParser:
        """Return the parser of its command line."""
        made: argparse.ArgumentParser = self._function(f"make_{self.name}_parser")()
        return made

    def _function(self, name: str) -> Callable[..., Any]:
        function: Callable[..., Any] = getattr(import_module(f"gp_labeler.cli.{self.module}"), name)
        return function


SUBCOMMANDS = {
    "mesh": Subcommand("mesh", "mesh", "extract the bone surface of a scan"),
    "phantom": Subcommand("phantom", "phantom", "make a synthetic head with known truth"),
    "straighten": Subcommand("straighten", "straighten", "find how the head lies in its scan"),
    "propose": Subcommand("propose", "propose", "suggest the landmarks of scans from labelled scans"),
    "check-library": Subcommand(
        "check_library", "check_library", "find labels that contradict the other labelled scans"
    ),
    "export": Subcommand("export", "export", "export landmarks for 3D Slicer and gp-core"),
    "list": Subcommand("specimens", "list", "list specimens and their progress"),
    "contact-sheet": Subcommand("specimens", "contact_sheet", "make PDFs that show every label, for review"),
    "simulate-tracker": Subcommand(
        "simulate_tracker", "simulator", "serve a simulated probe over OpenIGTLink, to practise with"
    ),
    "doctor": Subcommand("doctor", "doctor", "check this machine and report problems"),
}
"""All of them."""


def with_subcommands(parser: argparse.ArgumentParser) -> argparse.ArgumentParser:
    """Return a parser that knows the options of another one and all commands, for completion in a shell."""
    whole = argparse.ArgumentParser(
        prog=parser.prog, description=parser.description, parents=[parser], conflict_handler="resolve"
    )
    for positional in [action for action in whole._actions if not action.option_strings]:
        whole._remove_action(positional)  # a file: shells complete those by themselves
    commands = whole.add_subparsers(metavar="COMMAND")
    for name, command in SUBCOMMANDS.items():
        commands.add_parser(
            name, help=command.summary, parents=[command.parser()], conflict_handler="resolve", add_help=False
        )
    return whole
