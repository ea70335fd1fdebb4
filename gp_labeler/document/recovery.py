"""What a killed program leaves behind, and how it is found again at the next start."""

from __future__ import annotations

import logging
from contextlib import suppress
from dataclasses import dataclass
from datetime import datetime
from functools import cached_property
from pathlib import Path

from gp_core.disk import remove_drafts
from gp_core.errors import GpError
from gp_labeler.document.history import LIMIT, History
from gp_labeler.document.journal import Entry, JournalContent, read_journal
from gp_labeler.document.lock import FileLock, InUseError
from gp_labeler.document.paths import UNSAVED, journal_folder, journal_path, lock_path
from gp_labeler.document.specimen_file import read_specimen
from gp_labeler.document.specimen_json import document_of, state_of
from gp_labeler.document.state import SpecimenState

__all__ = ["Recovery", "find_recoveries", "find_recovery", "replayed", "unreadable_journals"]

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Recovery:
    """Confirmed edits that were never saved.

    Parameters
    ----------
    journal : Path
        Where they are.
    content : JournalContent
        What it says.
    """

    journal: Path
    content: JournalContent

    @cached_property
    def state(self) -> SpecimenState:
        """The last confirmed state."""
        return state_of(self.content.document)

    @property
    def specimen_file(self) -> Path | None:
        """The file the specimen is saved in, if it ever was."""
        return self.content.specimen_file

    @property
    def text(self) -> str:
        """Say what there is: ``GP-014: 12 unsaved edits, the last at 2026-03-01 10:42: place FPP left``."""
        entries = self.content.entries
        n = len(entries)
        when = _local(entries[-1].time) if n else ""
        last = f", the last{when}: {_words(entries[-1])}" if n else ""
        damage = f". {self.content.damage}" if self.content.damage else ""
        return f"{self.state.specimen}: {n} unsaved edit{'' if n == 1 else 's'}{last}{damage}"

    def discard(self) -> None:
        """Delete the journal: the user does not want these edits; raises `GpError` where that is refused."""
        try:
            self.journal.unlink(missing_ok=True)
        except OSError as error:
            raise GpError(f"cannot be deleted: {error.strerror}", file=self.journal) from None


def _words(entry: Entry) -> str:
    return f"{entry.kind} {entry.text}" if entry.kind in ("undo", "redo") else entry.text


def _local(time: str) -> str:
    try:
        return f" at {datetime.fromisoformat(time).astimezone():%Y-%m-%d %H:%M}"
    except ValueError:
        return ""


def find_recoveries(directory: Path) -> tuple[Recovery, ...]:
    """Return what programs that are gone left unsaved, the latest first.

    Journals that hold nothing unsaved are deleted on the way; those of living windows are left alone, and
    those that cannot be read are left where they are.
    """
    found = []
    remove_drafts(journal_folder(directory))
    for journal in sorted(journal_folder(directory).glob("*.jsonl")):
        lock = None
        try:
            lock = FileLock(lock_path(journal), "the journal")
        except InUseError:
            continue
        except GpError:  # it cannot be made, so no window has it: the disk is full, or may only be read
            pass
        recovery = _read(journal)
        if recovery is not None and _is_saved(recovery):
            with suppress(GpError):
                recovery.discard()
        elif recovery is not None:
            found.append(recovery)
        if lock is not None:
            lock.release(remove=journal.name.startswith(UNSAVED))
    return tuple(sorted(found, key=lambda r: r.content.time, reverse=True))


def unreadable_journals(directory: Path) -> tuple[str, ...]:
    """Return what to tell of the journals that cannot be read at all; they are left where they are."""
    found = []
    for journal in sorted(journal_folder(directory).glob("*.jsonl")):
        try:
            _ = Recovery(journal, read_journal(journal)).state
        except GpError as error:
            found.append(f"{error} It is left where it is")
    return tuple(found)


def find_recovery(directory: Path, specimen_file: Path) -> Recovery | None:
    """Return what was left unsaved of one specimen file; None where there is nothing.

    Raises
    ------
    InUseError
        It was not left: a living window has the file open.
    """
    journal = journal_path(directory, specimen_file)
    if not journal.exists():
        return None
    FileLock(lock_path(journal), specimen_file.name).release()
    recovery = _read(journal)
    return None if recovery is None or _is_saved(recovery) else recovery


def _read(journal: Path) -> Recovery | None:
    try:
        recovery = Recovery(journal, read_journal(journal))
        _ = recovery.state  # must be readable too
    except GpError as error:
        _log.warning("a journal cannot be read and is left where it is: %s", error)
        return None
    return recovery


def _is_saved(recovery: Recovery) -> bool:
    """Whether the last confirmed state is the saved one: the kill fell between saving and tidying up."""
    if recovery.content.damage:  # nobody knows what it said
        return False
    document = recovery.content.document
    base = recovery.content.base
    only_opened = "volume" not in base and all(entry.kind == "change" for entry in recovery.content.entries)
    if only_opened or document == base:
        return True
    if recovery.specimen_file is None:
        return False
    try:
        return document_of(read_specimen(recovery.specimen_file)) == document
    except GpError:
        return False


def replayed(content: JournalContent, *, limit: int = LIMIT) -> History[SpecimenState]:
    """Return the history of a journal: the last confirmed state, and undo back to the saved one."""
    recent = content.entries[-limit:]
    before = content.entries[-limit - 1].document if len(content.entries) > limit else content.base
    history = History(state_of(before), limit=limit)
    for entry in recent:
        _replay(history, entry)
    return history


def _replay(history: History[SpecimenState], entry: Entry) -> None:
    state = state_of(entry.document)
    if entry.kind == "undo":
        history.undo(state=state, text=entry.text)
    elif entry.kind == "redo":
        history.redo(state=state, text=entry.text)
    elif entry.kind == "change":
        history.change_all(lambda old: old.on_volume(state.volume, state.import_choices))
    else:
        history.push(entry.text, state, merge=entry.kind == "merge")
