"""The argument parser of all commands: errors are one line, messages go where they are wanted."""

from __future__ import annotations

import argparse
import importlib
import logging
import platform
import re
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NoReturn

from gp_core.disk import read_head
from gp_core.errors import GpError
from gp_core.extras import missing_package
from gp_core.settings import check_settings, setting
from gp_core.terminal import printable

__all__ = ["CommandParser", "add_completion", "start_messages"]

_PACKAGES = ("gp_core", "gp_labeler")
_LOG_FILE = "gp-labeler log file"
_LOG_HEAD = 30
_LOG_LINE = re.compile(rb"\d{4}-\d\d-\d\d \d\d:\d\d:\d\d,\d{3} ")
_FILE_FORMAT = "%(asctime)s %(levelname)s %(name)s: %(message)s"


class CommandParser(argparse.ArgumentParser):
    """A parser that reports errors in one line with status 2; its subcommands do the same.

    Each has the options ``--verbose`` and ``--log-file``, which take effect once a command line is parsed.
    """

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        messages = self.add_argument_group("messages")
        messages.add_argument(
            "--verbose",
            action="store_true",
            default=argparse.SUPPRESS,
            help="print the files that are read and written",
        )
        messages.add_argument(
            "--log-file",
            metavar="FILE",
            default=argparse.SUPPRESS,
            help="append all messages, with time stamps, to this file",
        )

    def parse_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Parse a command line, and begin to pass on messages as it says.

        Parameters
        ----------
        args : sequence of str, optional
            By default those of the process.
        namespace : argparse.Namespace, optional
            Where values go.

        Returns
        -------
        argparse.Namespace
            The values, without those of the messages.
        """
        given = list(sys.argv[1:] if args is None else args)
        parsed = super().parse_args(given, namespace)
        values = vars(parsed)
        try:
            check_settings()
            verbose = values.pop("verbose", None) or setting("verbose")
            start_messages(self.prog, given, verbose, values.pop("log_file", None) or setting("log_file"))
        except GpError as error:
            self.error(str(error).rstrip("."))
        return parsed

    def error(self, message: str) -> NoReturn:
        """Report what is wrong and where to find help, then exit with status 2.

        Parameters
        ----------
        message : str
            What argparse found.
        """
        text = printable(" ".join(message.split()))
        self.exit(2, f"{self.prog.split()[0]}: {text}. See {self.prog} --help.\n")


class _PrintCompletion(argparse.Action):
    """Print the completion script of a shell, then exit."""

    def __init__(self, *args: Any, whole: Callable[[], argparse.ArgumentParser] | None, **rest: Any) -> None:
        super().__init__(*args, **{**rest, "default": argparse.SUPPRESS})
        self._whole = whole

    def __call__(
        self, parser: argparse.ArgumentParser, namespace: argparse.Namespace, values: Any, option: Any = None
    ) -> None:
        try:
            complete = importlib.import_module("shtab").complete
        except ModuleNotFoundError:
            parser.error(str(missing_package("shtab")))
        script: str = complete(self._whole() if self._whole else parser, shell=values)
        sys.stdout.write(script.replace("complete -o filenames", "complete -o default -o filenames"))
        parser.exit(0)


def add_completion(
    parser: argparse.ArgumentParser, whole: Callable[[], argparse.ArgumentParser] | None = None
) -> None:
    """Add ``--print-completion SHELL``.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        The parser of a program.
    whole : callable, optional
        Returns the parser that knows all of its commands, where `parser` does not.
    """
    parser.add_argument(
        "--print-completion",
        action=_PrintCompletion,
        whole=whole,
        choices=("bash", "zsh", "tcsh"),
        help="print the completion script for this shell, then exit",
    )


def start_messages(prog: str, words: Sequence[str], verbose: bool | None, log_file: str | None) -> None:
    """Pass on the messages of both packages: warnings to the terminal, all of them where asked.

    Parameters
    ----------
    prog : str
        What the command is called.
    words : sequence of str
        Its command line, for the log.
    verbose : bool or None
        Whether the terminal also gets what is read and written.
    log_file : str or None
        A file to append everything to.

    Raises
    ------
    GpError
        The file cannot be written.
    """
    command = prog.split()[0]
    of_a_caller = list(logging.getLogger().handlers)
    logging.basicConfig(level=logging.WARNING)
    for handler in logging.getLogger().handlers:
        if handler not in of_a_caller:
            handler.addFilter(_is_ours)
            handler.setFormatter(_OneLine(f"{command}: %(message)s"))
        if type(handler) is logging.StreamHandler:  # the terminal's, not what a caller has set up
            handler.setLevel(logging.DEBUG if verbose else logging.WARNING)
    ours = [logging.getLogger(package) for package in _PACKAGES]
    for logger in ours:
        logger.setLevel(logging.DEBUG if log_file or verbose else logging.NOTSET)
        for handler in [h for h in logger.handlers if h.name == _LOG_FILE]:  # an earlier command's
            logger.removeHandler(handler)
            handler.close()
    if log_file:
        written = _file_handler(log_file)
        for logger in ours:
            logger.addHandler(written)
        ours[0].debug(
            "%s %s, Python %s, %s: %s %s",
            command,
            getattr(sys.modules.get("gp_core"), "__version__", ""),
            platform.python_version(),
            platform.platform(),
            prog,
            " ".join(words),
        )


class _OneLine(logging.Formatter):
    """One line a message, also if the name of a file has a line break."""

    def formatMessage(self, record: logging.LogRecord) -> str:  # noqa: N802 - overrides logging's
        """Show line breaks as they are written in Python."""
        return super().formatMessage(record).replace("\n", "\\n")


def _is_ours(record: logging.LogRecord) -> bool:
    """Whether a message is for people: libraries speak of their own insides, such as of a broken TIFF."""
    return record.name.partition(".")[0] in _PACKAGES


class _LogFile(logging.FileHandler):
    """A log that ends with one line on stderr where it cannot be written any more, as on a full disk."""

    def handleError(self, record: logging.LogRecord) -> None:  # noqa: N802 - overrides logging's
        """Say why once; the command goes on without the log."""
        if self.level <= logging.CRITICAL:
            self.setLevel(logging.CRITICAL + 1)
            reason = getattr(sys.exc_info()[1], "strerror", None) or "an error"
            sys.stderr.write(f"{printable(self.baseFilename)}: the log is cut off here ({reason})\n")


def _file_handler(path: str) -> logging.Handler:
    if not path.endswith(".log") and not path.startswith("/dev/"):  # nothing that is data is appended to
        raise GpError("the name of a log ends in .log", file=path, remedy="Name another file.")
    if Path(path).is_fifo():  # it would wait for a reader
        raise GpError("the log cannot be a pipe", file=path, remedy="Name another file.")
    head = read_head(path, _LOG_HEAD)
    if head and not _LOG_LINE.match(head):  # such as the log of a scanner, which belongs to its scan
        raise GpError("is no log of this program", file=path, remedy="Name another file.")
    try:
        handler = _LogFile(path, encoding="utf-8", errors="backslashreplace")
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise GpError(f"the log cannot be written ({reason})", file=path) from None
    handler.name = _LOG_FILE
    handler.setFormatter(logging.Formatter(_FILE_FORMAT))
    return handler
