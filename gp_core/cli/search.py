"""``gp-core search``: which features to label and to touch (Figure 5)."""

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
    ProgressLine,
    add_figure,
    add_method,
    add_settings,
    add_workers,
    codes_of,
    executor_of,
    save_figure_of,
    settings_of,
)
from gp_core.disk import all_or_none
from gp_core.landmarks.features import CODES, PROBE
from gp_core.registration.jrmpc import DEFAULTS
from gp_core.study.leave_one_out import summarise
from gp_core.study.nested_search import NestedReport, nested_search
from gp_core.study.subset_search import SearchReport, search_features

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
        "search",
        run,
        summary="search for the features with the least leave-one-out error (Figure 5)",
        example="gp-core search labelled/ --checkpoint search.json --figure figure5.png",
    )
    add_specimens(parser)
    add_method(parser)
    parser.add_argument(
        "--training", nargs="+", metavar="CODE", help="features to start from; default: all 20"
    )
    parser.add_argument(
        "--fewest-training",
        type=int,
        metavar="N",
        help="where to stop dropping training features; default: 3, with robust none are dropped",
    )
    parser.add_argument(
        "--nested",
        action="store_true",
        help="hold each animal out before features are selected, and report its errors, which are unbiased",
    )
    parser.add_argument(
        "--checkpoint",
        metavar="FILE",
        help="store results here as they come in; if the file exists, resume from it",
    )
    add_settings(parser, "defaults")
    add_workers(parser)
    add_figure(parser)
    add_json(parser)


def run(args: argparse.Namespace) -> int:
    """Run ``gp-core search``.

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
    training = codes_of(args.training, "--training", CODES, CODES)
    search = nested_search if args.nested else search_features
    report: SearchReport | NestedReport
    with executor_of(args) as executor, ProgressLine() as line:
        report = search(
            specimens,
            method=args.method,
            training=training,
            fewest_training=args.fewest_training,
            settings=settings_of(args, DEFAULTS),
            executor=executor,
            checkpoint=args.checkpoint,
            progress=line,
        )
    drawing = "nested_errors" if isinstance(report, NestedReport) else "search_curves"
    with all_or_none():
        save_json(args.json, report.as_dict())
        save_figure_of(args.figure, drawing, report)
    for text in _nested_lines(report) if isinstance(report, NestedReport) else _lines(report):
        say(text)
    return 0


def _lines(report: SearchReport) -> Iterator[str]:
    yield f"Search by {report.method}: {report.fits} estimates in {report.seconds:.0f} s"
    yield ""
    yield "  training  dropped      E_T  probe"
    for step in report.training:
        yield f"  {step.n:8}  {step.dropped or '':<7}  {step.e_t:7.2f}  {' '.join(step.probe)}"
    best = report.best
    yield ""
    yield f"Best: {best.n} training features, {len(best.probe)} touched, E_T {best.e_t:.2f}"
    yield "  touched        E_T  features"
    for probe in best.probe_curve:
        mark = "  (the paper's)" if set(probe.features) == set(PROBE) else ""
        yield f"  {probe.n:7}  {probe.e_t:9.2f}  {' '.join(probe.features)}{mark}"


def _nested_lines(report: NestedReport) -> Iterator[str]:
    yield f"Nested search by {report.method}: {report.fits} estimates in {report.seconds:.0f} s"
    yield ""
    yield "  held out   training  dropped, and touched"
    for fold in report.folds:
        dropped = " ".join(code for code in CODES if code not in fold.features)
        left = f"-{dropped}" if dropped else "none"
        yield f"  {fold.held_out:<9}  {len(fold.features):8}  {left}; {' '.join(fold.probe)}"
    yield ""
    yield "  errors                  E_CO mm: mean  median  max     E_MA deg: mean  median  max      E_T"
    both = (("chosen without the animal", report.errors), ("chosen on all animals", report.optimistic.errors))
    for label, errors in both:
        summary = summarise(errors)
        co, ma = summary["e_co_mm"], summary["e_ma_deg"]
        yield (
            f"  {label:<27}  {co['mean']:6.3f}  {co['median']:6.3f}  {co['max']:5.3f}"
            f"            {ma['mean']:5.2f}  {ma['median']:6.2f}  {ma['max']:5.2f}   {summary['e_t']:6.2f}"
        )
