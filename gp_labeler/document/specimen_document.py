"""A specimen that is being edited: undo, redo, the scan it lies on, and everything safe on disk."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from dataclasses import replace
from datetime import datetime, timezone
from os import PathLike
from pathlib import Path
from typing import Any

from psygnal import Signal

from gp_core.errors import GpError
from gp_core.landmarks.features import Side
from gp_core.landmarks.sets import LandmarkSet
from gp_labeler.document.edits import Edit
from gp_labeler.document.history import History
from gp_labeler.document.state import SpecimenState, changed_points
from gp_labeler.document.store import Keeper
from gp_labeler.document.volume_reference import VolumeLike, VolumeReference

__all__ = ["EditedSpecimen", "VolumeChangedError", "utc_now"]


def utc_now() -> str:
    """Return the time as ISO 8601 text, UTC."""
    return datetime.now(timezone.utc).isoformat(timespec="seconds")


class VolumeChangedError(GpError):
    """The scan is not the one that was labelled.

    Parameters
    ----------
    differences : tuple of str
        In what, a clause each.
    reference : VolumeReference
        The scan that was offered.
    """

    def __init__(self, differences: tuple[str, ...], reference: VolumeReference) -> None:
        self.differences = differences
        super().__init__(
            f"{reference.name} is not the scan that was labelled: {'; '.join(differences)}",
            file=reference.path,
            remedy="Choose the right one, or accept it after looking where the points lie.",
        )


class EditedSpecimen:
    """One specimen, all edits of it, and what of it is on disk: the part of a `Session` that outlives it.

    Every change is written to the journal first, then it holds, then the signals tell; all on the thread that
    made the object.

    Parameters
    ----------
    history : History
        Where it stands.
    keeper : Keeper
        What keeps it safe on disk.
    saved : SpecimenState, optional
        What is saved, where that is not where it stands.
    clock : callable
        Returns the time as ISO 8601 text.
    """

    landmarks_changed = Signal(frozenset)
    """The points that changed, (Side, code): IN for both sides, CO where it was recomputed."""
    touches_changed = Signal()
    """What was touched with the probe, or where the skull's registration features are on the scan."""
    volume_changed = Signal(object)
    """The loaded volume."""
    threshold_changed = Signal(object)
    details_changed = Signal()
    """Specimen name, notes, the reference to the scan, import choices or pose checks."""
    history_changed = Signal()
    """What can be undone and redone."""
    dirty_changed = Signal(bool)
    saved = Signal(object)
    """The file it was saved in."""
    edited = Signal(object, bool)
    """The edit that was made, and whether it continued the gesture before it, as `do` was told."""
    stepped = Signal(str)
    """``undo`` or ``redo``, after it was done."""

    def __init__(
        self,
        history: History[SpecimenState],
        keeper: Keeper,
        *,
        saved: SpecimenState | None = None,
        clock: Callable[[], str] = utc_now,
    ) -> None:
        self.now = clock
        self._history = history
        self._keeper = keeper
        self._clean = self.state if saved is None else saved
        self._was_dirty = self.dirty
        self._volume: VolumeLike | None = None
        self._thread = threading.get_ident()

    @property
    def state(self) -> SpecimenState:
        """The specimen as it stands."""
        return self._history.state

    @property
    def volume(self) -> VolumeLike | None:
        """The loaded volume; None while only `state.volume`, its reference, is known."""
        return self._volume

    @property
    def path(self) -> Path | None:
        """The specimen file; None where it was never saved."""
        return self._keeper.specimen_file

    @property
    def dirty(self) -> bool:
        """Whether there is something to save."""
        return self.state != self._clean

    @property
    def undo_text(self) -> str | None:
        """What undo would take back, such as ``place FPP left``; None where there is nothing."""
        step = self._history.to_undo
        return None if step is None else step.text

    @property
    def redo_text(self) -> str | None:
        """What redo would do again; None where there is nothing."""
        step = self._history.to_redo
        return None if step is None else step.text

    def landmarks(self, side: Side | str) -> LandmarkSet:
        """Return one side, in the scan frame."""
        return self.state.side(side)

    # Edits

    def do(self, edit: Edit, *, merge: bool = False) -> bool:
        """Make an edit.

        Parameters
        ----------
        edit : Edit
            What to do.
        merge : bool
            Whether it continues the gesture before it, if that has the same text (a second nudge, ...).

        Returns
        -------
        bool
            False where it changes nothing; then there is nothing to undo either.

        Raises
        ------
        GpError
            It cannot be done (a locked point, ...) or kept safe; nothing has changed then.
        """
        self._check_thread()
        old, new = self.state, edit.apply(self.state)
        if new == old:
            return False
        text = edit.text
        self._keeper.record("merge" if merge else "edit", text, new, time=self.now())
        self._history.push(text, new, focus=self._focus(), merge=merge)
        self._tell(old)
        self.edited.emit(edit, merge)
        return True

    def undo(self) -> bool:
        """Take back the last edit; False where there is none."""
        return self._step("undo")

    def redo(self) -> bool:
        """Do again what was undone last; False where there is nothing."""
        return self._step("redo")

    def _step(self, kind: str) -> bool:
        self._check_thread()
        upcoming = self._history.to_undo if kind == "undo" else self._history.to_redo
        if upcoming is None:
            return False
        old = self.state
        self._keeper.record(kind, upcoming.text, upcoming.state, time=self.now())
        (self._history.undo if kind == "undo" else self._history.redo)(focus=self._focus())
        self._tell(old)
        self._return_to(upcoming.focus)
        self.stepped.emit(kind)
        return True

    def _tell(self, old: SpecimenState) -> None:
        new = self.state
        if changed := changed_points(old, new):
            self.landmarks_changed.emit(changed)
        if (new.touches, new.skull) != (old.touches, old.skull):
            self.touches_changed.emit()
        if new.threshold != old.threshold:
            self.threshold_changed.emit(new.threshold)
        if _details(new) != _details(old):
            self.details_changed.emit()
        self.history_changed.emit()
        self._tell_dirty()

    def _tell_dirty(self) -> None:
        if self.dirty != self._was_dirty:
            self._was_dirty = self.dirty
            self.dirty_changed.emit(self._was_dirty)

    def _focus(self) -> object:
        """Return what is to be remembered with an edit of where the user was."""
        return None

    def _return_to(self, focus: object) -> None:
        """Bring the user back there when the edit is undone."""

    def _check_thread(self) -> None:
        if threading.get_ident() != self._thread:
            raise RuntimeError(
                "a session may only be changed on its own thread; deliver results through Jobs"
            )

    # The scan

    @property
    def volume_is_lost(self) -> bool:
        """Whether the scan is no longer where it was; then `relink` it."""
        reference = self.state.volume
        return reference is not None and reference.path is not None and not Path(reference.path).exists()

    def attach_volume(
        self,
        volume: VolumeLike,
        *,
        import_choices: Mapping[str, Any] | None = None,
        accept_changes: bool = False,
    ) -> tuple[str, ...]:
        """Take a loaded scan. Undo leaves it alone.

        Ask for its checksum where it was read, off this thread: a large scan takes a while.

        Parameters
        ----------
        volume : Volume
            The scan.
        import_choices : mapping, optional
            What the user answered when it was read; by default what the volume says.
        accept_changes : bool
            Whether to go on though it is not the scan that was labelled.

        Returns
        -------
        tuple of str
            Warnings, such as that another window has the same scan open.

        Raises
        ------
        VolumeChangedError
            It is not the scan that was labelled.
        """
        self._check_thread()
        reference, known = VolumeReference.of(volume), self.state.volume
        if known is not None and not accept_changes and (differences := known.differences(reference)):
            raise VolumeChangedError(differences, reference)
        choices = getattr(volume, "choices", {}) if import_choices is None else import_choices
        self._refer_to(reference, choices, f"open {reference.name}")
        self._volume = volume
        warning = self._keeper.claim_volume(reference.path)
        self.volume_changed.emit(volume)
        return () if warning is None else (warning,)

    def relink(self, path: str | PathLike[str]) -> None:
        """Say where the scan is now; read it from there and `attach_volume` it.

        Raises
        ------
        GpError
            No scan is referred to, or nothing is there.
        """
        self._check_thread()
        reference = self.state.volume
        if reference is None:
            raise GpError("no scan belongs to this specimen yet", specimen=self.state.specimen)
        if not Path(path).exists():
            raise GpError("does not exist", file=path, remedy="Choose the file or folder of the scan.")
        here = replace(reference, path=str(Path(path).absolute()))
        self._refer_to(here, self.state.import_choices, f"find {reference.name} at {path}")

    def _refer_to(self, reference: VolumeReference, choices: Mapping[str, Any], text: str) -> None:
        old, new = self.state, self.state.on_volume(reference, choices)
        if new == old:
            return
        self._keeper.record("change", text, new, time=self.now())
        self._history.change_all(lambda state: state.on_volume(reference, choices))
        if old.volume is None:  # to have opened a scan is nothing to be asked about
            self._clean = self._clean.on_volume(reference, choices)
        self._tell(old)

    # Files

    @property
    def measured_state(self) -> SpecimenState:
        """The state as it is saved and exported."""
        return self.state

    def save(self, path: str | PathLike[str] | None = None, *, overwrite: bool = False) -> Path:
        """Save the specimen; see `Keeper.save` for arguments and errors."""
        self._check_thread()
        file = self._keeper.save(self.measured_state, path, overwrite=overwrite)
        self._clean = self.state
        self.saved.emit(file)
        self._tell_dirty()
        return file

    def close(self, *, discard: bool = False) -> None:
        """Let go of journal, locks and scan.

        Unsaved edits stay in the journal, and are offered at the next start, unless the user wants to
        `discard` them.
        """
        self._keeper.close(keep_journal=self.dirty and not discard)
        self._volume = None


def _details(state: SpecimenState) -> tuple[object, ...]:
    return state.specimen, state.notes, state.volume, state.import_choices, state.pose_checks
