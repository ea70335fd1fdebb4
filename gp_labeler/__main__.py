"""The command ``gp-labeler``: the window, and meshing without one."""

from __future__ import annotations

import argparse
import logging
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from gp_core import __version__
from gp_core.errors import GpError

__all__ = ["main", "make_parser"]

_EXAMPLE = """examples:
  gp-labeler                          the window
  gp-labeler head.nrrd                the window with a scan, or a specimen saved before
  gp-labeler --demo                   the window with a synthetic head
  gp-labeler --offscreen demo --output out    the demo without a display
  gp-labeler mesh head.nrrd -o head.ply
"""


def make_parser() -> argparse.ArgumentParser:
    """Return the parser of the window's command line."""
    parser = argparse.ArgumentParser(
        prog="gp-labeler",
        description="Label guinea-pig heads in micro-CT.",
        epilog=_EXAMPLE,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"gp-labeler {__version__}")
    parser.add_argument("path", nargs="?", type=Path, metavar="VOLUME|SPECIMEN", help="what to open")
    parser.add_argument("--demo", action="store_true", help="open a synthetic head")
    offscreen = parser.add_argument_group("without a display")
    offscreen.add_argument(
        "--offscreen", metavar="SCRIPT|demo", help="do what a script says, in the same window, unseen"
    )
    offscreen.add_argument("--output", type=Path, metavar="DIR", help="where what it makes goes")
    offscreen.add_argument(
        "--specimens", nargs="+", default=(), metavar="S", help="what {specimen} in the script stands for"
    )
    return parser


def make_mesh_parser() -> argparse.ArgumentParser:
    """Return the parser of ``gp-labeler mesh``."""
    parser = argparse.ArgumentParser(
        prog="gp-labeler mesh", description="Write the bone surface of a scan, LPS mm."
    )
    parser.add_argument("volume", type=Path, metavar="VOLUME")
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="MESH", help=".ply, .stl or .vtp")
    parser.add_argument("--threshold", type=float, metavar="T", help="grey value where bone begins")
    parser.add_argument(
        "--spacing", type=float, nargs="+", metavar="MM", help="voxel size: one number, or x y z"
    )
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command.

    Returns
    -------
    int
        0; 2 where the input is wrong, said in one line.
    """
    logging.basicConfig(format="gp-labeler: %(message)s", level=logging.WARNING)
    given = list(sys.argv[1:] if arguments is None else arguments)
    try:
        if given[:1] == ["mesh"]:
            return _mesh(make_mesh_parser().parse_args(given[1:]))
        return _window(make_parser().parse_args(given))
    except GpError as error:
        sys.stderr.write(f"gp-labeler: {error}\n")
        return 2
    except OSError as error:
        sys.stderr.write(f"gp-labeler: {error.filename or 'file'}: {error.strerror or error}\n")
        return 2
    except KeyboardInterrupt:
        sys.stderr.write("gp-labeler: stopped\n")
        return 130


def _window(args: argparse.Namespace) -> int:
    if args.offscreen is not None:
        from gp_labeler.offscreen.command import run_offscreen

        return run_offscreen(args.offscreen, args.output, args.specimens)
    if args.path is not None and not args.path.exists():
        raise GpError(
            "does not exist", file=args.path, remedy="Give a scan, a folder of slices or a specimen."
        )
    from gp_labeler.views.application import run_window  # here: `--help` need not wait for Qt and VTK

    return run_window(args.path, demo=args.demo)


def _mesh(args: argparse.Namespace) -> int:
    from gp_labeler.imaging.readers import read_volume
    from gp_labeler.imaging.surface import extract_isosurface
    from gp_labeler.imaging.threshold import propose_threshold

    options: dict[str, Any] = {} if args.spacing is None else {"spacing": _spacing(args.spacing)}
    volume = read_volume(args.volume, **options)
    threshold = propose_threshold(volume) if args.threshold is None else args.threshold
    surface = extract_isosurface(volume, threshold)
    surface.save(args.output)
    sys.stdout.write(
        f"{args.output}: {surface.n_triangles} triangles, threshold {threshold:g}, {volume.name} "
        f"({' x '.join(f'{s:g}' for s in volume.spacing)} mm)\n"
    )
    return 0


def _spacing(numbers: list[float]) -> float | list[float]:
    if len(numbers) not in (1, 3):
        raise GpError(f"--spacing must be one number or three, got {len(numbers)}")
    return numbers[0] if len(numbers) == 1 else numbers


if __name__ == "__main__":
    sys.exit(main())
