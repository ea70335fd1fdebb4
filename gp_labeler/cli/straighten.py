"""The command ``gp-labeler straighten``: how a head lies in its scan."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from gp_core.command_line import CommandParser
from gp_core.disk import protected_inputs, write_text
from gp_core.errors import GpError
from gp_core.standard_streams import standard_streams
from gp_labeler.cli.mesh import add_import_options, import_options

if TYPE_CHECKING:
    from gp_labeler.head_pose import HeadPose
    from gp_labeler.imaging.volume import Volume

__all__ = ["make_straighten_parser", "run_straighten"]

_HEADER = {"schema": "gp-labeler head pose", "version": 1}
_EXAMPLE = """examples:
  gp-labeler straighten head.nrrd
  gp-labeler straighten head.nrrd --json pose.json
  gp-labeler straighten head.nrrd --landmarks GP-014_L.mrk.json GP-014_R.mrk.json
  gp-labeler straighten head.nrrd --midline 1 -40 2 --left 12 0 5 --right -11 1 5
  gp-labeler straighten two-heads.nrrd --near 21 -15 4
  gp-labeler straighten mouse.nrrd --like mouse-1.gpspecimen.json

The scan is not changed. Left and right are those of the file; a scan cannot prove them.
"""


def make_straighten_parser() -> argparse.ArgumentParser:
    """Return the parser of ``gp-labeler straighten``."""
    parser = CommandParser(
        prog="gp-labeler straighten",
        description="Find how a head lies in its scan: the mid-sagittal plane, front and up.",
        epilog=_EXAMPLE,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("volume", type=Path, metavar="VOLUME", help="file, or folder of slices")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the whole result")
    parser.add_argument("--threshold", type=float, metavar="T", help="bone threshold, grey value")
    parser.add_argument(
        "--box", type=float, nargs=6, metavar="MM", help="search only this box: x y z of two corners, LPS"
    )
    parser.add_argument(
        "--near",
        type=float,
        nargs=3,
        metavar=("X", "Y", "Z"),
        help="in a scan of several heads, a point in the one that is meant, LPS mm",
    )
    parser.add_argument(
        "--like",
        type=Path,
        metavar="SPECIMEN",
        help="specimen file of a straightened head of the same species: it gives front, up and pitch",
    )
    points = parser.add_argument_group("from points, if the symmetry of the bone is not sufficient")
    points.add_argument(
        "--landmarks",
        type=Path,
        nargs="+",
        metavar="FILE",
        help="placed landmarks of both sides: IN and a pair such as OI",
    )
    for name in ("midline", "left", "right"):
        points.add_argument(f"--{name}", type=float, nargs=3, metavar=("X", "Y", "Z"), help="LPS mm")
    add_import_options(parser.add_argument_group("reading the scan"))
    return parser


def run_straighten(arguments: Sequence[str]) -> int:
    """Find the pose, and say it.

    Raises
    ------
    GpError
        The scan or the landmarks cannot be read, or no pose was found that can be trusted.
    """
    args = make_straighten_parser().parse_args(arguments)
    _check_points(args)
    with standard_streams(args, {"json": ".json"}, ("volume", "landmarks")):
        return _straighten(args)


def _straighten(args: argparse.Namespace) -> int:
    from gp_labeler.imaging.readers import read_volume  # here: `--help` need not wait for it

    slices = args.volume.iterdir() if args.volume.is_dir() else ()
    like = () if args.like is None else (args.like,)
    with protected_inputs([args.volume, *slices, *like, *(args.landmarks or ())]):
        volume = read_volume(args.volume, **import_options(args))
        pose = _pose(volume, args)
        if args.json is not None:
            content = {
                "schema": "gp-labeler head pose",
                "version": 1,
                "volume": volume.name,
                **pose.as_json(),
            }
            write_text(args.json, json.dumps(content, indent=1) + "\n")
    for note in volume.notes:
        sys.stderr.write(f"gp-labeler: {volume.name}: {note}\n")
    for warning in pose.warnings:
        sys.stderr.write(f"gp-labeler: {volume.name}: {warning}\n")
    sys.stdout.write("".join(line + "\n" for line in _lines(volume, pose)))
    return 0


def _check_points(args: argparse.Namespace) -> None:
    given = [name for name in ("midline", "left", "right") if getattr(args, name) is not None]
    if 0 < len(given) < 3:
        raise GpError(f"--midline, --left and --right belong together, got --{' and --'.join(given)} alone")
    if given and args.landmarks:
        raise GpError("give --landmarks, or --midline, --left and --right, not both")
    for name in ("box", "near", "like"):
        if getattr(args, name) is not None and (given or args.landmarks):
            raise GpError(f"--{name} is for straightening without points")
    if args.threshold is not None and not np.isfinite(args.threshold):
        raise GpError(f"--threshold must be a number, got {args.threshold}")


def _pose(volume: Volume, args: argparse.Namespace) -> HeadPose:
    from gp_core import load_specimens
    from gp_labeler.document.head_template import read_head_template
    from gp_labeler.head_pose import straighten, straighten_by_landmarks, straighten_by_points

    if args.midline is not None:
        return straighten_by_points(
            volume, midline=args.midline, left=args.left, right=args.right, threshold=args.threshold
        )
    if not args.landmarks:
        box = None if args.box is None else np.sort(np.reshape(args.box, (2, 3)), axis=0)
        template = None if args.like is None else read_head_template(args.like)
        return straighten(volume, threshold=args.threshold, box=box, near=args.near, template=template)
    specimens = load_specimens(args.landmarks)
    if len(specimens) != 1:
        raise GpError(f"--landmarks must be of one animal, got {', '.join(s.name for s in specimens)}")
    return straighten_by_landmarks(volume, specimens[0].sides, threshold=args.threshold)


def _lines(volume: Volume, pose: HeadPose) -> list[str]:
    """Return the pose in words."""
    plane, axes = pose.mid_plane, pose.T_head_scan.rotation
    lines = [
        f"{volume.name}: the head is turned by {pose.tilt_deg:.1f} degrees in its scan",
        f"mid-sagittal plane: normal {_numbers(plane.normal, 4)} (left), offset {plane.offset:.2f} mm",
        f"front: {_numbers(-axes[1], 4)}; up: {_numbers(axes[2], 4)}",
    ]
    if pose.confidence is not None:
        c = pose.confidence
        lines.append(
            f"found by {pose.found_by}: {100 * c.agreement:.0f} % of the bone meets its mirror image, "
            f"{100 * c.overlap:.0f} % of which lies in the scan"
        )
    return [*lines, f"pitch: {pose.pitch}", f"left: {pose.left}"]


def _numbers(values: np.ndarray, digits: int) -> str:
    return " ".join(f"{v + 0.0:.{digits}f}" for v in values)
