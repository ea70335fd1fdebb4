"""``gp-core compare``: JRMPC compared with the robust method."""

from __future__ import annotations

import argparse
from collections.abc import Iterator

from gp_core.cli.options import (
    Subparsers,
    add_command,
    add_json,
    add_names,
    labelled_specimens,
    save_json,
    say,
)
from gp_core.cli.study_options import (
    add_figure,
    add_seed,
    add_settings,
    add_workers,
    executor_of,
    rng_of,
    save_figure_of,
    settings_of,
)
from gp_core.disk import all_or_none
from gp_core.registration.jrmpc import ESTIMATION
from gp_core.study.compare import ComparisonReport, compare

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
        "compare",
        run,
        summary="compare JRMPC and the robust method for increasing touch errors",
        example="gp-core compare --figure compare.png --csv compare.csv",
    )
    add_names(parser)
    parser.add_argument(
        "specimens",
        nargs="*",
        metavar="SPECIMENS",
        help="landmark files of labelled animals, or folders; default: drawn from the published atlas",
    )
    parser.add_argument(
        "--repeats", type=int, default=20, metavar="N", help="how often each side is touched; default: 20"
    )
    parser.add_argument(
        "--animals", type=int, default=11, metavar="N", help="animals to draw for each repeat; default: 11"
    )
    add_settings(parser, "estimation")
    add_seed(parser)
    add_workers(parser)
    parser.add_argument("--csv", metavar="FILE", help="write the table here")
    add_figure(parser)
    add_json(parser)


def run(args: argparse.Namespace) -> int:
    """Run ``gp-core compare``.

    Parameters
    ----------
    args : argparse.Namespace
        The parsed options.

    Returns
    -------
    int
        Exit status; see `gp_core.cli.entry.main`.
    """
    specimens = labelled_specimens(args) if args.specimens else None
    with executor_of(args) as executor:
        report = compare(
            specimens,
            repeats=args.repeats,
            n_animals=args.animals,
            rng=rng_of(args),
            settings=settings_of(args, ESTIMATION),
            executor=executor,
        )
    with all_or_none():
        save_json(args.json, {**report.as_dict(), "seed": args.seed})
        if args.csv:
            report.save_csv(args.csv)
        save_figure_of(args.figure, "comparison", report)
    for line in _comparison_lines(report):
        say(line)
    return 0


def _comparison_lines(report: ComparisonReport) -> Iterator[str]:
    yield f"{report.animals}: mean / p95 / max"
    yield ""
    yield (
        f"  {'touched':<15} {'errors, mm':<17} {'E_CO mm   JRMPC':>21} {'robust':>21}"
        f"   {'E_MA deg  JRMPC':>21} {'robust':>21}"
    )
    by_key = {(row.probe, row.condition, row.method): row.as_dict() for row in report.rows}
    for probe, condition in dict.fromkeys((row.probe, row.condition) for row in report.rows):
        jrmpc, robust = (by_key[probe, condition, method] for method in ("jrmpc", "robust"))
        cells = [_cell(row[error]) for error in ("e_co_mm", "e_ma_deg") for row in (jrmpc, robust)]
        yield f"  {probe:<15} {condition.label:<17} {cells[0]} {cells[1]}   {cells[2]} {cells[3]}"


def _cell(summary: dict[str, float]) -> str:
    decimals = 2 if summary["max"] < 30 else 1
    return f"{' / '.join(f'{summary[name]:.{decimals}f}' for name in ('mean', 'p95', 'max')):>21}"
