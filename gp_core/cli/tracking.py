"""Commands for a tracker: ``register`` it to a scan, and ``pivot`` to calibrate its probe."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from gp_core.cli.options import Subparsers, add_command, add_json, add_names, lab_names, save_json, say
from gp_core.cli.touches import add_transforms
from gp_core.disk import write_text
from gp_core.errors import blaming
from gp_core.io import read_landmarks, read_touches
from gp_core.io.tfm import tfm_text
from gp_core.io.tracker_recordings import read_recording
from gp_core.landmarks.anatomy import with_cochlea_origin
from gp_core.landmarks.sets import LandmarkSet
from gp_core.registration.fiducials import points_by_name, register_fiducials
from gp_core.registration.pivot import PivotCalibration, calibrate_pivot
from gp_core.registration.result import RegistrationResult

__all__ = ["add"]


def add(commands: Subparsers) -> None:
    """Add the commands to the parser.

    Parameters
    ----------
    commands : Subparsers
        The subparsers of ``gp-core``, to which the commands are added.
    """
    register = add_command(
        commands,
        "register",
        run_register,
        summary="register touches to the labelled CT of the same head, by common names",
        example="gp-core register touches.dat skull_R.mrk.json --side R --tfm tracker_to_scan.tfm",
    )
    register.add_argument(
        "touches", metavar="TOUCHES", help="touched features and skull features (S1, S2, ...)"
    )
    register.add_argument("ct_landmarks", metavar="CT_LANDMARKS", help="the same ones in the CT")
    add_names(register)
    register.add_argument("--side", required=True, choices=("L", "R"), help="side of the head")
    add_json(register)
    register.add_argument(
        "--tfm", metavar="FILE", help="write tracker to scan as an ITK / Slicer transform here"
    )
    pivot = add_command(
        commands,
        "pivot",
        run_pivot,
        summary="calibrate the tip of a probe, from poses of its marker while it pivots about its tip",
        example="gp-core pivot poses.csv --json tip.json",
    )
    pivot.add_argument(
        "poses",
        metavar="FILE",
        help="marker to tracker, mm: a sequence of PLUS or 3D Slicer (.igs.mha, .mha, .nrrd), or a table "
        "with a 4x4 matrix or a quaternion in each row",
    )
    add_transforms(pivot)
    add_json(pivot)


def run_register(args: argparse.Namespace) -> int:
    """Run ``gp-core register``.

    Parameters
    ----------
    args : argparse.Namespace
        The parsed options.

    Returns
    -------
    int
        Exit status; see `gp_core.cli.entry.main`.
    """
    touches = read_touches(args.touches, args.side, unknown="extra", names=lab_names(args))
    ct = with_cochlea_origin(
        read_landmarks(args.ct_landmarks, side=args.side, unknown="extra", names=lab_names(args))
    )
    with blaming(f"{args.touches} and {args.ct_landmarks}"):
        found = register_fiducials(
            points_by_name(touches), points_by_name(ct), dst=ct.frame, src=touches.frame
        )
    content = found.as_dict() | _at_cochlea(found, ct)
    save_json(args.json, content)
    if args.tfm:
        write_text(args.tfm, tfm_text(found.T_scan_tracker))
    for line in _register_lines(found, content):
        say(line)
    return 0


def _at_cochlea(found: RegistrationResult, ct: LandmarkSet) -> dict[str, Any]:
    """Return the expected errors at the labelled cochlea; None where it is not labelled."""
    target = ct["CO"][None]
    expected, bound = (
        (float(tre(target)[0]) if "CO" in ct else None) for tre in (found.tre_mm, found.tre_95_mm)
    )
    return {"tre_at_cochlea_mm": expected, "tre_95_at_cochlea_mm": bound}


def _register_lines(found: RegistrationResult, content: dict[str, Any]) -> Iterator[str]:
    transform = found.T_scan_tracker
    yield f"{transform.src.capitalize()} to {transform.dst} by {len(found.fiducials)} points"
    yield ""
    for row in transform.matrix:
        yield "  " + " ".join(f"{value:11.5f}" for value in row)
    yield ""
    yield f"  registration error of the points (FRE)  {found.fre_mm:6.3f} mm"
    if content["tre_at_cochlea_mm"] is None:
        yield "  the CT has no CA, CB, RWA and RWP: no error at the cochlea"
    else:
        yield (
            f"  expected error at the cochlea (TRE)     {content['tre_at_cochlea_mm']:6.3f} mm"
            f"   below {content['tre_95_at_cochlea_mm']:.3f} mm with 95 %"
        )
    yield ""
    yield "  point    off, mm"
    for name, distance in found.residuals_mm.items():
        yield f"  {name:<7} {distance:8.3f}{'   left out' if name in found.suspects else ''}"
    for warning in found.warnings:
        yield f"  ! {warning}"


def run_pivot(args: argparse.Namespace) -> int:
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
    for line in _pivot_lines(found, Path(args.poses).name):
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
