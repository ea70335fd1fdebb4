"""Every command on the README and the pages of docs/ is understood, and runs as printed.

What a page shows with a prompt in a tutorial or a how-to page is run by test_tutorials, with what it prints.
Commands that take more than ten seconds run if GP_LONG_PAGES is set: tools/gate-long pages does.
"""

from __future__ import annotations

import contextlib
import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from page_cases import DOCS, PAGES, TUTORIALS, make_animals, make_scans, make_small_heads, make_stacks

from gp_core.cli import main as core
from gp_core.cli.entry import make_parser as core_parser
from gp_labeler.cli.entry import main as labeler
from gp_labeler.cli.entry import make_parser as labeler_parser
from gp_labeler.cli.subcommands import SUBCOMMANDS

_CODE = re.compile(r"^```(console)?\n(.*?)^```$|^ {4,}(\S[^\n]*)$", re.MULTILINE | re.DOTALL)
_COMMAND = re.compile(r"^(?:\$ )?(gp-(?:core|labeler) .+)$", re.MULTILINE)
_STREAMS = set("|<>")

_MARKED = re.compile(r"<!-- not run: (gp-\w+ .+?): .+? -->")
"""A command that a page says is not run by the tests, and why."""

_LONG = re.compile(r"--offscreen demo|phantom .*(--varied|--seeds|--seed 7)|--specimens GP-01 GP-02 GP-03")
"""Commands that take more than ten seconds."""

_INPUTS: dict[str, Callable[[Path], None]] = {
    "check-library": make_small_heads,
    "propose": make_small_heads,
    "window": make_stacks,
    "gp-core": make_animals,
    "gp-labeler": make_scans,
}


def _commands() -> list[tuple[str, str]]:
    """Return the page and the text of every command, without those that test_tutorials runs."""
    text = [(page.stem, _shown(page)) for page in (*PAGES, *TUTORIALS)]
    return sorted({(name, line) for name, page in text for line in _lines_of(page)})


def _shown(page: Path) -> str:
    run_whole = page.parent.name in ("howto", "tutorials")
    text = page.read_text(encoding="utf-8")
    return re.sub(r"^```console\n.*?^```$", "", text, flags=re.MULTILINE | re.DOTALL) if run_whole else text


def _lines_of(page: str) -> list[str]:
    """Return what is typed of each line: no output, no remark beside it."""
    shown = (block or line for _, block, line in _CODE.findall(page))
    return [re.split(r"  +|\s#\s", line)[0] for code in shown for line in _COMMAND.findall(code)]


@pytest.mark.parametrize(("page", "line"), _commands())
def test_every_command_line_is_understood(page: str, line: str, tmp_path: Path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    for part in line.replace("`", "").split("|"):
        program, *words = shlex.split(re.sub(r"[<>] *\S+", "", part))
        if program not in ("gp-core", "gp-labeler"):
            continue
        with contextlib.suppress(_CompletedError):
            _parse(program, words)
    assert "error" not in capsys.readouterr().err


class _CompletedError(Exception):
    """A command line that only prints something was understood."""


def _parse(program: str, words: list[str]) -> None:
    parser = core_parser() if program == "gp-core" else labeler_parser()
    if program == "gp-labeler" and words and words[0] in SUBCOMMANDS:
        parser, words = SUBCOMMANDS[words[0]].parser(), words[1:]
    try:
        parser.parse_args(words)
    except SystemExit as ended:
        if ended.code == 0:
            raise _CompletedError from None
        raise AssertionError(f"{program} {' '.join(words)} is not understood") from None


# They run


def _kind(line: str) -> str:
    """Return what a command needs: the key of its inputs, or ``stream`` for one that a shell must run."""
    program, *words = shlex.split(line)
    if _STREAMS & set(line):
        return "stream"
    if program == "gp-labeler" and words[0] not in SUBCOMMANDS and not words[0].startswith("-"):
        return "window"
    return words[0] if words[0] in _INPUTS else program


def _rows(*kinds: str) -> list[tuple[str, str]]:
    """Return the commands of these kinds that no page marks."""
    texts = [page.read_text(encoding="utf-8") for page in (*PAGES, *TUTORIALS)]
    marked = {line for text in texts for line in _MARKED.findall(text)}
    return [row for row in _commands() if row[1] not in marked and _kind(row[1]) in kinds]


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """Make what a kind of command needs, once."""
    made: dict[Callable[[Path], None], Path] = {}

    def get(kind: str) -> Path:
        make = _INPUTS[kind]
        if make not in made:
            folder = tmp_path_factory.mktemp(kind)
            make(folder)
            made[make] = folder
        return made[make]

    return get


@pytest.fixture
def work(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder to work in, and an account without files."""
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    (tmp_path / "home" / ".local/share/bash-completion/completions").mkdir(parents=True)
    (tmp_path / "work").mkdir()
    monkeypatch.chdir(tmp_path / "work")
    return tmp_path / "work"


def _bring(given: Path, work: Path, line: str) -> None:
    """Put what a command reads into the folder; what it writes is not there yet."""
    written = re.findall(r"(?:-o|--output|--json|--csv) (\S+)", line)
    for path in given.iterdir():
        if path.name not in [Path(name).name for name in written]:
            (shutil.copytree if path.is_dir() else shutil.copy)(path, work / path.name)


@pytest.mark.slow
@pytest.mark.parametrize(("page", "line"), _rows("check-library", "propose", "gp-core", "gp-labeler"))
def test_every_command_runs(page: str, line: str, inputs, work, capsys) -> None:
    if _LONG.search(line) and not os.environ.get("GP_LONG_PAGES"):
        pytest.skip("more than ten seconds: tools/gate-long pages runs it")
    _bring(inputs(_kind(line)), work, line)
    if "--csv touches.csv" not in line:
        shutil.copy(DOCS / "example" / "touches.csv", work)
    program, *words = shlex.split(line)
    given = [name for word in words for name in _as_the_shell_gives(word)]
    status = (core if program == "gp-core" else labeler)(given)
    assert status in ((0, 1) if words[0] == "check" else (0,)), capsys.readouterr().err


def _as_the_shell_gives(word: str) -> list[str]:
    return sorted(map(str, Path().glob(word))) if "*" in word else [word]


_PROGRAMS = "; ".join(
    f'{name}() {{ {shlex.quote(sys.executable)} -m {module} "$@"; }}'
    for name, module in (("gp-core", "gp_core.cli"), ("gp-labeler", "gp_labeler"))
)


@pytest.mark.slow
@pytest.mark.parametrize(("page", "line"), _rows("stream"))
def test_every_pipeline_runs(page: str, line: str, work) -> None:
    if (shell := shutil.which("bash")) is None or ("jq" in line and shutil.which("jq") is None):
        pytest.skip("no bash, or no jq")
    shutil.copy(DOCS / "example" / "touches.csv", work)
    command = [shell, "-c", f"set -euo pipefail; {_PROGRAMS}; {line}"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    _, _, written = line.partition("> ")
    assert done.stdout if not written else Path(written).expanduser().stat().st_size


_WINDOW = """
import sys
from qtpy.QtCore import QTimer
from qtpy.QtWidgets import QApplication
from gp_labeler.cli.entry import main
from gp_labeler.views.main_window import MainWindow

def close_once_open(window):
    question = QApplication.activeModalWidget()
    if question:
        print("asks:", question.windowTitle())
        question.reject()
    elif window.workspace.scan.volume:
        print("opened:", window.workspace.scan.volume.name)
    else:
        QTimer.singleShot(100, lambda: close_once_open(window))
        return
    QTimer.singleShot(0, window.close)

show = MainWindow.show
MainWindow.show = lambda window: (show(window), close_once_open(window))
sys.exit(main(sys.argv[1:]))
"""
"""The program as it is started, which closes its window once a scan is open, or once it asks something."""


@pytest.mark.slow
@pytest.mark.parametrize(("page", "line"), _rows("window"))
def test_every_window_opens(page: str, line: str, inputs, work) -> None:
    _bring(inputs("window"), work, line)
    words = [sys.executable, "-c", _WINDOW, *shlex.split(line)[1:], "--state", "state"]
    environment = {**os.environ, "QT_QPA_PLATFORM": "offscreen"}
    done = subprocess.run(words, capture_output=True, text=True, check=False, env=environment)
    assert (done.returncode, done.stderr) == (0, "")
    asks = ".tif" in line  # which does not state the distance of its slices
    assert done.stdout.startswith("asks: " if asks else "opened: ")
