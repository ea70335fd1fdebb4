"""A state directory that is full or may only be read: recovery is offered, a folder stands in."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from gp_core.errors import GpError
from gp_labeler.document import state_directory
from gp_labeler.document.lock import FileLock
from gp_labeler.document.opening import new_specimen, recover_specimen
from gp_labeler.document.recovery import find_recoveries
from gp_labeler.document.specimen_document import SpecimenDocument
from gp_labeler.document.specimen_edits import SetNotes
from gp_labeler.document.state_directory import fallback_directory, write_problem
from gp_labeler.views.state_question import directory_to_use


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """Return a file system of one megabyte."""
    disk = tmp_path / "disk"
    disk.mkdir()
    words = ["mount", "-t", "tmpfs", "-o", "size=1m", "tmpfs", str(disk)]
    if os.geteuid() != 0 or subprocess.run(words, capture_output=True, check=False).returncode:
        pytest.skip("only root may mount a small disk")
    yield disk
    subprocess.run(["umount", "-l", str(disk)], check=True)


def fill(disk: Path) -> Path:
    rest = disk / "rest"
    with rest.open("wb", buffering=0) as file:
        try:
            while True:
                file.write(bytes(4096))
        except OSError:
            pass
    return rest


def left_unsaved(directory: Path, notes: str) -> None:
    """Let a program be killed after an edit."""
    document = SpecimenDocument(new_specimen(directory, specimen="GP-014"))
    document.do(SetNotes(notes))
    document.close()  # dirty: the journal stays, as after a kill


@pytest.fixture(params=["full", "read only"])
def shut(request: pytest.FixtureRequest, small_disk: Path) -> Path:
    """Return a state directory with an unsaved edit, which cannot be written any more."""
    left_unsaved(small_disk, "not lost")
    if request.param == "full":
        fill(small_disk)
    else:
        subprocess.run(["mount", "-o", "remount,ro", str(small_disk)], check=True)
    return small_disk


def test_what_was_left_is_offered_where_nothing_can_be_written(shut: Path, tmp_path: Path) -> None:
    (recovery,) = find_recoveries(shut)
    assert recovery.state.notes == "not lost"
    for directory in (tmp_path / "elsewhere", None):
        again = SpecimenDocument(recover_specimen(recovery, directory))
        again.do(SetNotes("goes on"))
        again.save(tmp_path / f"saved-{directory is None}")
        again.close()
    assert recovery.journal.exists()


def test_a_full_disk_refuses_in_a_line(shut: Path) -> None:
    assert write_problem(shut)
    with pytest.raises(GpError, match=r"No space left|[Rr]ead-only"):
        SpecimenDocument(new_specimen(shut))


def test_space_that_is_freed_is_used(small_disk: Path) -> None:
    rest = fill(small_disk)
    assert "No space left" in write_problem(small_disk)
    rest.unlink()
    assert write_problem(small_disk) == ""
    SpecimenDocument(new_specimen(small_disk)).close()
    assert [file for file in small_disk.rglob("*") if file.is_file()] == []


def test_a_lock_file_that_cannot_be_written_still_locks(small_disk: Path) -> None:
    path = small_disk / "a.lock"
    path.touch()
    fill(small_disk)
    lock = FileLock(path, "it")
    with pytest.raises(GpError, match="is open in another window"):
        FileLock(path, "it")
    lock.release()
    FileLock(path, "it").release()


class Answers:
    """Someone who answers in place of the user."""

    def __init__(self, answer: str, folder: Path | None = None) -> None:
        self.answer, self.chosen, self.asked = answer, folder, []

    def choose(self, title, text, answers, **_):
        self.asked.append((text, answers))
        return next((each for each in answers if each.startswith(self.answer)), "")

    def folder(self, title, *, start):
        return self.chosen


def test_a_folder_stands_in_as_the_user_says(shut: Path, tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(state_directory.tempfile, "gettempdir", lambda: str(tmp_path / "temporary"))
    fallback = fallback_directory()
    for answer, expected in (
        ("Use", fallback),
        ("", fallback),
        ("Work", None),
        ("Choose", tmp_path / "mine"),
    ):
        prompts = Answers(answer, tmp_path / "mine")
        assert directory_to_use(shut, prompts) == expected
        ((text, answers),) = prompts.asked
        assert str(shut) in text
        assert answers == [f"Use {fallback}", "Choose a folder…", "Work without"]


def test_nobody_is_asked_where_all_is_well(tmp_path: Path) -> None:
    prompts = Answers("")
    assert directory_to_use(tmp_path / "new", prompts) == tmp_path / "new"
    assert prompts.asked == []
