"""The command line ``gp-core``: a thin layer over the functions at the top of `gp_core`."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from importlib import import_module

from gp_core import __version__
from gp_core.cli.options import keeping_inputs, streams_of
from gp_core.command_line import CommandParser, add_completion
from gp_core.errors import GpError
from gp_core.extras import missing_package
from gp_core.terminal import leave_output, plain_terminal

__all__ = ["main", "make_parser"]

_COMMANDS = (
    "estimate",
    "serve",
    "register",
    "pivot",
    "touches",
    "fit",
    "import-mat",
    "check",
    "reliability",
    "distances",
    "leave-one-out",
    "search",
    "simulate",
    "compare",
    "physical",
    "conditions",
    "draw",
)
"""Each is written in the module of its name, and imported where it is run or all are listed."""


def make_parser(names: Sequence[str] = _COMMANDS) -> argparse.ArgumentParser:
    """Return the parser.

    Parameters
    ----------
    names : sequence of str
        The commands that it knows; by default all of them.

    Returns
    -------
    argparse.ArgumentParser
        Of ``gp-core``.
    """
    parser = CommandParser(
        prog="gp-core",
        description="Atlas of guinea-pig ear landmarks, and cochlea poses from touched points.",
    )
    parser.add_argument("--version", action="version", version=f"gp-core {__version__}")
    add_completion(parser)
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    for name in names:
        import_module(f"gp_core.cli.{name.replace('-', '_')}").add(commands)
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command.

    Parameters
    ----------
    arguments : sequence of str, optional
        By default those of the process.

    Returns
    -------
    int
        Exit status: 0; 1 where a check found something; 2 where the input is wrong (reported in one line); 3
        where a pose was not written because names or side look wrong; 130 after Ctrl-C, and 141 where the
        reader of the output has gone, as in shells.
    """
    with plain_terminal():
        return _run(arguments)


def _run(arguments: Sequence[str] | None) -> int:
    given = sys.argv[1:] if arguments is None else arguments
    args = make_parser([name for name in _COMMANDS if name in given[:1]] or _COMMANDS).parse_args(given)
    try:
        with streams_of(args), keeping_inputs(args):
            status: int = args.run(args)
        sys.stdout.flush()
    except GpError as error:
        sys.stderr.write(f"gp-core: {error}\n")
        return 2
    except ModuleNotFoundError as error:
        package = (error.name or "").partition(".")[0]
        if package in ("", "gp_core"):
            raise
        sys.stderr.write(f"gp-core: {missing_package(package)}\n")
        return 2
    except BrokenPipeError:  # the reader has exited, such as `head`
        leave_output()
        return 141
    except MemoryError:
        sys.stderr.write("gp-core: there is not enough memory for this; close other programs\n")
        return 2
    except OSError as error:
        sys.stderr.write(f"gp-core: {error.filename or 'file'}: {error.strerror or error}\n")
        return 2
    except KeyboardInterrupt:
        sys.stderr.write("gp-core: stopped\n")
        return 130
    return status


if __name__ == "__main__":
    sys.exit(main())
