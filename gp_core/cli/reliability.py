"""The command ``reliability``: how repeatable labels are."""

from __future__ import annotations

import argparse
from collections.abc import Iterator

from gp_core.cli.options import Subparsers, add_command, add_json, add_names, lab_names, save_json, say
from gp_core.cli.study_options import add_figure, add_seed, rng_of, save_figure_of
from gp_core.disk import all_or_none
from gp_core.io import load_labellings
from gp_core.study.agreement import ErrorSummary, IntraclassCorrelation
from gp_core.study.reliability import FeatureReliability, ReliabilityReport, reliability

__all__ = ["add"]

_MOST_OFFSETS = 5
_MOST_DISAGREEMENTS = 8


def add(commands: Subparsers) -> None:
    """Add the command to the parser.

    Parameters
    ----------
    commands : Subparsers
        The subparsers of ``gp-core``, to which the command is added.
    """
    parser = add_command(
        commands,
        "reliability",
        run,
        summary="measure how repeatable labels are, within and between observers",
        example="gp-core reliability labelled/ --csv reliability.csv --figure agreement.png",
    )
    parser.add_argument(
        "specimens",
        nargs="+",
        metavar="SPECIMENS",
        help="landmark files of animals that were labelled several times, or folders of them; observer and "
        "round are in the files, or in their names (GP01_AB_r2_L)",
    )
    add_names(parser)
    parser.add_argument("--csv", metavar="FILE", help="write the table here")
    add_seed(parser)
    add_figure(parser)
    add_json(parser)


def run(args: argparse.Namespace) -> int:
    """Run ``gp-core reliability``.

    Parameters
    ----------
    args : argparse.Namespace
        The parsed options.

    Returns
    -------
    int
        Exit status; see `gp_core.cli.entry.main`.
    """
    rng = rng_of(args)
    report = reliability(load_labellings(args.specimens, names=lab_names(args)), rng=rng)
    with all_or_none():
        save_json(args.json, report.as_dict())
        if args.csv:
            report.save_csv(args.csv)
        save_figure_of(args.figure, "label_agreement", report)
    for line in _lines(report):
        say(line)
    return 0


def _lines(report: ReliabilityReport) -> Iterator[str]:
    who = ", ".join(name or "unnamed" for name in report.observers)
    n_animals, n_sides = report.n_animals, report.n_sides
    yield f"Labels of {n_animals} animals, {n_sides} sides, {report.n_labellings} labellings by {who}"
    yield ""
    yield "             one observer again, mm        two observers, mm"
    yield "  feature    mean  Dahlberg   TEM          mean  Dahlberg   TEM   ICC(2,1)            ICC(3,1)"
    for row in report.rows:
        yield _row(row)
    yield ""
    for name, pose in (("one observer again", report.pose_intra), ("two observers", report.pose_inter)):
        if pose is not None:
            origin, axis = pose.origin_mm, pose.axis_deg
            yield (
                f"  {name}: CO differs by {origin['mean']:.2f} mm (at most {origin['max']:.2f}), "
                f"the axis by {axis['mean']:.1f} deg (at most {axis['max']:.1f})"
            )
    yield from _offset_lines(report)
    yield from _anova_lines(report)
    yield from _disagreement_lines(report)


def _row(row: FeatureReliability) -> str:
    icc2, icc3 = _icc(row.icc_inter, "icc2"), _icc(row.icc_inter, "icc3")
    unseen = f"  not seen by all on {row.n_unseen} sides" if row.n_unseen else ""
    return f"  {row.code:<9}{_errors(row.intra)}     {_errors(row.inter)}  {icc2}  {icc3}{unseen}".rstrip()


def _errors(found: ErrorSummary | None) -> str:
    if found is None:
        return f"{'-':>6}    {'-':>6}   {'-':>6}"
    return f"{found.mean_mm:6.2f}    {found.dahlberg_mm:6.2f}   {found.tem_mm:6.2f}"


def _icc(found: IntraclassCorrelation | None, name: str) -> str:
    if found is None:
        return f"{'':18}"
    value, (low, high) = getattr(found, name), getattr(found, f"{name}_95")
    return f"{value:.2f} ({low:5.2f} to {high:4.2f})"


def _offset_lines(report: ReliabilityReport) -> Iterator[str]:
    if not report.offsets:
        return
    yield ""
    certain = [row for row in report.offsets if row.p_corrected < 0.05]
    n = report.offsets[0].n_animals
    if not certain:
        least = min(2.0 ** (1 - n), 1.0)
        few = f" ({n} animals cannot show one below p = {least:.2g})" if least > 0.05 else ""
        yield f"No systematic offset between observers is significant{few}. The largest:"
    else:
        yield "Systematic offsets between observers (p, corrected for the number of features, below 0.05):"
    shown = certain or sorted(report.offsets, key=lambda row: -row.length_mm)
    for row in shown[:_MOST_OFFSETS]:
        one, other = (name or "unnamed" for name in row.observers)
        x, y, z = row.offset_mm
        yield (
            f"  {row.code:<4} {other} is {row.length_mm:.2f} mm from {one}: {x:+.2f} forwards, "
            f"{y:+.2f} outwards, {z:+.2f} upwards; p {row.p:.3g}, corrected {row.p_corrected:.3g}"
        )


def _anova_lines(report: ReliabilityReport) -> Iterator[str]:
    if not report.anova:
        return
    yield ""
    yield f"Procrustes ANOVA of {len(report.anova_features)} features"
    yield "  source                  df   sum of squares, mm2   share, %       F        p"
    for row in report.anova:
        test = "" if row.f is None or row.p is None else f"{row.f:8.2f} {row.p:8.2g}"
        numbers = f"{row.freedom:>5} {row.sum_of_squares:18.3f} {100 * row.share:11.1f}"
        yield f"  {row.source:<21}{numbers} {test}".rstrip()
    if report.repeatability is not None:
        yield f"  repeatability {report.repeatability:.2f}"


def _disagreement_lines(report: ReliabilityReport) -> Iterator[str]:
    yield ""
    yield "Farthest apart"
    for row in report.disagreements[:_MOST_DISAGREEMENTS]:
        who = " - ".join(row.labellings)
        place = f"{row.specimen} {row.side.word}"
        yield f"  {place} {row.code}: {row.distance_mm:.2f} mm, {row.ratio:.1f} times the median ({who})"
