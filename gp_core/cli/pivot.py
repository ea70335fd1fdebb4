"""``gp-core pivot``: calibration of the tip of a probe."""

from __future__ import annotations

import argparse
from collections.abc import Iterator

from gp_core.cli.options import Subparsers, add_command, add_json, save_json, say
from gp_core.cli.touches import RECORDING_HELP, add_transforms
from gp_core.errors import blaming
from gp_core.io.tracker_recordings import read_recording
from gp_core.registration.pivot import PivotCalibration, calibrate_pivot
from gp_core.standard_streams import shown_name

__all__ = ["add"]


def add(commands: Subparsers) -> None:
    """Add the command to the parser.

    Parameters
    ----------
    commands : Subparsers
        The subparsers of ``gp-core``, to which the command is added.
    """
    parser = add_command(
        commands,
        "pivot",
        run,
        summary="calibrate the tip of a probe, from poses of its marker while it pivots about its tip",
        example="gp-core pivot poses.csv --json tip.json",
    )
    parser.add_argument(
        "poses",
        metavar="FILE",
        help=RECORDING_HELP,
    )
    add_transforms(parser)
    add_json(parser)


def run(args: argparse.Namespace) -> int:
    """Run ``gp-core pivot``.

    Parameters
    ----------
    args : argparse.Namespace
        The parsed options.

    Returns
    -------
    int
        Exit status; see `gp_core.cli.entry.main`.
    """
    recording = read_recording(args.poses, transform=args.transform, reference=args.reference)
    with blaming(args.poses):
        found = calibrate_pivot(recording.poses)
    save_json(args.json, found.as_dict())
    for line in _pivot_lines(found, shown_name(args.poses)):
        say(line)
    return 0


def _pivot_lines(found: PivotCalibration, source: str) -> Iterator[str]:
    used = found.n_frames - len(found.left_out) - len(found.unseen)
    yield f"Tip of the probe from {source}, {used} of {found.n_frames} frames"
    yield ""
    x, y, z = found.tip_offset
    error = found.standard_error_mm
    yield f"  tip in the marker's frame  {x:10.3f} {y:10.3f} {z:10.3f} mm   +- {error:.3f} mm"
    x, y, z = found.pivot
    yield f"  where it rested            {x:10.3f} {y:10.3f} {z:10.3f} mm   rms {found.rms_mm:.3f} mm"
    yield f"  rotation of the marker {found.spread_deg:.1f} degrees rms about the axis that moved least"
    if found.unseen:
        yield f"  the marker was not seen in {len(found.unseen)} frames"
    for warning in found.warnings:
        yield f"  ! {warning}"
