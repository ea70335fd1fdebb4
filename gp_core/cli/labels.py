"""Commands on labelled animals: ``fit``, ``import-mat`` and ``check``."""

from __future__ import annotations

import argparse
from collections import Counter
from dataclasses import replace
from typing import Any

import numpy as np

from gp_core.atlas.atlas import Atlas
from gp_core.atlas.fitting import fit_atlas, fit_screened_atlas
from gp_core.atlas.label_check import Finding, check_specimen
from gp_core.atlas.plain_fit import fit_plain_atlas
from gp_core.atlas.screening import Screened, screen_labels
from gp_core.cli.options import (
    Subparsers,
    add_command,
    add_json,
    add_specimens,
    check_ending,
    lab_names,
    labelled_specimens,
    labellings,
    read_atlas,
    save_json,
    say,
)
from gp_core.errors import GpError
from gp_core.io import Labelling, import_mat, landmarks_of, read_points, specimen_of
from gp_core.landmarks.anatomy import with_cochlea_origin
from gp_core.landmarks.plausible_size import check_plausible_size
from gp_core.landmarks.sets import Specimen

__all__ = ["add"]


def add(commands: Subparsers) -> None:
    """Add the commands to the parser.

    Parameters
    ----------
    commands : Subparsers
        The subparsers of ``gp-core``, to which the commands are added.
    """
    fit = add_command(
        commands,
        "fit",
        run_fit,
        summary="fit an atlas to labelled animals",
        example="gp-core fit labelled/ -o atlas.json",
    )
    add_specimens(fit)
    fit.add_argument("-o", "--output", required=True, metavar="ATLAS", help="atlas file to write (.json)")
    fit.add_argument("--name", help="name of the atlas, by default the number of animals")
    fit.add_argument(
        "--keep-doubtful",
        action="store_true",
        help="also use labels that the check rejects; by default they are left out, and their animals "
        "get little weight",
    )
    add_json(fit)
    mat = add_command(
        commands,
        "import-mat",
        run_import_mat,
        summary="convert the authors' labelled sets to landmark files",
        example="gp-core import-mat sets_L.mat sets_R.mat -o labelled/",
    )
    mat.add_argument("left", metavar="CC_L.mat", help="sets of the left side, variable cc_L")
    mat.add_argument("right", metavar="CC_R.mat", help="sets of the right side, variable cc_R")
    mat.add_argument("-o", "--output", required=True, metavar="DIR", help="folder to write to")
    mat.add_argument("--replace", action="store_true", help="replace files of the same names")
    check = add_command(
        commands,
        "check",
        run_check,
        summary="report labels that are missing, doubtful or exchanged",
        example="gp-core check labelled/GP01_L.mrk.json labelled/GP01_R.mrk.json",
    )
    add_specimens(check)
    check.add_argument(
        "--side", choices=("L", "R"), help="side of a single file whose content and name do not give it"
    )
    check.add_argument("--atlas", nargs="+", default=["published"], metavar="ATLAS", help="as for estimate")
    add_json(check)


def run_fit(args: argparse.Namespace) -> int:
    """Run ``gp-core fit``.

    Parameters
    ----------
    args : argparse.Namespace
        The parsed options.

    Returns
    -------
    int
        Exit status; see `gp_core.cli.entry.main`.
    """
    check_ending(args.output, (".json",), "--output")
    specimens = labelled_specimens(args)
    screened = screen_labels(specimens)
    if args.keep_doubtful:
        atlas = fit_plain_atlas(specimens, name=args.name)
    else:
        atlas = fit_screened_atlas(screened, name=args.name or f"{len(specimens)} specimens")
    atlas.save(args.output)
    save_json(args.json, _fit_report(atlas, screened, kept=args.keep_doubtful))
    _say_screened(screened, kept=args.keep_doubtful)
    spread = np.sqrt(atlas.variances(atlas.codes))
    say(f"Atlas of {len(atlas.specimens)} animals, {atlas.n_samples} sides: {args.output}")
    if skipped := [s.name for s in specimens if s.name not in atlas.specimens]:
        say(f"  Skipped: {', '.join(skipped)}, of which no side could be used")
    say("  feature   SD between animals, mm a coordinate")
    for code, sd in zip(atlas.codes, spread, strict=True):
        say(f"  {code:<9} {sd:5.2f}")
    return 0


def _say_screened(screened: Screened, *, kept: bool) -> None:
    """Print what the check found, the worst animal first, and what was left out."""
    for name in dict.fromkeys(finding.specimen for finding in screened.findings):
        _say_findings(name, [finding for finding in screened.findings if finding.specimen == name])
    for note in screened.notes:
        say(note)
    if screened.left_out and kept:
        say("All of these labels were used (--keep-doubtful).")
    elif screened.left_out:
        n = len({finding.specimen for finding in screened.left_out})
        say(
            "Exchanged names and labels beyond 5 SD were left out; "
            f"{_count(n, 'animal')} with such labels {'get' if n > 1 else 'gets'} little weight. "
            "To use them, add --keep-doubtful."
        )


def _fit_report(atlas: Atlas, screened: Screened, *, kept: bool) -> dict[str, Any]:
    left_out = () if kept else screened.left_out
    return {
        "name": atlas.name,
        "n_samples": atlas.n_samples,
        "features": list(atlas.codes),
        "findings": [finding.as_dict() for finding in screened.findings],
        "left_out": [finding.as_dict() for finding in left_out],
        "notes": list(screened.notes),
    }


def run_import_mat(args: argparse.Namespace) -> int:
    """Run ``gp-core import-mat``.

    Parameters
    ----------
    args : argparse.Namespace
        The parsed options.

    Returns
    -------
    int
        Exit status; see `gp_core.cli.entry.main`.
    """
    written = import_mat(args.left, args.right, args.output, overwrite=args.replace)
    say(f"{len(written)} landmark files in {args.output}")
    return 0


def run_check(args: argparse.Namespace) -> int:
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
    n_of = Counter(each.specimen.name for each in found)
    report = {}
    for each in found:
        name = each.specimen.name if n_of[each.specimen.name] == 1 else f"{each.specimen.name} ({each.who})"
        findings = check_specimen(each.specimen, _atlas_for(each.specimen, atlas, others))
        report[name] = [replace(finding, specimen=name) for finding in findings]
    save_json(args.json, {name: [f.as_dict() for f in findings] for name, findings in report.items()})
    for name, findings in report.items():
        _say_findings(name, findings)
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


def _say_findings(name: str, findings: list[Finding]) -> None:
    say(f"{name}: {_verdict(findings)}")
    for finding in findings:
        mark = "!" if finding.is_problem else " "
        codes = " ".join(finding.landmarks) if len(finding.landmarks) < 3 else "all"
        said = f"Checked by {finding.checked_by or 'unnamed'}." if finding.is_checked else finding.remedy
        remedy = f". {said}" if said else ""
        say(f"  {mark} {finding.side.word:<5} {codes:<8} {finding.text}{remedy}")


def _count(n: int, what: str) -> str:
    return f"{n} {what}{'' if n == 1 else 's'}"


def _verdict(findings: list[Finding]) -> str:
    doubtful = sum(f.is_problem for f in findings)
    absent = sum(f.kind in ("missing", "suggested", "unseen") for f in findings)
    if not findings:
        return "all labels placed, none doubtful"
    return f"{doubtful} to look at, {absent} not placed"
