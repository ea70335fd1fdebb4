"""The command ``gp-labeler mesh``: the bone surface of a scan, without a window."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from gp_core.command_line import CommandParser
from gp_core.disk import protected_inputs
from gp_core.errors import GpError
from gp_core.standard_streams import shown_path, standard_streams

__all__ = ["add_import_options", "import_options", "make_mesh_parser", "run_mesh"]

_EXAMPLE = """examples:
  gp-labeler mesh head.nrrd -o head.ply
  gp-labeler mesh head.nrrd -o head.ply --method skimage
  gp-labeler mesh slices_tif/ -o head.stl --spacing 0.035 --reverse
  gp-labeler mesh - -o - < head.nrrd > head.ply
  gp-labeler mesh dicom/ -o head.vtp --series bone --accept gap --threshold 1200

If the scan lacks information, the error message names the option that supplies it.
"""


def make_mesh_parser() -> argparse.ArgumentParser:
    """Return the parser of ``gp-labeler mesh``."""
    parser = CommandParser(
        prog="gp-labeler mesh",
        description="Write the bone surface of a scan, LPS mm.",
        epilog=_EXAMPLE,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("volume", type=Path, metavar="VOLUME", help="file, or folder of slices")
    formats = ".ply, .stl, .vtp, .obj, .glb or .gltf; - writes PLY to standard output"
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="MESH", help=formats)
    _add_surface(parser.add_argument_group("surface"))
    add_import_options(parser.add_argument_group("reading the scan"))
    return parser


def _add_surface(group: argparse._ArgumentGroup) -> None:
    group.add_argument(
        "--threshold",
        type=float,
        metavar="T",
        help="bone threshold, grey value; default: proposed from the histogram",
    )
    group.add_argument(
        "--smallest", type=float, metavar="MM", help="remove parts smaller than this; default: 1"
    )
    group.add_argument(
        "--method",
        choices=("flying-edges", "marching-cubes", "skimage"),
        default="flying-edges",
        help="algorithm; all give the same surface, flying-edges (default) uses all cores",
    )
    group.add_argument("--largest", type=int, metavar="N", help="keep only the N largest parts")


def add_import_options(group: argparse._ArgumentGroup) -> None:
    """Add the options that say how a scan is read."""
    group.add_argument(
        "--spacing", type=float, nargs="+", metavar="MM", help="voxel size in mm: one number, or x y z"
    )
    group.add_argument(
        "--series", metavar="NAME", help="series or stack to read from a folder: its name, or part of it"
    )
    group.add_argument("--channel", type=int, metavar="N", help="colour channel, from 0; default: luminance")
    group.add_argument(
        "--reverse", action="store_true", help="reverse the order of the slices, which mirrors the head"
    )
    group.add_argument(
        "--accept",
        action="append",
        default=[],
        metavar="CODE",
        help="continue in spite of a problem, such as gap; may be repeated",
    )
    group.add_argument(
        "--stride", type=int, default=1, metavar="N", help="read every N-th voxel along each axis"
    )
    group.add_argument(
        "--region",
        type=int,
        nargs=6,
        metavar=("X0", "X1", "Y0", "Y1", "Z0", "Z1"),
        help="read only this range of voxels",
    )


def run_mesh(arguments: Sequence[str]) -> int:
    """Read, mesh, write, and say what was written.

    Raises
    ------
    GpError
        The scan cannot be read like this, has no surface at this threshold, or the file cannot be written.
    """
    args = make_mesh_parser().parse_args(arguments)
    options = import_options(args)
    surface_options = {
        name: value
        for name, value in (("smallest_mm", args.smallest), ("largest", args.largest))
        if value is not None
    }
    _check_surface(args)
    with standard_streams(args, {"output": ".ply"}, ("volume",)):
        return _mesh(args, options, surface_options)


def _mesh(args: argparse.Namespace, options: dict[str, Any], surface_options: dict[str, Any]) -> int:
    from gp_labeler.imaging.readers import read_volume  # here: `--help` need not wait for VTK
    from gp_labeler.imaging.surface import extract_isosurface
    from gp_labeler.imaging.surface_files import check_mesh_name
    from gp_labeler.imaging.threshold import propose_threshold

    check_mesh_name(args.output)
    slices = args.volume.iterdir() if args.volume.is_dir() else ()
    with protected_inputs([args.volume, *slices]):
        volume = read_volume(args.volume, **options)
        threshold = propose_threshold(volume) if args.threshold is None else args.threshold
        surface = extract_isosurface(volume, threshold, method=args.method, **surface_options)
        surface.save(args.output)
    for note in volume.notes:
        sys.stderr.write(f"gp-labeler: {volume.name}: {note}\n")
    sys.stdout.write(
        f"{shown_path(args.output)}: {surface.n_triangles} triangles, threshold {threshold:g}, {volume.name} "
        f"({' x '.join(f'{s:g}' for s in volume.spacing)} mm)\n"
    )
    return 0


def import_options(args: argparse.Namespace) -> dict[str, Any]:
    """Return what these options say, for `read_volume`."""
    options: dict[str, Any] = {"accept": args.accept, "reverse": args.reverse, "stride": args.stride}
    if args.spacing is not None:
        if len(args.spacing) not in (1, 3):
            raise GpError(f"--spacing must be one number or three, got {len(args.spacing)}")
        options["spacing"] = args.spacing[0] if len(args.spacing) == 1 else args.spacing
    if args.region is not None:
        options["region"] = [args.region[0:2], args.region[2:4], args.region[4:6]]
    for name in ("series", "channel"):
        if getattr(args, name) is not None:
            options[name] = getattr(args, name)
    return options


def _check_surface(args: argparse.Namespace) -> None:
    if args.smallest is not None and not args.smallest >= 0:
        raise GpError(f"--smallest must be a length in mm from 0, got {args.smallest:g}")
    if args.largest is not None and args.largest < 1:
        raise GpError(f"--largest must be a whole number from 1, got {args.largest}")
