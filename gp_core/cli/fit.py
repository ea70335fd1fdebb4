"""``gp-core fit``: an atlas from labelled animals."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from typing import Any

import numpy as np

from gp_core.atlas.atlas import Atlas
from gp_core.atlas.certainty_weights import checked_weights
from gp_core.atlas.fitting import fit_screened_atlas
from gp_core.atlas.plain_fit import fit_plain_atlas
from gp_core.atlas.screening import Screened, screen_labels
from gp_core.cli.check import say_findings
from gp_core.cli.options import (
    Subparsers,
    add_command,
    add_json,
    add_labelling_error,
    add_specimens,
    check_ending,
    labelled_specimens,
    labelling_error,
    save_json,
    say,
)
from gp_core.disk import all_or_none
from gp_core.errors import GpError
from gp_core.landmarks.sets import Specimen

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
        "fit",
        run,
        summary="fit an atlas to labelled animals",
        example="gp-core fit labelled/ -o atlas.json",
    )
    add_specimens(parser)
    parser.add_argument("-o", "--output", required=True, metavar="ATLAS", help="atlas file to write (.json)")
    parser.add_argument("--name", help="name of the atlas, by default the number of animals")
    parser.add_argument(
        "--keep-doubtful",
        action="store_true",
        help="also use labels that the check rejects; by default they are left out, and their animals "
        "get little weight",
    )
    parser.add_argument(
        "--certainty-weights",
        nargs="?",
        const="",
        metavar="WEIGHTS",
        help="weight labels by their certainty; by default sure=1,fair=0.5,guess=0.2, and labels without one "
        "count as sure",
    )
    add_labelling_error(parser)
    add_json(parser)


def run(args: argparse.Namespace) -> int:
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
    weights = _weights(args.certainty_weights)
    error = labelling_error(args)
    specimens = labelled_specimens(args)
    screened = screen_labels(specimens)
    if args.keep_doubtful:
        atlas = fit_plain_atlas(specimens, name=args.name, by_certainty=weights)
    else:
        name = args.name or f"{len(specimens)} specimens"
        atlas = fit_screened_atlas(screened, name=name, by_certainty=weights)
    atlas = atlas if error is None else atlas.with_labelling_error(error)
    with all_or_none():
        atlas.save(args.output)
        save_json(args.json, _fit_report(atlas, screened, kept=args.keep_doubtful))
    _say_screened(screened, kept=args.keep_doubtful)
    spread = np.sqrt(atlas.variances(atlas.codes))
    say(f"Atlas of {len(atlas.specimens)} animals, {atlas.n_samples} sides: {args.output}")
    if skipped := [s.name for s in specimens if s.name not in atlas.specimens]:
        say(f"  Skipped: {', '.join(skipped)}, of which no side could be used")
    if weights is not None:
        n, total = _n_certain(specimens)
        told = ", ".join(f"{name} {weight:g}" for name, weight in weights.items())
        say(f"  Weights by certainty: {told}; {n} of {total} labels have one")
    if error is not None:
        say(f"  Labelling error in checks and expected regions: {error.text}")
    say("  feature   SD between animals, mm per coordinate")
    for code, sd in zip(atlas.codes, spread, strict=True):
        say(f"  {code:<9} {sd:5.2f}")
    return 0


def _weights(words: str | None) -> Mapping[str, float] | None:
    """Return the weights of ``--certainty-weights``."""
    if words is None:
        return None
    given = {}
    for part in filter(None, words.split(",")):
        name, _, number = part.partition("=")
        try:
            given[name.strip()] = float(number)
        except ValueError:
            raise GpError(
                f"--certainty-weights takes words such as guess=0.2, got {part!r:.40}",
                remedy="Such as sure=1,fair=0.5,guess=0.2.",
            ) from None
    return checked_weights(given)


def _n_certain(specimens: list[Specimen]) -> tuple[int, int]:
    """Return how many labels have a certainty, and how many there are."""
    sides = [landmarks for specimen in specimens for landmarks in specimen.sides.values()]
    known = [
        landmarks.provenance.get(code) for landmarks in sides for code in landmarks.placed if code != "CO"
    ]
    return sum(about is not None and about.certainty is not None for about in known), len(known)


def _say_screened(screened: Screened, *, kept: bool) -> None:
    """Print what the check found, the worst animal first, and what was left out."""
    for name in dict.fromkeys(finding.specimen for finding in screened.findings):
        say_findings(name, [finding for finding in screened.findings if finding.specimen == name])
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


def _count(n: int, what: str) -> str:
    return f"{n} {what}{'' if n == 1 else 's'}"
