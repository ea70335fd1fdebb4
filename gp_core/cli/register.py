"""``gp-core register``: touches registered to the labelled CT of the same head."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from typing import Any

from gp_core.cli.options import Subparsers, add_command, add_json, add_names, lab_names, save_json, say
from gp_core.disk import all_or_none, write_text
from gp_core.errors import blaming
from gp_core.io import read_landmarks, read_touches
from gp_core.io.tfm import tfm_text
from gp_core.landmarks.anatomy import with_cochlea_origin
from gp_core.landmarks.sets import LandmarkSet
from gp_core.registration.fiducials import points_by_name, register_fiducials
from gp_core.registration.result import RegistrationResult

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
        "register",
        run,
        summary="register touches to the labelled CT of the same head, by common names",
        example="gp-core register touches.dat skull_R.mrk.json --side R --tfm tracker_to_scan.tfm",
    )
    parser.add_argument(
        "touches", metavar="TOUCHES", help="touched features and skull features (S1, S2, ...)"
    )
    parser.add_argument("ct_landmarks", metavar="CT_LANDMARKS", help="the same ones in the CT")
    add_names(parser)
    parser.add_argument("--side", required=True, choices=("L", "R"), help="side of the head")
    add_json(parser)
    parser.add_argument(
        "--tfm", metavar="FILE", help="write tracker to scan as an ITK / Slicer transform here"
    )


def run(args: argparse.Namespace) -> int:
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
    with all_or_none():
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
