"""``gp-core conditions``: coverage of the 95 % regions under everything that may go wrong in a session."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from typing import Any

from gp_core.cli.options import (
    Subparsers,
    add_command,
    add_json,
    add_names,
    labelled_specimens,
    save_json,
    say,
)
from gp_core.cli.study_options import add_seed, add_workers, executor_of, rng_of
from gp_core.study.conditions import GROUPS, ConditionsReport, conditions, touch_conditions

__all__ = ["add", "condition_lines"]

_HEADINGS = (
    "condition",
    "touches",
    "told, mm",
    "error, mm",
    "error, deg",
    "radius holds (over animals)",
    "cone holds (over animals)",
    "region",
    "plain region",
    "grown by",
    "side undecided / wrong",
    "names undecided / wrong",
)


def add(commands: Subparsers) -> None:
    """Add the command to the parser.

    Parameters
    ----------
    commands : Subparsers
        The subparsers of ``gp-core``, to which the commands are added.
    """
    parser = add_command(
        commands,
        "conditions",
        run,
        summary="measure the coverage of the 95 % regions, and how often wrong sides and names are detected",
        example="gp-core conditions --groups shared size --repeats 20 --json conditions.json",
    )
    add_names(parser)
    parser.add_argument(
        "specimens",
        nargs="*",
        metavar="SPECIMENS",
        help="landmark files of labelled animals, or folders; default: drawn from perturbed atlases",
    )
    parser.add_argument(
        "--groups",
        nargs="+",
        choices=GROUPS,
        default=list(GROUPS),
        metavar="GROUP",
        help=f"which conditions, of {', '.join(GROUPS)}; default: all",
    )
    parser.add_argument(
        "--repeats", type=int, default=10, metavar="N", help="how often each side is touched; default: 10"
    )
    parser.add_argument(
        "--animals", type=int, default=11, metavar="N", help="animals to draw for each repeat; default: 11"
    )
    add_seed(parser)
    add_workers(parser)
    add_json(parser)


def run(args: argparse.Namespace) -> int:
    """Run ``gp-core conditions``.

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
        report = conditions(
            specimens,
            repeats=args.repeats,
            n_animals=args.animals,
            rng=rng_of(args),
            cases=touch_conditions(args.groups),
            executor=executor,
        )
    save_json(args.json, {**report.as_dict(), "seed": args.seed})
    for line in condition_lines(report):
        say(line)
    return 0


def condition_lines(report: ConditionsReport) -> Iterator[str]:
    """Yield a Markdown table; of the exchanged names, only the pairs with the lowest coverage.

    Parameters
    ----------
    report : ConditionsReport
        What to print.

    Yields
    ------
    str
        A line of text.
    """
    rows = [row.as_dict() for row in report.rows]
    yield report.animals
    yield ""
    table = [_HEADINGS, *(_cells(row) for row in rows if row["group"] != "names"), *_worst_pairs(rows)]
    widths = [max(len(cells[i]) for cells in table) for i in range(len(_HEADINGS))]
    for i, cells in enumerate(table):
        yield f"| {' | '.join(cell.ljust(width) for cell, width in zip(cells, widths, strict=True))} |"
        if i == 0:
            yield f"|{'|'.join('-' * (width + 2) for width in widths)}|"


def _worst_pairs(rows: Sequence[dict[str, Any]]) -> Iterator[tuple[str, ...]]:
    exchanges = [row for row in rows if row["group"] == "names"]
    for noise in dict.fromkeys(row["noise_mm"] for row in exchanges):
        of_noise = [row for row in exchanges if row["noise_mm"] == noise]
        worst = min(of_noise, key=lambda row: min(row["radius_mm_holds"], row["cone_deg_holds"]))
        cells = _cells(worst)
        yield (f"{cells[0]} (worst of {len(of_noise)} pairs)", *cells[1:])


def _cells(row: dict[str, Any]) -> tuple[str, ...]:
    return (
        row["condition"],
        str(row["n_touches"]),
        f"{row['shared_error_mm']:g}",
        f"{row['e_co_mm']:.2f}",
        f"{row['e_ma_deg']:.1f}",
        _share(row, "radius_mm"),
        _share(row, "cone_deg"),
        f"{row['radius_mm']:.2f} mm, {row['cone_deg']:.1f} deg",
        f"{row['radius_mm_plain']:.2f} mm, {row['cone_deg_plain']:.1f} deg",
        f"{row['radius_mm_growth']:.2f}, {row['cone_deg_growth']:.2f}",
        f"{row['side_undecided']:.1%} / {row['side_wrong']:.1%}",
        f"{row['names_undecided']:.1%} / {row['names_wrong']:.1%}",
    )


def _share(row: dict[str, Any], region: str) -> str:
    low, high = row[f"{region}_holds_interval"]
    return f"{row[f'{region}_holds']:.1%} ({low:.0%} to {high:.0%})"
