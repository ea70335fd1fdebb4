r"""Text that is safe to print: without escape sequences that could control a terminal.

Names of files, animals and landmarks come from anywhere and may hold escape sequences, which a terminal would
obey. Control characters are printed visibly instead, such as ``\x1b``.
"""

from __future__ import annotations

import io
import os
import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, TextIO

__all__ = ["leave_output", "plain_terminal", "printable", "silent_libraries"]

# C0 and C1 control characters, line separators, bidirectional controls, lone surrogates
_UNSEEN = re.compile("[\x00-\x1f\x7f-\x9f\u2028\u2029\u200e\u200f\u202a-\u202e\u2066-\u2069\ud800-\udfff]")
_KEPT = "\n\t"


def printable(text: str) -> str:
    """Return a text with control characters replaced by visible escapes; line breaks and tabs stay.

    Parameters
    ----------
    text : str
        Any text.

    Returns
    -------
    str
        Text that is safe to print.
    """
    return _UNSEEN.sub(_escaped, text)


def _escaped(match: re.Match[str]) -> str:
    character = match[0]
    if character in _KEPT:
        return character
    code = ord(character)
    if 0xDC80 <= code <= 0xDCFF:  # a byte of a name that is not UTF-8
        code -= 0xDC00
    return f"\\x{code:02x}" if code < 0x100 else f"\\u{code:04x}"


@contextmanager
def plain_terminal() -> Iterator[None]:
    """Replace control characters in everything that is written to stdout and stderr.

    Yields
    ------
    None
        While the streams are filtered.
    """
    before = sys.stdout, sys.stderr
    for stream in before:
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # a terminal that lacks a character shows a question mark
    sys.stdout, sys.stderr = (_PlainStream(stream) for stream in before)
    try:
        yield
    finally:
        sys.stdout, sys.stderr = before


def leave_output() -> None:
    """Stop writing to stdout after its reader has closed it; otherwise Python would complain on exit."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


@contextmanager
def silent_libraries() -> Iterator[None]:
    """Discard what compiled libraries print to stderr meanwhile: the caller says what is wrong, once.

    Yields
    ------
    None
        While nothing of this process reaches stderr.
    """
    try:
        before = os.dup(2)
    except OSError:  # there is no stderr, as under pythonw
        yield
        return
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 2)
        yield
    finally:
        os.dup2(before, 2)
        os.close(before)
        os.close(nowhere)


class _PlainStream:
    """A text stream that replaces control characters instead of passing them on.

    A leading carriage return is kept, so that a progress line can overwrite itself.
    """

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        start = "\r" if text.startswith("\r") else ""
        self._stream.write(start + printable(text[len(start) :]))
        return len(text)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)
