"""``gp-core simulate``: animals drawn from the scatter of the labelled ones (Figure 6 C, D)."""

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
    add_seed,
    add_settings,
    add_workers,
    executor_of,
    features_of,
    rng_of,
    save_figure_of,
    settings_of,
)
from gp_core.disk import all_or_none, read_json
from gp_core.errors import FileFormatError
from gp_core.registration.jrmpc import ESTIMATION
from gp_core.study.simulation import SimulationReport, simulate

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
        "simulate",
        run,
        summary="draw animals from the scatter of the labelled ones and estimate them (Figure 6 C, D)",
        example="gp-core simulate labelled/ --figure figure6cd.png --physical skull1.json skull2.json",
    )
    add_specimens(parser)
    parser.add_argument("--n", type=int, default=1000, help="animals to draw per side; default: 1000")
    parser.add_argument(
        "--noise",
        type=float,
        default=0.0,
        metavar="MM",
        help="SD of the touch errors, mm per coordinate; default: 0",
    )
    add_method(parser)
    add_features(parser)
    add_settings(parser, "estimation")
    add_seed(parser)
    add_workers(parser, default=1)
    parser.add_argument(
        "--physical",
        nargs="+",
        default=[],
        metavar="FILE",
        help="results of physical --json, drawn as circles",
    )
    add_figure(parser)
    add_json(parser)


def run(args: argparse.Namespace) -> int:
    """Run ``gp-core simulate``.

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
    physical = [error for file in args.physical for error in _physical_errors(file, args.method)]
    with executor_of(args) as executor:
        report = simulate(
            labelled_specimens(args),
            n=args.n,
            rng=rng_of(args),
            method=args.method,
            training=training,
            probe=probe,
            settings=settings_of(args, ESTIMATION),
            noise=args.noise,
            executor=executor,
        )
    with all_or_none():
        save_json(args.json, {**report.as_dict(), "seed": args.seed})
        save_figure_of(args.figure, "error_boxes", report, physical)
    for line in _simulation_lines(report):
        say(line)
    return 0


def _physical_errors(file: str, method: str) -> list[tuple[float, float]]:
    """Return E_CO and E_MA under ICP, as in the paper, from a result of ``physical``."""
    remedy = "Make it with: gp-core physical ... --json"
    content = read_json(file, what="result of a physical test", remedy=remedy)
    try:
        rows = content["rows"]
        return [
            (float(row["e_co_mm"]), float(row["e_ma_deg"]))
            for row in rows
            if (row["registration"], row["method"]) == ("icp", method)
        ]
    except (ValueError, KeyError, TypeError, OverflowError):
        raise FileFormatError("is not the result of a physical test", file=file, remedy=remedy) from None


def _simulation_lines(report: SimulationReport) -> Iterator[str]:
    noise = f", noise {report.noise:g} mm" if report.noise else ""
    yield f"Simulated sides, method {report.method}{noise}, touched {' '.join(report.probe)}"
    yield ""
    yield "            E_CO mm                            E_MA deg"
    yield "  side      mean  median  whisker  beyond      mean  median  whisker  beyond   within limits"
    groups = report.as_dict()["groups"]
    for name, group in groups.items():
        co, ma = group["e_co_mm"], group["e_ma_deg"]
        yield (
            f"  {name:<6}  {co['mean']:6.3f}  {co['median']:6.3f}  {co['whisker']:7.3f}  {co['beyond']:6.1%}"
            f"    {ma['mean']:6.2f}  {ma['median']:6.2f}  {ma['whisker']:7.2f}  {ma['beyond']:6.1%}"
            f"   {group['within_limits']:6.1%}"
        )
    limits = groups["pooled"]["limits"]
    yield f"  limits: {limits['e_co_mm']} mm and {limits['e_ma_deg']} degrees, the paper's largest errors"
