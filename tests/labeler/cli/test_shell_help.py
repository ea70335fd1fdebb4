"""What shells know of the commands, made from their parsers: completion and manual pages."""

from __future__ import annotations

import runpy
import shutil
import subprocess
from pathlib import Path

import pytest

from gp_core.cli import main as core
from gp_labeler.cli.entry import main as labeler
from gp_labeler.cli.subcommands import SUBCOMMANDS

_TOOL = Path(__file__).resolve().parents[3] / "tools" / "manual-pages"


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("man1")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("sys.argv", ["manual-pages", str(folder)])
        with pytest.raises(SystemExit) as ended:
            runpy.run_path(str(_TOOL), run_name="__main__")
    assert ended.value.code == 0
    return folder


def test_every_command_has_a_page_with_all_options(pages: Path) -> None:
    names = {path.name for path in pages.iterdir()}
    assert {f"gp-labeler-{name}.1" for name in SUBCOMMANDS} <= names
    assert {"gp-labeler.1", "gp-core.1", "gp-core-estimate.1", "gp-core-conditions.1"} <= names
    estimate = (pages / "gp-core-estimate.1").read_text()
    for option in ("--side", "--shared-error", "--json", "--verbose"):
        assert option.replace("-", "\\-") in estimate
    assert "gp\\-core\\-estimate \\- Estimate the pose" in estimate


def test_the_formatter_of_pages_finds_nothing_wrong(pages: Path) -> None:
    groff = shutil.which("groff")
    if groff is None:
        pytest.skip("no groff")
    files = sorted(map(str, pages.iterdir()))
    done = subprocess.run([groff, "-man", "-ww", "-z", *files], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize(
    ("program", "line", "words"),
    [
        ("gp-core", "gp-core est", {"estimate"}),
        ("gp-core", "gp-core estimate --met", {"--method"}),
        ("gp-core", "gp-core simulate --method ", {"robust", "jrmpc"}),
        ("gp-labeler", "gp-labeler do", {"doctor"}),
        ("gp-labeler", "gp-labeler --off", {"--offscreen"}),
        ("gp-labeler", "gp-labeler mesh --thr", {"--threshold"}),
    ],
)
def test_bash_completes(
    program: str, line: str, words: set[str], capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    bash = shutil.which("bash")
    if bash is None:
        pytest.skip("no bash")
    with pytest.raises(SystemExit):
        (core if program == "gp-core" else labeler)(["--print-completion", "bash"])
    script = tmp_path / "completion"
    script.write_text(capsys.readouterr().out)
    ask = (
        f'source {script}; read -ra COMP_WORDS <<< "$1"; [[ "$1" == *" " ]] && COMP_WORDS+=("")\n'
        "COMP_CWORD=$((${#COMP_WORDS[@]} - 1)); COMPREPLY=()\n"
        'function=$(complete -p "${COMP_WORDS[0]}" | sed "s/.*-F \\([^ ]*\\).*/\\1/")\n'
        '"$function" "${COMP_WORDS[0]}" "${COMP_WORDS[COMP_CWORD]}"; printf "%s\\n" "${COMPREPLY[@]}"'
    )
    done = subprocess.run([bash, "-c", ask, "ask", line], capture_output=True, text=True, check=False)
    assert words <= set(done.stdout.split()), done.stderr
