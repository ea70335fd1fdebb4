"""What is confirmed is on the disk, exactly, whatever happens next."""

from __future__ import annotations

import contextlib
import errno
import json
import os
import tempfile
from pathlib import Path

import pytest
from document_cases import MARK, FakeVolume, edits, json_values, quick, shape, text_of
from hypothesis import given
from hypothesis import strategies as st

from gp_core.errors import FileFormatError, GpError
from gp_core.landmarks.features import Side
from gp_labeler.document import journal as journal_module
from gp_labeler.document.edits import PlacePoint
from gp_labeler.document.journal import Journal, base_line, read_journal, record_line
from gp_labeler.document.json_changes import difference, dumped, patched
from gp_labeler.document.landmark_import import ImportLandmarks
from gp_labeler.document.lock import FileLock, InUseError
from gp_labeler.document.opening import UnsavedEditsError, new_specimen, open_specimen, recover_specimen
from gp_labeler.document.recovery import find_recoveries, replayed
from gp_labeler.document.specimen_document import SpecimenDocument
from gp_labeler.document.specimen_edits import SetNotes, SetThreshold
from gp_labeler.document.specimen_json import document_of, state_of

L = Side.LEFT
documents = st.dictionaries(st.text(max_size=2), json_values, max_size=4)
actions = st.lists(edits | st.sampled_from(("undo", "undo", "redo", "save", "volume")), max_size=25)


def act(document, sequence, folder):
    for action in sequence:
        try:
            if action == "save":
                document.save(folder / "specimen", overwrite=True)
            elif action == "volume":
                document.attach_volume(
                    FakeVolume(checksum=str(len(document.state.landmarks))), accept_changes=True
                )
            elif action in ("undo", "redo"):
                getattr(document, action)()
            else:
                document.do(action, merge=True)
        except GpError:
            continue


def abandon(document):
    """Let go of the lock without tidying up, as a killed program does."""
    document.store.close(keep_journal=True)


@quick
@given(documents, documents)
def test_changes_lead_from_one_document_to_the_other(old, new):
    before = dumped(old)
    result = patched(old, json.loads(dumped(difference(old, new))))
    assert {k: dumped(v) for k, v in _flat(result)} == {k: dumped(v) for k, v in _flat(new)}
    assert dumped(old) == before
    assert difference(new, new) == {"set": [], "drop": []}


@pytest.mark.parametrize(("old", "new"), [(0.0, -0.0), (1, 1.0), (True, 1), ([0.0], [-0.0])])
def test_what_is_written_otherwise_is_another_value(old, new):
    assert difference({"a": old}, {"a": new})["set"] == [[["a"], new]]


def _flat(value, path=()):
    """Dicts by path, so that their order does not count; empty ones count as themselves."""
    if isinstance(value, dict) and value:
        for key, item in value.items():
            yield from _flat(item, (*path, key))
    else:
        yield path, value


@quick
@given(actions)
def test_replaying_the_journal_gives_the_last_state_and_its_undo(sequence):
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        document = SpecimenDocument(new_specimen(folder / "state"))
        with contextlib.ExitStack() as stack:
            stack.callback(abandon, document)
            act(document, sequence, folder)
        expected, was_dirty = document.state, document.dirty
        found = find_recoveries(folder / "state")
        if not found:
            assert not was_dirty or expected.landmarks == {}
            return
        again = SpecimenDocument(recover_specimen(found[0], folder / "state"))
        with contextlib.ExitStack() as stack:
            stack.callback(again.close, discard=True)
            assert text_of(again.state) == text_of(expected)
            while document.history.to_undo and again.history.to_undo:
                assert again.history.undo().text == document.history.undo().text
                assert text_of(again.state) == text_of(document.state)


@quick
@given(st.lists(edits, max_size=15), st.data())
def test_a_torn_or_damaged_line_costs_only_itself(sequence, data):
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        document = SpecimenDocument(new_specimen(folder), clock=lambda: "now")
        states = [text_of(document.state)]
        with contextlib.ExitStack() as stack:
            stack.callback(abandon, document)
            for edit in sequence:
                act(document, [edit], folder)
                states.append(text_of(document.state))
        (path,) = (folder / "journals").glob("*.jsonl")
        content = path.read_bytes()
        header = content.index(b"\n") + 1
        at = data.draw(st.integers(header, len(content)))
        flip = data.draw(st.booleans())
        damaged = content[:at] + (
            bytes([content[at] ^ 1]) + content[at + 1 :] if flip and at < len(content) else b""
        )
        original = read_journal(path)
        path.write_bytes(damaged)
        read = read_journal(path)
        n_whole = content[:at].count(b"\n") - 1
        if flip and at < len(content):
            assert read.entries[:n_whole] == original.entries[:n_whole]
            assert len(read.entries) < len(original.entries)
            assert "cannot be read: the file is damaged" in read.damage
            assert state_of(read.document)
        else:
            assert (len(read.entries), read.damage) == (n_whole, "")
            assert text_of(state_of(read.document)) in states
            assert path.read_bytes()[: read.n_bytes] == content[: read.n_bytes]


@pytest.mark.parametrize("line", [0, 1, 3, 5])
def test_one_flipped_bit_costs_one_edit_and_a_copy_of_the_file_is_kept(line, tmp_path):
    document = SpecimenDocument(new_specimen(tmp_path, specimen="GP-014"))
    codes = ("CA", "CB", "OS", "RWA", "RWP")
    for i, code in enumerate(codes):
        document.do(PlacePoint(L, code, (i, 2 * i, 3), MARK))
    abandon(document)
    (path,) = (tmp_path / "journals").glob("*.jsonl")
    lines = path.read_bytes().splitlines(keepends=True)
    middle = len(lines[line]) // 2
    lines[line] = lines[line][:middle] + bytes([lines[line][middle] ^ 4]) + lines[line][middle + 1 :]
    path.write_bytes(damaged := b"".join(lines))

    (recovery,) = find_recoveries(tmp_path)
    assert "1 edit in" in recovery.text
    again = SpecimenDocument(recover_specimen(recovery, tmp_path))
    kept = {code for n, code in enumerate(codes, start=1) if n != line}
    assert {code for code in codes if (L, code) in again.state.landmarks} == kept
    (copy,) = (tmp_path / "journals").glob("*.damaged")
    assert copy.read_bytes() == damaged

    again.do(SetNotes("goes on"))
    abandon(again)
    (recovery,) = find_recoveries(tmp_path)
    assert recovery.content.damage == ""
    assert recovery.state.notes == "goes on"
    assert {code for code in codes if (L, code) in recovery.state.landmarks} == kept


def test_edits_go_on_behind_a_torn_line(tmp_path):
    document = SpecimenDocument(new_specimen(tmp_path))
    document.do(SetNotes("one"))
    abandon(document)
    (path,) = (tmp_path / "journals").glob("*.jsonl")
    with path.open("ab") as file:
        file.write(b'{"record":{"kind":"edit","n":2,"text":"a very long line that was torn ' + b"x" * 500)
    (recovery,) = find_recoveries(tmp_path)
    again = SpecimenDocument(recover_specimen(recovery, tmp_path))
    assert again.state.notes == "one"
    again.do(SetNotes("two"))
    abandon(again)
    (recovery,) = find_recoveries(tmp_path)
    assert recovery.state.notes == "two"
    assert [entry.text for entry in recovery.content.entries] == ["edit notes", "edit notes"]


def test_a_full_disk_refuses_the_edit_and_keeps_the_journal(tmp_path, monkeypatch):
    document = SpecimenDocument(new_specimen(tmp_path))
    document.do(SetNotes("kept"))
    heard = []
    document.history_changed.connect(lambda: heard.append(1))

    def full(handle):
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(journal_module.os, "fsync", full)
        with pytest.raises(GpError, match=r"cannot be stored safely: No space left.*It was not made"):
            document.do(SetNotes("lost"))
    assert (document.state.notes, document.undo_text, heard) == ("kept", "edit notes", [])
    document.do(SetThreshold(5))
    abandon(document)
    (recovery,) = find_recoveries(tmp_path)
    assert (recovery.state.notes, recovery.state.threshold) == ("kept", 5.0)


def test_an_edit_is_on_the_disk_before_it_shows(tmp_path):
    document = SpecimenDocument(new_specimen(tmp_path))
    (path,) = (tmp_path / "journals").glob("*.jsonl")
    on_disk = []
    document.landmarks_changed.connect(lambda _: on_disk.append(state_of(read_journal(path).document)))
    document.do(PlacePoint(L, "CA", (1, 2, 3), MARK))
    assert on_disk == [document.state]
    document.close(discard=True)


def test_saving_compacts_and_closing_tidies(tmp_path):
    document = SpecimenDocument(new_specimen(tmp_path, specimen="A"))
    for i in range(20):
        document.do(SetThreshold(i))
    document.save(tmp_path / "A")
    (path,) = (tmp_path / "journals").glob("*.jsonl")
    assert path.name.startswith("A-")
    assert len(path.read_text().splitlines()) == 1
    assert not document.dirty
    document.undo()
    assert document.dirty
    document.close()
    (recovery,) = find_recoveries(tmp_path)
    assert recovery.state.threshold == 18
    assert recovery.text.startswith("A: 1 unsaved edit, the last at ")
    assert recovery.text.endswith(": undo set threshold to 19")
    assert recovery.specimen_file == (tmp_path / "A.gpspecimen.json").resolve()
    again = SpecimenDocument(recover_specimen(recovery, tmp_path))
    assert again.dirty
    assert again.redo()
    assert not again.dirty
    again.close()
    assert not list((tmp_path / "journals").glob("*.jsonl"))
    assert find_recoveries(tmp_path) == ()


def test_nothing_is_offered_where_nothing_is_lost(tmp_path):
    document = SpecimenDocument(new_specimen(tmp_path))
    document.attach_volume(FakeVolume())
    assert not document.dirty
    abandon(document)
    assert find_recoveries(tmp_path) == ()
    assert not list((tmp_path / "journals").iterdir())


def test_a_kill_between_saving_and_tidying_offers_nothing(tmp_path):
    document = SpecimenDocument(new_specimen(tmp_path))
    document.do(SetNotes("x"))
    document.save(tmp_path / "x")
    (path,) = (tmp_path / "journals").glob("*.jsonl")
    abandon(document)
    path.write_bytes(b"".join(_lines_before_tidying(document)))
    assert find_recoveries(tmp_path) == ()
    path.write_bytes(b"".join(_lines_before_tidying(document)))
    document.path.unlink()
    assert len(find_recoveries(tmp_path)) == 1


def _lines_before_tidying(document):
    base = document_of(state_of({}))
    changes = difference(base, document_of(document.state))
    yield base_line(base, document.path, None)
    yield record_line({"kind": "edit", "n": 1, "text": "edit notes", "time": "", "changes": changes})


def test_opening_asks_about_what_was_left(tmp_path):
    document = SpecimenDocument(new_specimen(tmp_path / "state"))
    file = document.save(tmp_path / "A")
    document.do(SetNotes("not saved"))
    with pytest.raises(InUseError, match=r"A\.gpspecimen\.json is open in another window \(process \d+ on "):
        SpecimenDocument(open_specimen(file, tmp_path / "state"))
    copy = SpecimenDocument(open_specimen(file, tmp_path / "state", as_copy=True))
    assert copy.path is None
    copy.close()
    abandon(document)
    with pytest.raises(
        UnsavedEditsError, match="was not saved before the program ended: unnamed: 1 unsaved"
    ) as caught:
        SpecimenDocument(open_specimen(file, tmp_path / "state"))
    assert caught.value.recovery.state.notes == "not saved"

    left = SpecimenDocument(open_specimen(file, tmp_path / "state", unsaved="leave"))
    assert left.state.notes == ""
    left.do(SetThreshold(7))
    (recovery,) = find_recoveries(tmp_path / "state")  # set aside, not lost
    with pytest.raises(InUseError):
        SpecimenDocument(recover_specimen(recovery, tmp_path / "state"))
    left.save()
    left.close()
    taken = SpecimenDocument(recover_specimen(recovery, tmp_path / "state"))
    assert (taken.state.notes, taken.path) == ("not saved", file)
    with pytest.raises(GpError, match="was changed by another program after"):
        taken.save()
    taken.save(overwrite=True)
    taken.close()
    again = SpecimenDocument(open_specimen(file, tmp_path / "state", unsaved="recover"))
    assert (again.state.notes, again.state.threshold, again.dirty) == ("not saved", None, False)
    again.close()


def test_saving_over_what_is_not_ours_is_refused(tmp_path):
    other = SpecimenDocument(new_specimen(tmp_path / "state", specimen="B"))
    file = other.save(tmp_path / "B")
    document = SpecimenDocument(new_specimen(tmp_path / "state"))
    document.do(SetNotes("mine"))
    with pytest.raises(GpError, match=r"B\.gpspecimen\.json: already exists"):
        document.save(file)
    with pytest.raises(InUseError):
        document.save(file, overwrite=True)
    other.close()
    with pytest.raises(GpError, match="never saved"):
        document.save()
    with pytest.raises(GpError, match="cannot be written"):
        document.save(tmp_path / "no" / "folder")
    assert (document.path, document.dirty) == (None, True)
    assert document.save(file, overwrite=True) == file
    assert SpecimenDocument(open_specimen(file)).state.notes == "mine"
    document.close()


def test_what_is_no_journal_is_left_alone(tmp_path):
    folder = tmp_path / "journals"
    folder.mkdir()
    (folder / "a.jsonl").write_text("rubbish\n")
    (folder / "b.jsonl").write_bytes(b"")
    (folder / "c.jsonl").write_bytes(record_line({"kind": "base", "n": 0, "version": 99, "document": {}}))
    assert find_recoveries(tmp_path) == ()
    assert len(list(folder.glob("*.jsonl"))) == 3
    with pytest.raises(FileFormatError, match="is not a journal, or all of it is damaged"):
        read_journal(folder / "a.jsonl")
    with pytest.raises(FileFormatError, match="version 99, not 1"):
        read_journal(folder / "c.jsonl")
    with pytest.raises(GpError, match="cannot be opened"):
        Journal(folder / "none.jsonl", n_bytes=0, n_records=0, document={})


@pytest.mark.skipif(
    os.name == "nt" or not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may write anywhere"
)
def test_a_state_directory_that_cannot_be_written(tmp_path):
    tmp_path.chmod(0o500)
    with pytest.raises(GpError, match="cannot be made"):
        SpecimenDocument(new_specimen(tmp_path / "state"))


def test_two_windows_on_one_scan_are_noticed(tmp_path):
    scan = tmp_path / "scan.nrrd"
    one, two = SpecimenDocument(new_specimen(tmp_path)), SpecimenDocument(new_specimen(tmp_path))
    assert one.attach_volume(FakeVolume(path=scan)) == ()
    (warning,) = two.attach_volume(FakeVolume(path=scan))
    assert "The scan scan.nrrd is open in another window" in warning
    one.close()
    assert two.attach_volume(FakeVolume(path=scan)) == ()
    two.close()


def test_locks(tmp_path):
    path = tmp_path / "a" / "x.lock"
    lock = FileLock(path, "It")
    with pytest.raises(
        InUseError, match=f"It is open in another window \\(process {os.getpid()} on .*as a copy"
    ):
        FileLock(path, "It")
    lock.release()
    lock.release()
    path.write_text('{"pid": 1, "host": "elsewhere"}')  # left behind: nobody holds it
    FileLock(path, "It").release(remove=True)
    assert not path.exists()


def test_undo_after_recovery_is_bounded(tmp_path):
    document = SpecimenDocument(new_specimen(tmp_path))
    document.do(ImportLandmarks((shape(),), MARK))
    for i in range(20):
        document.do(SetThreshold(i))
    abandon(document)
    (recovery,) = find_recoveries(tmp_path)
    history = replayed(recovery.content, limit=5)
    assert history.state == document.state
    taken = []
    while history.to_undo:
        taken.append(history.undo().text)
    assert taken == [f"set threshold to {i}" for i in (19, 18, 17, 16, 15)]
    assert history.state.threshold == 14.0
    assert len(history.state.side(L).placed) == 20


def test_a_line_that_is_missing_is_counted_and_what_follows_is_kept(tmp_path):
    document = SpecimenDocument(new_specimen(tmp_path))
    for i in range(4):
        document.do(SetThreshold(i))
    abandon(document)
    (path,) = (tmp_path / "journals").glob("*.jsonl")
    lines = path.read_bytes().splitlines(keepends=True)
    path.write_bytes(b"".join([*lines[:2], *lines[3:]]))
    read = read_journal(path)
    assert [entry.text for entry in read.entries] == [f"set threshold to {i}" for i in (0, 2, 3)]
    assert read.damage.startswith("1 edit in ")
