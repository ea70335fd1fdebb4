"""``gp-core distances``: distances between all features (Figure 2)."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence

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
    add_figure,
    save_figure_of,
)
from gp_core.disk import all_or_none
from gp_core.study.distance_check import DISAGREES_SD, DistanceCheck, check_distances
from gp_core.study.distances import DistanceTable, distances

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
        "distances",
        run,
        summary="measure mean and SD of the distances of all pairs of features (Figure 2)",
        example="gp-core distances labelled/ --csv distances.csv --figure figure2.png",
    )
    add_specimens(parser)
    parser.add_argument(
        "--check",
        action="store_true",
        help="list the distances of each side that disagree with the published ones",
    )
    parser.add_argument("--csv", metavar="FILE", help="write the table here")
    add_figure(parser)
    add_json(parser)


def run(args: argparse.Namespace) -> int:
    """Run ``gp-core distances``.

    Parameters
    ----------
    args : argparse.Namespace
        The parsed options.

    Returns
    -------
    int
        Exit status; see `gp_core.cli.entry.main`.
    """
    specimens = labelled_specimens(args)
    table = distances(specimens)
    checks = [(each.name, check_distances(side)) for each in specimens for side in each.sides.values()]
    content = table.as_dict()
    if args.check:
        content["sides"] = [{"specimen": name} | check.as_dict() for name, check in checks]
    with all_or_none():
        save_json(args.json, content)
        if args.csv:
            table.save_csv(args.csv)
        save_figure_of(args.figure, "distance_matrix", table)
    for line in _distance_lines(table):
        say(line)
    for line in _check_lines(checks) if args.check else ():
        say(line)
    return 0


def _distance_lines(table: DistanceTable) -> Iterator[str]:
    yield f"Distances between features on {table.n_sides} sides"
    yield "  feature   median SD of its distances to the others, mm"
    for code, spread in table.typical_sd().items():
        yield f"  {code:<9} {spread:5.2f}"


def _check_lines(checks: Sequence[tuple[str, DistanceCheck]]) -> Iterator[str]:
    yield f"Distances that differ by more than {DISAGREES_SD:g} SD from the published ones"
    for name, check in checks:
        lines = [pair.text for pair in check.disagreeing] or ["none"]
        yield f"  {name} {check.side.value}"
        yield from (f"    {line}" for line in lines)
