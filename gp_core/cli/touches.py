"""``gp-core touches``: touches extracted from a recorded probe."""

from __future__ import annotations

import argparse

import numpy as np

from gp_core.cli.options import Subparsers, add_command, check_ending, say
from gp_core.disk import read_json, write_text
from gp_core.errors import FeatureError, FileFormatError, GpError, blaming
from gp_core.io.text import as_csv_cell
from gp_core.io.tracker_recordings import read_recording
from gp_core.landmarks.features import CODES, EXTERNAL, PROBE
from gp_core.landmarks.labels import is_skull_feature, tidy_label
from gp_core.pose.recorded_touches import recorded_touches
from gp_core.standard_streams import shown_name
from gp_core.validation import FloatArray

__all__ = ["RECORDING_HELP", "add", "add_transforms"]

RECORDING_HELP = (
    "marker to tracker, mm: a sequence of PLUS or 3D Slicer (.igs.mha, .mha, .nrrd), or a table with a 4x4 "
    "matrix or a quaternion in each row"
)
"""What the commands say of the recordings that they read."""


def add(commands: Subparsers) -> None:
    """Add the command to the parser.

    Parameters
    ----------
    commands : Subparsers
        The subparsers of ``gp-core``, to which the commands are added.
    """
    parser = add_command(
        commands,
        "touches",
        run,
        summary="extract touches from a recorded probe: the places where its tip rested, in a given order",
        example="gp-core touches stylus.igs.mha --tip tip.json --order CL,MN,OS,RWA,RWP,LLI -o touches.csv",
    )
    parser.add_argument("recording", metavar="RECORDING", help=RECORDING_HELP)
    parser.add_argument(
        "--tip",
        default="0,0,0",
        metavar="TIP",
        help="the tip in the marker's frame, x,y,z in mm, or the JSON that pivot wrote; default: the poses "
        "are of the tip itself",
    )
    parser.add_argument(
        "--order",
        default=",".join(PROBE),
        metavar="NAMES",
        help="what was touched, in this order; a name may be there several times (default: %(default)s)",
    )
    add_transforms(parser)
    parser.add_argument(
        "-o", "--output", required=True, metavar="FILE", help="write the touches here, as CSV"
    )


def add_transforms(parser: argparse.ArgumentParser) -> None:
    """Add the options that select transforms of a sequence.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        The parser of one command.
    """
    parser.add_argument(
        "--transform", metavar="NAME", help="the probe's transform in a sequence, such as StylusToTracker"
    )
    parser.add_argument(
        "--reference", metavar="NAME", help="the reference's, such as ReferenceToTracker: work in its frame"
    )


def run(args: argparse.Namespace) -> int:
    """Run ``gp-core touches``.

    Parameters
    ----------
    args : argparse.Namespace
        The parsed options.

    Returns
    -------
    int
        Exit status; see `gp_core.cli.entry.main`.
    """
    check_ending(args.output, (".csv",), "--output")
    recording = read_recording(args.recording, transform=args.transform, reference=args.reference)
    names = [_touched_name(name) for name in args.order.split(",") if name.strip()]
    with blaming(args.recording):
        touches = recorded_touches(recording, _tip(args.tip), names)
    rows = [(name, place) for name, places in touches.items() for place in np.atleast_2d(places)]
    lines = [",".join((as_csv_cell(name), *map(repr, place.tolist()))) for name, place in rows]
    write_text(args.output, "\n".join(("name,x,y,z", *lines)) + "\n")
    say(f"{len(rows)} touches from {shown_name(args.recording)}, mm")
    for name, place in rows:
        say(f"  {name:<5} " + " ".join(f"{value:10.3f}" for value in place))
    return 0


def _touched_name(word: str) -> str:
    """Return the name of something that a probe can touch."""
    name = tidy_label(word)
    if name in EXTERNAL or is_skull_feature(name):
        return name
    problem = "is inside the bone and cannot be touched" if name in CODES else "is no feature"
    remedy = f"Name any of {' '.join(EXTERNAL)}, or skull features S1, S2, ..."
    raise FeatureError(problem, landmark=name[:40], remedy=remedy)


def _tip(word: str) -> FloatArray:
    """Return the tip offset from three numbers, or from a file that pivot wrote."""
    remedy = "Give x,y,z in mm, or the JSON file of gp-core pivot."
    if not word.lower().endswith(".json"):
        try:
            return np.array([float(number) for number in word.split(",")])
        except ValueError:
            raise GpError(f"--tip must be three numbers, got {word!r}", remedy=remedy) from None
    content = read_json(word, what="pivot calibration", remedy=remedy)
    try:
        return np.array(content["tip_offset_mm"], dtype=np.float64)
    except (KeyError, TypeError, ValueError, OverflowError):
        raise FileFormatError("holds no tip_offset_mm", file=word, remedy=remedy) from None
