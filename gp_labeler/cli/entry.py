"""The command ``gp-labeler``: the window, and meshing without one."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from gp_core import __version__
from gp_core.command_line import CommandParser, add_completion
from gp_core.errors import GpError
from gp_core.standard_streams import STANDARD
from gp_core.terminal import leave_output, plain_terminal
from gp_labeler.cli.subcommands import SUBCOMMANDS, with_subcommands
from gp_labeler.system.installation import explain_import
from gp_labeler.system.plain_numbers import use_plain_numbers

__all__ = ["main", "make_parser"]

_EXAMPLE = """examples:
  gp-labeler                                  open the window
  gp-labeler head.nrrd                        open a scan, or a saved specimen
  gp-labeler --demo                           open a synthetic head
  gp-labeler --offscreen demo --output out    run the demo without a display
"""


def make_parser() -> argparse.ArgumentParser:
    """Return the parser of the window's command line."""
    parser = CommandParser(
        prog="gp-labeler",
        description="Label guinea-pig heads in micro-CT.",
        epilog=f"{_EXAMPLE}\n{_commands()}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"gp-labeler {__version__}")
    add_completion(parser, lambda: with_subcommands(make_parser()))
    parser.add_argument(
        "path",
        nargs="?",
        type=Path,
        metavar="VOLUME|SPECIMEN",
        help="scan, folder of slices, or specimen to open",
    )
    parser.add_argument("--demo", action="store_true", help="open a synthetic head")
    parser.add_argument(
        "--state",
        type=Path,
        metavar="DIR",
        help="folder for unsaved edits; default: in the user's state folder",
    )
    parser.add_argument(
        "--observer",
        metavar="NAME",
        help="name or initials of the person who labels; default: as set in the window",
    )
    offscreen = parser.add_argument_group("without a display")
    offscreen.add_argument(
        "--offscreen", metavar="SCRIPT|demo", help="run a script in the window, without a display"
    )
    offscreen.add_argument("--output", type=Path, metavar="DIR", help="folder for the results of the script")
    offscreen.add_argument(
        "--specimens", nargs="+", default=(), metavar="S", help="names to use for {specimen} in the script"
    )
    desktop = parser.add_argument_group("on the desktop")
    desktop.add_argument(
        "--install-desktop",
        action="store_true",
        help="add gp-labeler to the desktop's menu and open specimens and NRRD scans with it (Linux)",
    )
    desktop.add_argument("--remove-desktop", action="store_true", help="undo --install-desktop")
    return parser


def _commands() -> str:
    width = max(map(len, SUBCOMMANDS)) + 2
    rows = (f"  {name:{width}}{command.summary}\n" for name, command in SUBCOMMANDS.items())
    return f"commands (help: gp-labeler COMMAND --help):\n{''.join(rows)}"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command.

    Returns
    -------
    int
        0; 2 where the input is wrong or the installation incomplete, said in one line.
    """
    use_plain_numbers()
    with plain_terminal():
        return _run(arguments)


def _run(arguments: Sequence[str] | None) -> int:
    given = list(sys.argv[1:] if arguments is None else arguments)
    try:
        if given and given[0] in SUBCOMMANDS:
            return SUBCOMMANDS[given[0]].run(given[1:])
        return _window(make_parser().parse_args(given))
    except GpError as error:
        return _refuse(error)
    except ImportError as error:
        return _refuse(explain_import(error))
    except BrokenPipeError:  # who reads has read enough, such as `head`
        leave_output()
        return 141
    except MemoryError:
        return _refuse(GpError("there is not enough memory for this", remedy="Close other programs."))
    except OSError as error:
        sys.stderr.write(f"gp-labeler: {error.filename or 'file'}: {error.strerror or error}\n")
        return 2
    except KeyboardInterrupt:
        sys.stderr.write("gp-labeler: stopped\n")
        return 130


def _refuse(error: GpError) -> int:
    sys.stderr.write(f"gp-labeler: {error}\n")
    return 2


def _window(args: argparse.Namespace) -> int:
    _check_together(args)
    if args.install_desktop or args.remove_desktop:
        return _change_desktop(install=args.install_desktop)
    if args.offscreen is not None:
        from gp_labeler.scripting.command import run_offscreen

        return run_offscreen(args.offscreen, args.output, args.specimens)
    if str(args.path) == STANDARD:
        raise GpError(
            "the window opens files by name, not from a stream", remedy="Give a path in place of -."
        )
    if args.path is not None and not args.path.exists():
        raise GpError(
            "does not exist", file=args.path, remedy="Give a scan, a folder of slices or a specimen."
        )
    from gp_labeler.views.application import run_window  # here: `--help` need not wait for Qt and VTK

    return run_window(args.path, demo=args.demo, directory=args.state, observer=args.observer)


def _change_desktop(*, install: bool) -> int:
    from gp_labeler.system.desktop_entry import install_desktop, remove_desktop

    for path in install_desktop() if install else remove_desktop():
        sys.stdout.write(f"{'wrote' if install else 'removed'} {path}\n")
    return 0


def _check_together(args: argparse.Namespace) -> None:
    """Refuse words that would be ignored."""
    if args.offscreen is None:
        for option, value in (("--output", args.output), ("--specimens", args.specimens)):
            if value:
                raise GpError(f"{option} is for a script", remedy="Give --offscreen SCRIPT, or leave it out.")
        if args.demo and args.path is not None:
            raise GpError("--demo opens the synthetic head, and a path was given too", remedy="Give one.")
        return
    words = (("--demo", args.demo), ("--state", args.state), ("--observer", args.observer))
    for option, value in (*words, (f"{args.path}", args.path)):
        if value:
            raise GpError(f"{option} is for the window, not for --offscreen", remedy="Leave it out.")


if __name__ == "__main__":
    sys.exit(main())
