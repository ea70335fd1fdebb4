"""What of a document is safe on disk: its specimen file, its journal and its locks."""

from __future__ import annotations

import logging
from os import PathLike
from pathlib import Path
from uuid import uuid4

from gp_core.disk import read_bytes, write_bytes
from gp_core.errors import AlreadyExistsError, GpError
from gp_labeler.document.edit_tables import edit_table
from gp_labeler.document.edits import Edit
from gp_labeler.document.journal import Journal, read_journal
from gp_labeler.document.lock import FileLock, InUseError
from gp_labeler.document.paths import (
    UNSAVED,
    absolute_path,
    journal_folder,
    journal_path,
    lock_path,
    volume_lock_path,
)
from gp_labeler.document.recovery import Recovery
from gp_labeler.document.specimen_file import SUFFIX, digest, read_document, thumbnail_in, write_specimen
from gp_labeler.document.specimen_json import document_of
from gp_labeler.document.state import SpecimenState

__all__ = ["SpecimenStore"]

_log = logging.getLogger(__name__)


class SpecimenStore:
    """Keeps one document safe.

    Parameters
    ----------
    directory : Path, optional
        State directory; None keeps neither journal nor lock, for scripts that need none.
    specimen_file : Path, optional
        The file the specimen is saved in.
    """

    def __init__(self, directory: Path | None = None, specimen_file: Path | None = None) -> None:
        self.directory = directory
        self.specimen_file = None if specimen_file is None else absolute_path(specimen_file)
        self._saved = None if specimen_file is None else digest(specimen_file)
        self._journal: Journal | None = None
        self._lock: FileLock | None = None
        self._volume_lock: FileLock | None = None

    @classmethod
    def begin(
        cls, directory: Path | None, state: SpecimenState, specimen_file: Path | None = None
    ) -> SpecimenStore:
        """Begin to keep a document that is at `state`.

        Raises
        ------
        InUseError
            Another window has this specimen file open.
        GpError
            The state directory cannot be written.
        """
        store = cls(directory, specimen_file)
        store._journal, store._lock = store._begun(store.specimen_file, state, store._saved)
        return store

    @classmethod
    def resume(cls, directory: Path | None, recovery: Recovery) -> SpecimenStore:
        """Go on with a journal that a killed program left; raises as `begin` does."""
        store = cls(directory, recovery.specimen_file)
        store._saved = recovery.content.saved
        if directory is None:
            return store
        file = store.specimen_file
        is_here = recovery.journal.parent == journal_folder(directory)
        path = recovery.journal if file is None and is_here else journal_path(directory, file)
        store._lock = store._locked(path, file)
        try:
            store._journal = _resumed(recovery, path)
        except OSError as error:
            store._lock.release()
            raise GpError(f"cannot be moved: {error.strerror}", file=recovery.journal) from None
        except GpError:
            store._lock.release()
            raise
        return store

    def record(
        self, kind: str, text: str, state: SpecimenState, *, time: str, edit: Edit | None = None
    ) -> None:
        """Write an edit down; only then may it show. The arguments are those of `Journal.append`.

        Raises
        ------
        GpError
            The disk does not take it.
        """
        if self._journal is not None:
            table = None if edit is None else edit_table(edit)
            self._journal.append(kind, text, document_of(state), time=time, edit=table)

    def save(
        self,
        state: SpecimenState,
        path: str | PathLike[str] | None = None,
        *,
        overwrite: bool = False,
        thumbnail: bytes | None = None,
    ) -> Path:
        """Write the specimen file and begin the journal again.

        Parameters
        ----------
        state : SpecimenState
            What to save.
        path : path, optional
            Where; by default where it was last. The suffix is added where it lacks.
        overwrite : bool
            Whether a file may be replaced that is not the one this document wrote or read last.
        thumbnail : bytes, optional
            A small picture, PNG; by default the file keeps the one that it has.

        Returns
        -------
        Path
            The file.

        Raises
        ------
        InUseError
            Another window has that file open.
        GpError
            No path, a file that is not ours, or it cannot be written. Nothing has changed then.
        """
        target = self._target(path)
        moves = target != self.specimen_file
        self._check_ours(target, overwrite, moves)
        lock = (
            self._locked(journal_path(self.directory, target), target) if moves and self.directory else None
        )
        try:
            write_specimen(target, state, thumbnail=thumbnail or self._kept_thumbnail())
        except GpError:
            if lock is not None:
                lock.release()
            raise
        self._saved = digest(target)
        self._rebase(target, state, lock)
        return target

    def _kept_thumbnail(self) -> bytes | None:
        """Return the picture in the file that the specimen was last saved in."""
        if self.specimen_file is None:
            return None
        try:
            return thumbnail_in(read_document(self.specimen_file))
        except GpError:
            return None

    def claim_volume(self, path: str | PathLike[str] | None) -> str | None:
        """Note that this window labels a scan; return a warning where another window does too."""
        _let_go(self._volume_lock)
        self._volume_lock = None
        if self.directory is None or path is None:
            return None
        try:
            self._volume_lock = FileLock(
                volume_lock_path(self.directory, path), f"The scan {Path(path).name}"
            )
        except InUseError as error:
            return f"{error.problem}. Labels made there are not shown here."
        except GpError as error:
            _log.warning("%s", error)
        return None

    def close(self, *, keep_journal: bool) -> None:
        """Let go of everything; the journal stays where `keep_journal`, and is offered at the next start."""
        if self._journal is not None:
            (self._journal.close if keep_journal else self._journal.remove)()
        for lock in (self._lock, self._volume_lock):
            _let_go(lock)
        self._journal = self._lock = self._volume_lock = None

    def _target(self, path: str | PathLike[str] | None) -> Path:
        if path is None and self.specimen_file is None:
            raise GpError("the specimen was never saved", remedy=f"Give a file name, <specimen>{SUFFIX}.")
        target = absolute_path(path or self.specimen_file or "")
        return target if target.name.endswith(SUFFIX) else target.with_name(target.name + SUFFIX)

    def _check_ours(self, target: Path, overwrite: bool, moves: bool) -> None:
        if overwrite or not target.exists():
            return
        if moves:
            remedy = "Choose another name, or overwrite it."
            raise AlreadyExistsError("already exists", file=target, remedy=remedy)
        if digest(target) != self._saved:
            raise GpError(
                "was changed by another program after it was opened",
                file=target,
                remedy="Save under another name, or overwrite it.",
            )

    def _locked(self, journal: Path, specimen_file: Path | None) -> FileLock:
        return FileLock(lock_path(journal), specimen_file.name if specimen_file else "this specimen")

    def _begun(
        self,
        specimen_file: Path | None,
        state: SpecimenState,
        saved: str | None,
        lock: FileLock | None = None,
    ) -> tuple[Journal | None, FileLock | None]:
        if self.directory is None:
            return None, None
        path = lock.path.with_suffix(".jsonl") if lock else journal_path(self.directory, specimen_file)
        lock = lock or self._locked(path, specimen_file)
        try:
            _set_aside(path)
            return Journal.create(path, document_of(state), specimen_file=specimen_file, saved=saved), lock
        except GpError:
            lock.release()
            raise

    def _rebase(self, target: Path, state: SpecimenState, lock: FileLock | None) -> None:
        """Begin the journal again at what was saved; under another name where it was saved under another."""
        old_journal, old_lock = self._journal, self._lock
        try:
            if lock is None and old_journal is not None:
                old_journal.restart(document_of(state), specimen_file=target, saved=self._saved)
            elif lock is not None:
                self._journal, self._lock = self._begun(target, state, self._saved, lock)
                if old_journal is not None:
                    old_journal.remove()
                _let_go(old_lock)
        except GpError as error:  # saved it is, and the old journal still tells the same
            _log.warning("the journal could not be begun again after saving: %s", error)
        self.specimen_file = target


def _resumed(recovery: Recovery, path: Path) -> Journal:
    """Go on with a journal at `path`; a copy of a damaged one is kept, and one in another folder stays."""
    content = recovery.content
    elsewhere = recovery.journal.parent != path.parent
    if content.damage and not elsewhere:
        copy = recovery.journal.with_name(f"{recovery.journal.stem}-{uuid4().hex[:8]}.damaged")
        write_bytes(copy, read_bytes(recovery.journal, what="journal"))
    if path != recovery.journal:
        _set_aside(path)
    if content.damage or elsewhere:
        journal = Journal.create(path, content.base, specimen_file=content.specimen_file, saved=content.saved)
        journal.append("edit", "recover edits", content.document, time=content.time)
        if path != recovery.journal and not elsewhere:
            recovery.discard()
        return journal
    if path != recovery.journal:  # it was set aside
        recovery.journal.replace(path)
    return Journal.resume(path, read_journal(path))


def _set_aside(journal: Path) -> None:
    """Rename a journal that a killed program left, so that it is still offered at the next start."""
    try:
        if journal.exists():
            journal.replace(journal.with_name(f"{journal.stem}-{uuid4().hex[:8]}.jsonl"))
    except OSError as error:
        raise GpError(f"cannot be moved: {error.strerror}", file=journal) from None


def _let_go(lock: FileLock | None) -> None:
    if lock is not None:
        lock.release(remove=lock.path.name.startswith(UNSAVED))
