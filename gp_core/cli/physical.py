"""``gp-core physical``: a touched skull compared with its own CT."""

from __future__ import annotations

import argparse
from collections.abc import Iterator

from gp_core.cli.options import (
    Subparsers,
    add_atlas,
    add_command,
    add_json,
    add_names,
    lab_names,
    read_atlas,
    save_json,
    say,
)
from gp_core.cli.study_options import add_figure, add_seed, rng_of, save_figure_of
from gp_core.disk import all_or_none
from gp_core.io import read_landmarks, read_touches
from gp_core.io.stl import read_stl
from gp_core.study.physical import PhysicalReport, physical_simulations, physical_test

__all__ = ["add"]


def add(commands: Subparsers) -> None:
    """Add the command to the parser.

    Parameters
    ----------
    commands : Subparsers
        The subparsers of ``gp-core``, to which the commands are added.
    """
    parser = add_command(
        commands,
        "physical",
        run,
        summary="compare the estimate from touches of a skull with its CT",
        example="gp-core physical --touches skull.dat --ct-landmarks ct_R.mrk.json --side R --figure out.png",
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
    add_atlas(parser, more=", which also allow the method jrmpc", default=["published"])
    parser.add_argument(
        "--bone",
        metavar="FILE",
        help="bone of the CT (.stl, mm): touched points that the CT does not name are registered to it",
    )
    drawn = parser.add_argument_group("figure", "Figure 6 C and D of simulated sides, with the skull on it")
    add_figure(drawn)
    drawn.add_argument("--n", type=int, default=1000, help="animals to simulate per side; default: 1000")
    drawn.add_argument(
        "--noise", type=float, default=0.0, metavar="MM", help="SD of their touch errors; default: 0"
    )
    add_seed(drawn)
    add_names(parser)
    add_json(parser)


def run(args: argparse.Namespace) -> int:
    """Run ``gp-core physical``.

    Parameters
    ----------
    args : argparse.Namespace
        The parsed options.

    Returns
    -------
    int
        Exit status; see `gp_core.cli.entry.main`.
    """
    atlas, specimens = read_atlas(args.atlas)
    touches = read_touches(args.touches, args.side, unknown="extra", names=lab_names(args))
    rng = rng_of(args)
    report = physical_test(
        touches,
        read_landmarks(args.ct_landmarks, side=args.side, unknown="extra", names=lab_names(args)),
        atlas=atlas,
        specimens=specimens,
        bone=None if args.bone is None else read_stl(args.bone),
    )
    if args.figure is not None:
        simulated = physical_simulations(
            touches, specimens=specimens, atlas=atlas, n=args.n, noise=args.noise, rng=rng
        )
    with all_or_none():
        save_json(args.json, report.as_dict())
        if args.figure is not None:
            save_figure_of(args.figure, "draw_physical", report, simulated)
    for line in _lines(report):
        say(line)
    return 0


def _lines(report: PhysicalReport) -> Iterator[str]:
    yield f"Physical test, side {report.side}"
    yield ""
    yield "  registration  FRE mm  method   E_CO mm  E_MA deg"
    for registration in report.registrations:
        for row in (row for row in report.rows if row.registration == registration.method):
            yield (
                f"  {registration.method:<12}  {registration.fre_mm:6.3f}  {row.method:<7}  "
                f"{row.e_co_mm:7.3f}  {row.e_ma_deg:8.2f}"
            )
    for warning in report.warnings:
        yield f"  ! {warning}"
