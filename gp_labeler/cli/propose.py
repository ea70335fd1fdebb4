"""The command ``gp-labeler propose``: first labels of scans from labelled scans."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gp_core.command_line import CommandParser
from gp_core.disk import protected_inputs
from gp_core.errors import GpError
from gp_core.standard_streams import standard_streams
from gp_labeler.cli.mesh import add_import_options, import_options

if TYPE_CHECKING:
    from gp_labeler.autolabel import TemplateLibrary
    from gp_labeler.autolabel.head_run import HeadResult

__all__ = ["add_library_options", "library_of", "make_propose_parser", "prepare", "run_propose"]

_EXAMPLE = """examples:
  gp-labeler propose head.nrrd --like labelled/ -o suggested/
  gp-labeler propose scans/ --like GP-0*.gpspecimen.json -o suggested/ --workers 4
  gp-labeler propose head.nrrd --like labelled/ -o suggested/ --points three.mrk.json
  gp-labeler propose head.nrrd --like labelled/ -o suggested/ --stored mirrored

Labelled scans are specimen files, or landmark files beside their scans: GP-014.nrrd, GP-014_L.mrk.json,
GP-014_R.mrk.json. Landmarks may have any names. The first run prepares each labelled scan and predicts it
from the others, to measure how accurate suggestions are; later runs reuse these results. Results of an
earlier run are kept.

Suggestions are not labels: open them with the scan, and confirm or correct each.
"""


def make_propose_parser() -> argparse.ArgumentParser:
    """Return the parser of ``gp-labeler propose``."""
    parser = CommandParser(
        prog="gp-labeler propose",
        description="Suggest the landmarks of scans, based on labelled scans.",
        epilog=_EXAMPLE,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("volumes", type=Path, nargs="+", metavar="VOLUME", help="scans, or folders of scans")
    parser.add_argument(
        "--like", type=Path, nargs="+", required=True, metavar="LABELLED", help="labelled scans, or folders"
    )
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="DIR", help="where to write")
    parser.add_argument(
        "--stored",
        choices=("as-it-is", "mirrored"),
        help="whether the scans are stored as mirror images; by default, the orientation of the file is "
        "used, with a warning",
    )
    parser.add_argument(
        "--points",
        type=Path,
        nargs="+",
        metavar="FILE",
        help="three or more landmarks of the scan, if the head is not found automatically",
    )
    parser.add_argument("--replace", action="store_true", help="recompute the results of an earlier run")
    add_library_options(parser)
    add_import_options(parser.add_argument_group("reading the scans"))
    return parser


def add_library_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of how labelled scans are prepared and registered."""
    group = parser.add_argument_group("use of labelled scans")
    group.add_argument(
        "--most", type=int, default=5, metavar="N", help="labelled scans to use for a head; default: 5"
    )
    group.add_argument(
        "--engine",
        choices=("auto", "greedy", "demons"),
        default="auto",
        help="registration: greedy, or the less accurate demons if greedy is not installed",
    )
    group.add_argument(
        "--templates",
        type=Path,
        metavar="DIR",
        help="folder for prepared scans; default: in the user's cache folder",
    )
    group.add_argument("--workers", type=int, default=1, metavar="N", help="processes to use; default: 1")
    group.add_argument(
        "--scheduler", metavar="ADDRESS", help="address of a Dask cluster, such as tcp://host:8786"
    )


def run_propose(arguments: Sequence[str]) -> int:
    """Read, guess, write, and say what was written.

    Returns
    -------
    int
        0; 2 where a scan got no suggestions, which is said in a line each.

    Raises
    ------
    GpError
        An option is wrong, or the labelled scans cannot be read.
    """
    args = make_propose_parser().parse_args(arguments)
    with standard_streams(args, {}, ("volumes", "like", "points"), folders=("output",)):
        return _propose(args)


def _propose(args: argparse.Namespace) -> int:
    from gp_core.study.parallel import open_executor, run_map  # here: `--help` need not wait
    from gp_labeler.autolabel.head_run import HeadRun
    from gp_labeler.autolabel.registration import engine_named
    from gp_labeler.document.labelled_scans import scans_at

    heads = list(dict.fromkeys(scan for path in args.volumes for scan in scans_at(path)))
    if args.points and len(heads) != 1:
        raise GpError(f"--points are of one scan, got {len(heads)} scans")
    _check_names(heads)
    engine = engine_named(args.engine)
    library = library_of(args.like, args)
    placed = _placed(args.points) if args.points else {}
    run = HeadRun(
        library,
        args.output,
        engine,
        None if args.stored is None else "mirrored" if args.stored == "mirrored" else "as it is",
        placed,
        import_options(args),
        args.replace,
    )
    failed = []

    def tell(_: int, result: HeadResult) -> None:
        failed.extend([result.problem] if result.problem else [])
        _tell(result)

    with protected_inputs([*heads, *args.like]), open_executor(args.workers, args.scheduler) as executor:
        prepare(library, engine, executor)
        run_map(run, heads, executor, done=tell)
    return 2 if failed else 0


def library_of(paths: Sequence[Path], args: argparse.Namespace) -> TemplateLibrary:
    """Return the labelled scans at some paths, and say which cannot be used."""
    from platformdirs import user_cache_path

    from gp_labeler.autolabel import TemplateLibrary
    from gp_labeler.document.labelled_scans import read_labelled_scans

    found = read_labelled_scans(paths)
    for skipped in found.skipped:
        sys.stderr.write(f"gp-labeler: left out: {skipped.text}\n")
    folder = args.templates or user_cache_path("gp-labeler", appauthor=False) / "templates"
    return TemplateLibrary(found.scans, folder, most=args.most)


def prepare(library: TemplateLibrary, engine: str, executor: Any) -> None:
    """Prepare the labelled scans, and predict each from the others, on all workers."""
    from gp_core.study.parallel import run_map
    from gp_labeler.autolabel.head_run import PrepareRun

    names = [scan.name for scan in library.scans]
    run_map(PrepareRun(library, engine, held_out=False), names, executor)
    run_map(PrepareRun(library, engine, held_out=True), names, executor)


def _check_names(heads: list[Path]) -> None:
    from gp_labeler.imaging.readers.formats import volume_stem

    stems = [volume_stem(head) for head in heads]
    twice = next((stem for stem in stems if stems.count(stem) > 1), None)
    if twice is not None:
        raise GpError(
            f"two scans are named {twice}", remedy="Suggest for them in two runs, into two folders."
        )


def _placed(files: Sequence[Path]) -> Mapping[str, Any]:
    """Return the landmarks of some files by name."""
    from gp_labeler.document.labelled_scans import placed_points

    found = placed_points(files)
    if len(found) < 3:
        raise GpError(f"--points must hold three landmarks or more, got {len(found)}", file=files[0])
    return found


def _tell(result: HeadResult) -> None:
    """Say what became of one head."""
    from gp_labeler.autolabel.proposal import scans_text  # here: `--help` need not wait

    if result.problem:
        names_it = result.path.name in result.problem
        sys.stderr.write(f"gp-labeler: {'' if names_it else f'{result.path.name}: '}{result.problem}\n")
        return
    about = result.proposal
    doubtful = [guess["name"] for guess in about["guesses"] if guess["doubtful"]]
    written = "kept from an earlier run" if result.is_earlier else ", ".join(f.name for f in result.files)
    sys.stdout.write(
        f"{result.path.name}: {_count(about['guesses'])} from {scans_text(len(about['templates']))}"
        f"{_radii(about['guesses'])}; {written}\n"
    )
    if doubtful:
        sys.stdout.write(f"{result.path.name}: look closely at {' '.join(doubtful)}\n")
    if about["outside"]:
        sys.stdout.write(f"{result.path.name}: beyond the edge of the scan: {' '.join(about['outside'])}\n")
    for warning in about["warnings"]:
        sys.stderr.write(f"gp-labeler: {result.path.name}: {warning}\n")


def _count(guesses: Sequence[Mapping[str, Any]]) -> str:
    return "1 suggestion" if len(guesses) == 1 else f"{len(guesses)} suggestions"


def _radii(guesses: Sequence[Mapping[str, Any]]) -> str:
    radii = sorted(guess["radius95"] for guess in guesses if guess["radius95"] is not None)
    return f", 95 % within {radii[len(radii) // 2]:.2f} mm (median)" if radii else ""
