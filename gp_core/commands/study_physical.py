"""``gp-core physical``: a touched skull against its own CT."""

from __future__ import annotations

import argparse
from collections.abc import Iterator

from gp_core.commands.options import Subparsers, add_command, add_json, read_atlas, save_json, say
from gp_core.landmarks.files import read_landmarks, read_touches
from gp_core.registration.stl import read_stl
from gp_core.study.physical import PhysicalReport, physical_test

__all__ = ["add"]


def add(commands: Subparsers) -> None:
    """Add the command."""
    parser = add_command(
        commands,
        "physical",
        run,
        summary="hold the estimate from touches of a skull against its CT",
        example="gp-core physical --touches skull.dat --ct-landmarks skull_R.mrk.json --side R",
    )
    parser.add_argument(
        "--touches",
        required=True,
        metavar="FILE",
        help="touched probe features and skull features (S1, S2, ...), tracker frame",
    )
    parser.add_argument(
        "--ct-landmarks",
        required=True,
        metavar="FILE",
        help="the same skull features in the CT, with CA, CB, RWA and RWP",
    )
    parser.add_argument("--side", required=True, choices=("L", "R"), help="side of the head")
    parser.add_argument(
        "--atlas",
        nargs="+",
        default=["published"],
        metavar="ATLAS",
        help="as for estimate; JRMPC takes part where labelled animals are given",
    )
    parser.add_argument(
        "--bone",
        metavar="FILE",
        help="bone of the CT (.stl, mm): touched points that the CT does not name are registered to it",
    )
    add_json(parser)


def run(args: argparse.Namespace) -> int:
    """Test, print, and write what was asked for."""
    atlas, specimens = read_atlas(args.atlas)
    report = physical_test(
        read_touches(args.touches, args.side, unknown="extra"),
        read_landmarks(args.ct_landmarks, side=args.side, unknown="extra"),
        atlas=atlas,
        specimens=specimens,
        bone=None if args.bone is None else read_stl(args.bone),
    )
    save_json(args.json, report.as_dict())
    for line in _lines(report):
        say(line)
    return 0


def _lines(report: PhysicalReport) -> Iterator[str]:
    yield f"Physical test, side {report.side}"
    yield ""
    yield "  registration  FRE mm  method   E_CO mm  E_MA deg"
    for registration in report.registrations:
        for row in (row for row in report.rows if row.registration == registration.way):
            yield (
                f"  {registration.way:<12}  {registration.fre_mm:6.3f}  {row.method:<7}  "
                f"{row.e_co_mm:7.3f}  {row.e_ma_deg:8.2f}"
            )
    for warning in report.warnings:
        yield f"  ! {warning}"
