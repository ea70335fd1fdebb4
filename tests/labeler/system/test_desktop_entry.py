"""gp-labeler on a desktop: the entry, its icon and its files, and their removal."""

from __future__ import annotations

import configparser
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest

from gp_core.errors import GpError
from gp_labeler.cli.entry import main
from gp_labeler.system.desktop_entry import desktop_file, install_desktop


@pytest.fixture
def data(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The user's folder for such files."""
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "share"))
    return tmp_path / "share"


def _command() -> str:
    parsed = configparser.ConfigParser(interpolation=None)
    parsed.optionxform = str  # type: ignore[assignment]
    parsed.read_string(desktop_file())
    return parsed["Desktop Entry"]["Exec"]


def test_it_is_installed_twice_and_removed(data: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--install-desktop"]) == 0
    assert main(["--install-desktop"]) == 0
    told = capsys.readouterr().out
    written = [data / "applications/gp-labeler.desktop", data / "mime/packages/gp-labeler.xml"]
    icon = data / "icons/hicolor/scalable/apps/gp-labeler.svg"
    for path in (*written, icon):
        assert path.is_file()
        assert told.count(f"wrote {path}") == 2
    ElementTree.parse(icon)
    globs = [glob.get("pattern") for glob in ElementTree.parse(written[1]).iterfind(".//{*}glob")]
    assert globs == ["*.gpspecimen.json", "*.nrrd", "*.nhdr"]
    assert main(["--remove-desktop"]) == 0
    assert not any(path.exists() for path in (*written, icon))


def test_the_entry_starts_this_installation() -> None:
    assert shlex.split(_command()) == [sys.executable, "-m", "gp_labeler", "%f"]


@pytest.mark.parametrize("folder", ["/opt/my tools", '/a"b', "/50%", "/c$d`e", "/back\\slash"])
def test_odd_paths_are_quoted(folder: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "executable", f"{folder}/python")
    value = _command().replace("\\\\", "\\")  # as a reader of the file undoes its escapes
    words = [re.sub(r"\\([$`])", r"\1", word) for word in shlex.split(value)]  # shlex leaves them
    assert [word.replace("%%", "%") for word in words] == [f"{folder}/python", "-m", "gp_labeler", "%f"]


def test_a_frozen_program_starts_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "frozen", True, raising=False)
    monkeypatch.setattr(sys, "executable", "/opt/gp-labeler/gp-labeler")
    assert _command() == "/opt/gp-labeler/gp-labeler %f"


def test_the_checker_of_desktop_entries_finds_nothing(data: Path) -> None:
    checker = shutil.which("desktop-file-validate")
    if checker is None:
        pytest.skip("no desktop-file-validate")
    entry = next(path for path in install_desktop() if path.suffix == ".desktop")
    done = subprocess.run([checker, str(entry)], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (0, "")


def test_other_systems_are_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "platform", "win32")
    with pytest.raises(GpError, match="only on Linux"):
        install_desktop()
