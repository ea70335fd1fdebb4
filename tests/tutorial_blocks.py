"""Run the code blocks of a page as a reader would, one after the other, in an empty folder.

``console``: what follows ``$`` is run, and must print what stands below it (``...`` is anything); where that
is the line of an error, such as ``gp-core: …``, it must end with status 2; after ``; echo $?`` its status is
shown. ``python`` with prompts is a doctest. A block whose first line is ``# name.ext`` is saved as that file.
"""

from __future__ import annotations

import contextlib
import doctest
import io
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import gp_core.cli

_BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
_FLAGS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE


def run_page(page: Path) -> int:
    """Run all blocks of a page in the present folder; return how many commands and examples there were."""
    names: dict[str, object] = {}
    count = 0
    for language, block in _BLOCK.findall(page.read_text(encoding="utf-8")):
        if language == "console":
            for command, expected in _commands(block):
                command, asks, _ = command.partition("; echo $?")
                status = _status(expected, is_shown=bool(asks))
                printed = _run(command, status=status) + (f"{status}\n" if asks else "")
                _check(page, command, expected, printed)
                count += 1
        elif language == "python":
            test = doctest.DocTestParser().get_doctest(block, names, page.name, str(page), 0)
            told = io.StringIO()
            assert test.examples, f"{page.name}: a python block without prompts is not run"
            result = doctest.DocTestRunner(optionflags=_FLAGS).run(test, out=told.write, clear_globs=False)
            assert result.failed == 0, told.getvalue()
            names.update(test.globs)
            count += len(test.examples)
        elif named := re.match(r"# (\S+\.\w+)\n", block):
            Path(named[1]).write_text(block[named.end() :], encoding="utf-8")
    return count


def _commands(block: str) -> Iterator[tuple[str, str]]:
    for part in re.split(r"^\$ ", block, flags=re.MULTILINE)[1:]:
        command, _, expected = part.partition("\n")
        yield command, expected


def _status(expected: str, *, is_shown: bool) -> int:
    """Return the status with which a command must end: the last line where it is shown, 2 for an error."""
    if is_shown:
        return int(expected.split()[-1])
    return 2 if expected.startswith(("gp-labeler: ", "gp-core: ")) else 0


def _run(command: str, *, status: int) -> str:
    """Run a command, that of the core in this process, and return what it prints."""
    program, *words = shlex.split(command)
    if program == "gp-labeler":  # the window has a process of its own
        command_line = [sys.executable, "-m", "gp_labeler", *words]
        done = subprocess.run(command_line, capture_output=True, text=True, check=False)
        assert done.returncode == status, f"{command}: {done.stderr}{done.stdout}"
        return done.stdout + (done.stderr if status else "")
    assert program == "gp-core", f"{command}: no program of ours"
    told = io.StringIO()
    with contextlib.redirect_stdout(told), contextlib.redirect_stderr(told):
        found = gp_core.cli.main(words)
    assert found == status, f"{command}: status {found}"
    return told.getvalue()


def _check(page: Path, command: str, expected: str, printed: str) -> None:
    wanted = expected or "...\n"
    if not doctest.OutputChecker().check_output(wanted, printed, _FLAGS):
        raise AssertionError(f"{page.name}: {command}\nsays:\n{printed}\nnot:\n{expected}")
