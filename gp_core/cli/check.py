"""``gp-core check``: labels that are missing, exchanged or outliers."""

from __future__ import annotations

import argparse
from collections import Counter
from dataclasses import replace

from gp_core.atlas.atlas import Atlas
from gp_core.atlas.fitting import fit_atlas
from gp_core.atlas.label_check import Finding, check_specimen
from gp_core.cli.options import (
    Subparsers,
    add_atlas,
    add_command,
    add_json,
    add_labelling_error,
    add_specimens,
    lab_names,
    labelling_error,
    labellings,
    read_atlas,
    save_json,
    say,
)
from gp_core.errors import GpError
from gp_core.io import Labelling, landmarks_of, read_points, specimen_of
from gp_core.landmarks.anatomy import with_cochlea_origin
from gp_core.landmarks.plausible_size import check_plausible_size
from gp_core.landmarks.sets import Specimen

__all__ = ["add", "say_findings"]


def add(commands: Subparsers) -> None:
    """Add the command to the parser.

    Parameters
    ----------
    commands : Subparsers
        The subparsers of ``gp-core``, to which the command is added.
    """
    parser = add_command(
        commands,
        "check",
        run,
        summary="report labels that are missing, doubtful or exchanged",
        example="gp-core check labelled/GP01_L.mrk.json labelled/GP01_R.mrk.json",
    )
    add_specimens(parser)
    parser.add_argument(
        "--side", choices=("L", "R"), help="side of a single file whose content and name do not give it"
    )
    add_atlas(parser, default=["published"])
    add_labelling_error(parser)
    add_json(parser)


def run(args: argparse.Namespace) -> int:
    """Run ``gp-core check``: status 1 where a label needs attention.

    Parameters
    ----------
    args : argparse.Namespace
        The parsed options.

    Returns
    -------
    int
        Exit status; see `gp_core.cli.entry.main`.
    """
    found = labellings(args) if args.side is None else [Labelling(_one_side(args))]
    atlas, others = read_atlas(args.atlas)
    error = labelling_error(args)
    n_of = Counter(each.specimen.name for each in found)
    report = {}
    for each in found:
        name = each.specimen.name if n_of[each.specimen.name] == 1 else f"{each.specimen.name} ({each.who})"
        expected = _atlas_for(each.specimen, atlas, others)
        expected = expected if error is None else expected.with_labelling_error(error)
        findings = check_specimen(each.specimen, expected)
        report[name] = [replace(finding, specimen=name) for finding in findings]
    if error is not None:
        say(f"Labelling error: {error.text}")
    save_json(args.json, {name: [f.as_dict() for f in findings] for name, findings in report.items()})
    for name, findings in report.items():
        say_findings(name, findings)
    return int(any(f.is_problem for findings in report.values() for f in findings))


def _one_side(args: argparse.Namespace) -> Specimen:
    """Read a single file of the given side."""
    files: list[str] = args.specimens
    if len(files) > 1:
        raise GpError(f"--side is for one file, got {len(files)}", remedy="Check them one by one.")
    points = read_points(files[0], names=lab_names(args))
    landmarks = with_cochlea_origin(landmarks_of(points, side=args.side))
    check_plausible_size(landmarks, files[0])
    return Specimen(specimen_of(points), {landmarks.side: landmarks})


def _atlas_for(specimen: Specimen, atlas: Atlas | None, others: list[Specimen] | None) -> Atlas:
    """Return the atlas, fitted without the animal that is checked."""
    return atlas or fit_atlas([other for other in others or [] if other.name != specimen.name])


def say_findings(name: str, findings: list[Finding]) -> None:
    """Print the findings on one animal.

    Parameters
    ----------
    name : str
        Name of the animal.
    findings : list of Finding
        The worst first.
    """
    say(f"{name}: {_verdict(findings)}")
    for finding in findings:
        mark = "!" if finding.is_problem else " "
        codes = " ".join(finding.landmarks) if len(finding.landmarks) < 3 else "all"
        said = f"Checked by {finding.checked_by or 'unnamed'}." if finding.is_checked else finding.remedy
        remedy = f". {said}" if said else ""
        say(f"  {mark} {finding.side.word:<5} {codes:<8} {finding.text}{remedy}")


def _verdict(findings: list[Finding]) -> str:
    doubtful = sum(f.is_problem for f in findings)
    absent = sum(f.kind in ("missing", "suggested", "unseen") for f in findings)
    if not findings:
        return "all labels placed, none doubtful"
    return f"{doubtful} to review, {absent} not placed"
