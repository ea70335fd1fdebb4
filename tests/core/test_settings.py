"""Settings: a file, variables that overrule it, and what is wrong with either in one line."""

from __future__ import annotations

import os
import re
from pathlib import Path

import pytest

from gp_core.cli import main
from gp_core.errors import GpError
from gp_core.settings import KEYS, setting, settings_file

_TOUCHES = str(Path(__file__).resolve().parents[2] / "docs" / "example" / "touches.csv")


@pytest.fixture
def file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where the settings would be; nothing is set."""
    for key in KEYS:
        monkeypatch.delenv(key.variable, raising=False)
    monkeypatch.setenv("GP_LABELER_SETTINGS", str(tmp_path / "settings.toml"))
    (tmp_path / "settings.toml").write_text("")
    return tmp_path / "settings.toml"


def test_without_a_word_in_the_file_nothing_is_set(file: Path) -> None:
    assert [setting(key.name) for key in KEYS] == [None] * len(KEYS)


def test_without_a_file_nothing_is_set(file: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.delenv("GP_LABELER_SETTINGS")
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "nothing"))
    monkeypatch.setattr("sys.platform", "linux")
    assert [setting(key.name) for key in KEYS] == [None] * len(KEYS)


def test_a_file_that_is_named_must_be_there(file: Path) -> None:
    file.unlink()
    with pytest.raises(GpError, match=r"settings\.toml: the settings cannot be read \(.*No such file"):
        setting("theme")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs a named pipe")
def test_a_pipe_or_an_endless_device_is_no_settings_file(
    file: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    os.mkfifo(tmp_path / "pipe.toml")
    for path in (str(tmp_path / "pipe.toml"), "/dev/zero", str(tmp_path)):
        monkeypatch.setenv("GP_LABELER_SETTINGS", path)
        with pytest.raises(GpError, match="is not a plain file"):
            setting("theme")


def test_the_file_says_and_the_variable_overrules(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file.write_text('workers = 3\ncanvas = "painted"\nverbose = true\n')
    assert (setting("workers"), setting("canvas"), setting("verbose")) == (3, "painted", True)
    monkeypatch.setenv("GP_LABELER_WORKERS", "5")
    monkeypatch.setenv("GP_LABELER_VERBOSE", "off")
    assert (setting("workers"), setting("verbose")) == (5, False)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("wrokers = 3", "unknown setting 'wrokers'. There are: verbose, log_file"),
        ("workers = 0", "workers must be a whole number from 1 to 4096, got 0"),
        ("workers = true", "workers must be a whole number"),
        ("workers = 2.5", "workers must be a whole number"),
        ('canvas = "vulkan"', "canvas must be one of automatic, painted, native, got 'vulkan'"),
        ('verbose = "yes"', "verbose must be true or false"),
        ("state = 3", "state must be a path"),
        ("workers = ", "the settings cannot be read"),
        ("\x00", "the settings cannot be read"),
        ("a = " + "[" * 60_000, "the settings cannot be read"),
    ],
)
def test_what_is_wrong_is_one_line_of_any_command(
    file: Path, capsys: pytest.CaptureFixture[str], text: str, words: str
) -> None:
    file.write_text(text)
    with pytest.raises(SystemExit) as stopped:
        main(["estimate", _TOUCHES, "--side", "L"])
    said = capsys.readouterr().err
    assert stopped.value.code == 2
    assert said.count("\n") == 1
    assert f"{file}: {words}" in said


@pytest.mark.parametrize(("name", "value"), [("WORKERS", "many"), ("CANVAS", "x"), ("TEXT_SIZE", "1000")])
def test_a_wrong_variable_is_named(
    file: Path, monkeypatch: pytest.MonkeyPatch, name: str, value: str
) -> None:
    monkeypatch.setenv(f"GP_LABELER_{name}", value)
    with pytest.raises(GpError, match=f"the variable GP_LABELER_{name} must be "):
        setting(name.lower())


def test_the_file_is_in_the_users_folder(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.delenv("GP_LABELER_SETTINGS", raising=False)
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    monkeypatch.setattr("sys.platform", "linux")
    assert settings_file() == tmp_path / "gp-labeler" / "settings.toml"


def test_every_setting_is_documented() -> None:
    page = (Path(__file__).resolve().parents[2] / "docs" / "settings.md").read_text(encoding="utf-8")
    for key in KEYS:
        assert f"| `{key.name}` | `{key.variable}` |" in page


def test_every_setting_is_read_somewhere() -> None:
    root = Path(__file__).resolve().parents[2]
    files = [path for package in ("gp_core", "gp_labeler") for path in (root / package).rglob("*.py")]
    read = {name for path in files for name in re.findall(r'\bsetting\("(\w+)"\)', path.read_text("utf-8"))}
    assert read == {key.name for key in KEYS}
