"""The command ``gp-labeler phantom``: synthetic head scans with their truth."""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from gp_core.command_line import CommandParser
from gp_core.errors import GpError
from gp_core.standard_streams import shown_path, standard_streams
from gp_labeler.phantom.variation import SWITCHES, USUAL, HeadVariation

__all__ = ["make_phantom_parser", "run_phantom"]

_EXAMPLE = """examples:
  gp-labeler phantom -o head.nrrd
  gp-labeler phantom -o head.nrrd --seed 7 --varied --turn --crop 0.3:A
  gp-labeler phantom --seeds 1-5 --labelled --varied -o library/

The seed determines the value of a switch without a value. Write negative values after "=": --turn=-20,0,45.
The truth is written beside each scan, as <name>.truth.json: all switches, the landmarks, the pose.
"""
_DRAWN = "drawn by the seed"
_MOST = 1000


def make_phantom_parser() -> argparse.ArgumentParser:
    """Return the parser of ``gp-labeler phantom``."""
    parser = CommandParser(
        prog="gp-labeler phantom",
        description="Make synthetic scans of guinea-pig heads with known truth.",
        epilog=_EXAMPLE,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "-o",
        "--output",
        type=Path,
        required=True,
        metavar="SCAN|DIR",
        help="the scan (.nrrd, .nii.gz, .nii, .mha); with --seeds a folder",
    )
    which = parser.add_mutually_exclusive_group()
    which.add_argument(
        "--seed",
        type=int,
        default=0,
        metavar="N",
        help="random seed of the animal and of the noise; default: 0",
    )
    which.add_argument("--seeds", metavar="N-M", help="several seeds, such as 1-5 or 2,4,9")
    parser.add_argument("--labelled", action="store_true", help="also write the true landmarks (.mrk.json)")
    parser.add_argument("--spacing", type=float, default=0.2, metavar="MM", help="voxel size; default: 0.2")
    parser.add_argument(
        "--noise",
        type=float,
        default=900.0,
        metavar="GREY",
        help="standard deviation of the noise; default: 900",
    )
    group = parser.add_argument_group("variation between heads and scans")
    group.add_argument("--varied", action="store_true", help=f"draw {', '.join(map(_option, USUAL))}")
    for name, switch in SWITCHES.items():
        group.add_argument(
            f"--{_option(name)}", nargs="?", const=_DRAWN, metavar=switch.values, help=switch.help
        )
    return parser


def _option(name: str) -> str:
    return name.replace("_", "-")


def run_phantom(arguments: Sequence[str]) -> int:
    """Make the phantoms and say what was written.

    Raises
    ------
    GpError
        An option is wrong, or a file cannot be written.
    """
    args = make_phantom_parser().parse_args(arguments)
    seeds = _parsed_seeds(args.seeds) if args.seeds else [args.seed]
    if min(seeds) < 0:
        raise GpError(f"a seed must be a whole number from 0, got {min(seeds)}")
    if not 0 <= args.noise < 1e5:
        raise GpError(f"--noise must be 0 to 100000, got {args.noise:g}")
    variations = [_variation(args, seed) for seed in seeds]
    files = {} if args.seeds else {"output": ".nrrd"}
    with standard_streams(args, files, (), folders=("output",) if args.seeds else ()):
        return _make(args, seeds, variations)


def _make(args: argparse.Namespace, seeds: Sequence[int], variations: Sequence[HeadVariation]) -> int:
    from gp_labeler.phantom import make_phantom, save_phantom  # here: `--help` need not wait for scipy
    from gp_labeler.phantom.files import scan_name

    if not args.seeds:
        scan_name(args.output)
    for seed, variation in zip(seeds, variations, strict=True):
        path = args.output / f"phantom-{seed}.nrrd" if args.seeds else args.output
        phantom = make_phantom(seed, spacing=args.spacing, noise=args.noise, variation=variation)
        files = save_phantom(phantom, path, labelled=args.labelled)
        size = " x ".join(map(str, phantom.volume.size))
        done = ", ".join(map(_option, variation.names)) or "plain"
        is_file = shown_path(path) == str(path)  # to a stream goes the scan alone
        beside = f"; {', '.join(file.name for file in files[1:])}" if is_file else ""
        sys.stdout.write(f"{shown_path(path)}: {size} voxels, {done}{beside}\n")
    return 0


def _parsed_seeds(text: str) -> list[int]:
    """Return the seeds of a text such as ``1-5`` or ``2,4,9-11``."""
    seeds: list[int] = []
    for part in text.split(","):
        found = re.fullmatch(r"\s*(\d+)(?:-(\d+))?\s*", part)
        if found is None:
            raise GpError(f"--seeds must be like 1-5 or 2,4,9, got {text!r}")
        first, last = int(found[1]), int(found[2] or found[1])
        if not first <= last < first + _MOST:
            raise GpError(f"--seeds must rise, and be at most {_MOST}, got {part.strip()!r}")
        seeds += range(first, last + 1)
    return list(dict.fromkeys(seeds))


def _variation(args: argparse.Namespace, seed: int) -> HeadVariation:
    """Return what the options say of one seed; what they leave open is drawn."""
    texts = {name: getattr(args, name) for name in SWITCHES if getattr(args, name) is not None}
    drawn = [name for name, text in texts.items() if text == _DRAWN]
    drawn += [name for name in USUAL if args.varied and name not in texts]
    given = {name: _parsed(name, text) for name, text in texts.items() if text != _DRAWN}
    return HeadVariation.drawn(seed, drawn).having(given)


def _parsed(name: str, text: str) -> Any:
    switch = SWITCHES[name]
    try:
        return switch.parse(text)
    except ValueError:
        raise GpError(f"--{_option(name)} must be {switch.values}, got {text!r}") from None
