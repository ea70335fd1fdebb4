"""``gp-core leave-one-out``: every cochlea estimated from the other animals (Figure 6 A, B)."""

from __future__ import annotations

import argparse
from collections.abc import Iterator

from gp_core.cli.options import (
    Subparsers,
    add_command,
    add_json,
    add_specimens,
    labelled_specimens,
    save_json,
    say,
)
from gp_core.cli.study_options import (
    add_features,
    add_figure,
    add_method,
    add_settings,
    features_of,
    save_figure_of,
    settings_of,
)
from gp_core.disk import all_or_none
from gp_core.registration.jrmpc import ESTIMATION
from gp_core.study.leave_one_out import LeaveOneOutReport, leave_one_out, summarise

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
        "leave-one-out",
        run,
        summary="estimate every labelled cochlea from the other animals (Figure 6 A, B)",
        example="gp-core leave-one-out labelled/ --method jrmpc --figure figure6ab.png",
    )
    add_specimens(parser)
    add_method(parser)
    add_features(parser)
    add_settings(parser, "estimation")
    add_figure(parser)
    add_json(parser)


def run(args: argparse.Namespace) -> int:
    """Run ``gp-core leave-one-out``.

    Parameters
    ----------
    args : argparse.Namespace
        The parsed options.

    Returns
    -------
    int
        Exit status; see `gp_core.cli.entry.main`.
    """
    training, probe = features_of(args)
    report = leave_one_out(
        labelled_specimens(args),
        method=args.method,
        training=training,
        probe=probe,
        settings=settings_of(args, ESTIMATION),
    )
    with all_or_none():
        save_json(args.json, report.as_dict())
        save_figure_of(args.figure, "error_histograms", report)
    for line in _leave_one_out_lines(report):
        say(line)
    return 0


def _leave_one_out_lines(report: LeaveOneOutReport) -> Iterator[str]:
    yield f"Leave-one-out of {len(report.rows)} sides, method {report.method}"
    yield f"touched: {' '.join(report.probe)}"
    yield ""
    width = max(8, *(len(row.specimen) for row in report.rows))
    yield f"  {'specimen':<{width}}  side   E_CO mm   E_MA deg"
    for row in report.rows:
        yield f"  {row.specimen:<{width}}  {row.side:<4}  {row.e_co_mm:8.3f}  {row.e_ma_deg:9.2f}"
    yield ""
    summary = summarise(report.errors)
    for name in ("mean", "median", "max"):
        e_co, e_ma = summary["e_co_mm"][name], summary["e_ma_deg"][name]
        yield f"  {name:<{width}}        {e_co:8.3f}  {e_ma:9.2f}"
    yield f"  E_T {summary['e_t']:.2f}"
