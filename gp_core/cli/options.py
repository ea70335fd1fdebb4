"""Options that several commands share, and their output."""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from pathlib import Path
from typing import Any

from gp_core.atlas.atlas import Atlas, is_atlas_file
from gp_core.atlas.labelling_error import LabellingError
from gp_core.disk import is_protected, is_stream, protected_inputs, write_text
from gp_core.errors import GpError
from gp_core.extras import need_extra
from gp_core.io import Labelling, landmark_files, load_labellings, load_specimens, read_lab_names
from gp_core.landmarks.labels import LabelNames
from gp_core.landmarks.sets import Specimen
from gp_core.standard_streams import standard_streams

__all__ = [
    "WRITTEN",
    "AtlasSource",
    "Subparsers",
    "add_atlas",
    "add_command",
    "add_json",
    "add_labelling_error",
    "add_names",
    "add_specimens",
    "check_ending",
    "keeping_inputs",
    "lab_names",
    "labelled_specimens",
    "labelling_error",
    "labellings",
    "read_atlas",
    "save_json",
    "say",
    "streams_of",
]

Subparsers = Any
"""What `argparse.ArgumentParser.add_subparsers` returns; its class is private."""

WRITTEN = ("json", "tfm", "csv", "landmarks", "path_out", "figure", "output", "checkpoint")
"""Names of the options whose files are written; every other word that is a file is read."""

_ENDINGS = {
    "json": (".json",),
    "tfm": (".tfm", ".txt"),
    "csv": (".csv", ".txt"),
    "landmarks": (".mrk.json", ".json"),
    "path_out": (".csv", ".txt"),
}
"""Permitted suffixes of these files, by which other programs recognise them."""

_READ = (
    *("touches", "specimens", "atlas", "recording", "poses", "ct_landmarks", "bone", "path", "names", "tip"),
    "other_ear",
    *("left", "right", "labelling_error", "physical"),
)
"""Options and arguments whose files are read."""

_OUTPUT_ENDINGS = {"fit": ".json", "touches": ".csv"}
"""Commands whose ``--output`` is a file, and its ending; that of the others is a folder."""

_ANOTHER = "Name another file."

AtlasSource = tuple[Atlas | None, list[Specimen] | None]


def add_command(
    commands: Subparsers, name: str, run: Callable[[argparse.Namespace], int], *, summary: str, example: str
) -> argparse.ArgumentParser:
    """Add a command with its one-line summary, and an example in its help.

    Parameters
    ----------
    commands : Subparsers
        The subparsers of ``gp-core``.
    name : str
        Name of the command.
    run : callable
        Takes the parsed options and returns the exit status.
    summary : str
        One line for the help.
    example : str
        A command line.

    Returns
    -------
    argparse.ArgumentParser
        The parser of the command.
    """
    parser: argparse.ArgumentParser = commands.add_parser(
        name,
        help=summary.replace("%", "%%"),
        description=f"{summary[0].upper()}{summary[1:]}.",
        epilog=f"example:\n  {example}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.set_defaults(run=run)
    return parser


def add_specimens(parser: argparse.ArgumentParser) -> None:
    """Add the labelled animals: one or more paths.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        The parser of one command.
    """
    parser.add_argument(
        "specimens",
        nargs="+",
        metavar="SPECIMENS",
        help="landmark files of labelled animals, or folders of them",
    )
    add_names(parser)
    add_labelling(parser)


def add_labelling(parser: argparse.ArgumentParser) -> None:
    """Add ``--observer NAME`` and ``--round N``.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        The parser of one command.
    """
    parser.add_argument("--observer", metavar="NAME", help="use the labels of this observer alone")
    parser.add_argument(
        "--round",
        type=int,
        metavar="N",
        help="use the labels of this round alone, from 1; by default an animal that was labelled several "
        "times has the mean of its labels",
    )


def add_names(parser: argparse.ArgumentParser) -> None:
    """Add ``--names FILE``.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        The parser of one command.
    """
    parser.add_argument(
        "--names",
        metavar="FILE",
        help="a table with two columns: your name of a point, and the feature's code (CA, or CA_L)",
    )


def lab_names(args: argparse.Namespace) -> LabelNames | None:
    """Return the lab's own names from ``--names``.

    Parameters
    ----------
    args : argparse.Namespace
        The parsed options.

    Returns
    -------
    LabelNames or None
        None without the option.
    """
    return None if args.names is None else read_lab_names(args.names)


def labelled_specimens(args: argparse.Namespace) -> list[Specimen]:
    """Return the animals of the command line, with the names of ``--names``.

    Parameters
    ----------
    args : argparse.Namespace
        The parsed options.

    Returns
    -------
    list of Specimen
        The labelled animals.
    """
    return load_specimens(args.specimens, **_which(args))


def labellings(args: argparse.Namespace) -> list[Labelling]:
    """Return the animals of the command line, with the labels of each observer and round apart.

    Parameters
    ----------
    args : argparse.Namespace
        The parsed options.

    Returns
    -------
    list of Labelling
        One for each animal, observer and round.
    """
    return load_labellings(args.specimens, **_which(args))


def _which(args: argparse.Namespace) -> dict[str, Any]:
    chosen = {name: getattr(args, name, None) for name in ("observer", "round")}
    return {"names": lab_names(args), **chosen}


def add_atlas(parser: argparse.ArgumentParser, *, more: str = "", default: list[str] | None = None) -> None:
    """Add ``--atlas ATLAS``: published, a file, or labelled animals.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        The parser of one command.
    more : str
        What the help adds.
    default : list of str, optional
        The value without the option.
    """
    parser.add_argument(
        "--atlas",
        nargs="+",
        default=default,
        metavar="ATLAS",
        help=f"published (default), an atlas file, or landmark files of labelled animals{more}",
    )


def add_labelling_error(parser: argparse.ArgumentParser) -> None:
    """Add ``--labelling-error FILE``.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        The parser of one command.
    """
    parser.add_argument(
        "--labelling-error",
        metavar="FILE",
        help="take the error of labels from a report of gp-core reliability (--json) instead of 0.1 mm",
    )


def labelling_error(args: argparse.Namespace) -> LabellingError | None:
    """Return the measured error of labels from ``--labelling-error``.

    Parameters
    ----------
    args : argparse.Namespace
        The parsed options.

    Returns
    -------
    LabellingError or None
        None without the option.
    """
    return None if args.labelling_error is None else LabellingError.read(args.labelling_error)


def add_json(parser: argparse.ArgumentParser) -> None:
    """Add ``--json FILE``.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        The parser of one command.
    """
    parser.add_argument("--json", metavar="FILE", help="write the full result here")


@contextmanager
def keeping_inputs(args: argparse.Namespace) -> Iterator[None]:
    """Protect the inputs of a command from its outputs, under any name, and its outputs from each other.

    Parameters
    ----------
    args : argparse.Namespace
        The parsed options.

    Yields
    ------
    None
        While the command runs.

    Raises
    ------
    GpError
        An output is an input, also one in a folder of landmark files; two outputs are the same file; or
        figures cannot be drawn here.
    """
    if getattr(args, "figure", None) is not None:
        need_extra("figures")  # before hours of work, not after them
    with protected_inputs(_files_read(args)):
        written: dict[str, str] = {}
        for name in WRITTEN:
            word = getattr(args, name, None)
            if word is None:
                continue
            path, option = os.path.realpath(word), f"--{name.replace('_', '-')}"
            if is_protected(word):
                raise GpError(f"is an input, and {option} would overwrite it", file=word, remedy=_ANOTHER)
            if path in written and not is_stream(word):
                problem = f"would be written by {written[path]} and {option}"
                raise GpError(problem, file=word, remedy=_ANOTHER)
            check_ending(word, _ENDINGS.get(name, ()), option)
            written[path] = option
        yield


def streams_of(args: argparse.Namespace) -> AbstractContextManager[None]:
    """Take ``-`` for standard input where a command reads a file, for standard output where it writes one.

    Parameters
    ----------
    args : argparse.Namespace
        The parsed options; changed while the command runs.

    Returns
    -------
    context manager
        See `gp_core.standard_streams.standard_streams`.
    """
    written = {name: endings[0] for name, endings in _ENDINGS.items()} | {"figure": ".png"}
    into_file = _OUTPUT_ENDINGS.get(args.command)
    if into_file is not None:
        written["output"] = into_file
    folders = ("checkpoint",) if into_file is not None else ("checkpoint", "output")
    return standard_streams(args, written, _READ, folders=folders)


def check_ending(word: str, endings: tuple[str, ...], option: str) -> None:
    """Reject an output file whose suffix belongs to another format.

    Parameters
    ----------
    word : str
        The file name; a name without a suffix, or a stream, passes.
    endings : tuple of str
        Permitted suffixes.
    option : str
        For the message.

    Raises
    ------
    GpError
        It ends, but in none of `endings`, if there are any; a name without an ending is taken, and a stream.
    """
    wrong = Path(word).suffix and not word.lower().endswith(endings)
    if endings and wrong and not is_stream(word):
        problem = f"{option} writes a {endings[0]} file, and this name ends in {Path(word).suffix}"
        raise GpError(problem, file=word, remedy=f"Let it end in {' or '.join(endings)}.")


def _files_read(args: argparse.Namespace) -> Iterator[str | Path]:
    """Yield every input on the command line, and the landmark files in folders."""
    for word in _words_read(args):
        yield word
        if Path(word).is_dir():
            with suppress(GpError):  # an empty folder: the command itself reports it
                yield from landmark_files(word)


def _words_read(args: argparse.Namespace) -> Iterator[str]:
    for name, value in vars(args).items():
        if name not in WRITTEN:
            values = value if isinstance(value, list) else [value]
            yield from (word for word in values if isinstance(word, str))


def read_atlas(words: list[str]) -> AtlasSource:
    """Return the atlas of ``--atlas``, or the specimens to fit it to.

    Parameters
    ----------
    words : list of str
        Values of the option.

    Returns
    -------
    AtlasSource
        The atlas, or the specimens.

    Raises
    ------
    GpError
        A file cannot be read as either.
    """
    if words == ["published"]:
        return Atlas.published(), None
    if len(words) == 1 and _names_atlas_file(words[0]):
        return Atlas.load(words[0]), None
    return None, load_specimens(words)


def _names_atlas_file(word: str) -> bool:
    """Whether a word names an atlas, by its content, or else by the name of a file that cannot be read."""
    name = word.lower()
    if Path(word).is_dir():
        return False
    if is_atlas_file(word):
        return True
    return name.endswith(".json") and not name.endswith(".mrk.json")


def save_json(path: str | None, content: Any) -> None:
    """Write a result, if ``--json`` was given.

    Parameters
    ----------
    path : str or None
        Value of the option.
    content : object
        Plain values for JSON.

    Raises
    ------
    GpError
        The file cannot be written.
    """
    if path is not None:
        write_text(path, json.dumps(content, indent=1) + "\n")


def say(text: str = "") -> None:
    """Print a line.

    Parameters
    ----------
    text : str
        The line.
    """
    sys.stdout.write(text + "\n")
