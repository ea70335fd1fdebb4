"""The specimen that is open: its state, undo and redo, the scan it lies on, and everything safe on disk."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Mapping
from dataclasses import replace
from datetime import datetime, timezone
from os import PathLike
from pathlib import Path
from typing import Any

from gp_core.errors import GpError
from gp_core.landmarks.features import Side
from gp_core.landmarks.scan_evidence import ScanEvidence
from gp_core.landmarks.sets import LandmarkSet
from gp_labeler.document.edits import Edit
from gp_labeler.document.history import History
from gp_labeler.document.opening import LoadedSpecimen, new_specimen, open_specimen, recover_specimen
from gp_labeler.document.recovery import Recovery
from gp_labeler.document.signals import Signal
from gp_labeler.document.specimen_file import SUFFIX
from gp_labeler.document.state import How, Provenance, SpecimenState, changed_points, measured
from gp_labeler.document.store import SpecimenStore
from gp_labeler.document.volume_reference import VolumeLike, VolumeReference

__all__ = ["SpecimenDocument", "VolumeChangedError", "utc_now"]


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
            remedy="Choose the correct scan, or accept this one after you have checked where the points are.",
        )


class SpecimenDocument:
    """The specimen that is open, all edits of it, and what of it is on disk.

    One document lives as long as the program: opening a specimen loads it into the document, and `reset`
    announces that. So a listener connects once. Every edit is journalled, applied, then announced, all on the
    thread that made the document.

    Parameters
    ----------
    specimen : SpecimenState or LoadedSpecimen, optional
        To begin with; an empty specimen by default.
    directory : Path, optional
        State directory, where journals are kept; by default that of `specimen`, if any.
    author : str, optional
        Who labels; see `author`.
    clock : callable
        Returns the time as ISO 8601 text.
    """

    reset = Signal()
    """Another specimen was loaded: read everything again."""
    loaded = Signal(tuple)
    """After all listeners of `reset`: texts that the user should be told once."""
    landmarks_changed = Signal(frozenset)
    """The points that changed, (Side, code): IN for both sides, CO where it was recomputed."""
    touches_changed = Signal()
    """What was touched with the probe, or where the skull's registration features are on the scan."""
    measurements_changed = Signal()
    """Rulers and angles."""
    volume_changed = Signal(object)
    """The attached volume."""
    threshold_changed = Signal(object)
    """The threshold that is set, or None; see `ScanModel.threshold` for the one in effect."""
    labelling_changed = Signal()
    """Another labelling of the specimen is in work, or it is by another observer; after its landmarks."""
    author_changed = Signal(str)
    """Who labels from now on."""
    head_frame_changed = Signal()
    """How the head lies in its scan, or whether that is shown."""
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
    focus_restored = Signal(object)
    """The `focus` at the time of an edit that was just undone or redone."""

    def __init__(
        self,
        specimen: SpecimenState | LoadedSpecimen | None = None,
        *,
        directory: Path | None = None,
        author: str | None = None,
        clock: Callable[[], str] = utc_now,
    ) -> None:
        begun = _loaded(specimen) if specimen is not None else new_specimen(directory)
        self.directory = begun.store.directory if directory is None else directory
        self._author = author or ""
        self.now = clock
        self.focus: object = None
        """What the user works on, remembered with every edit."""
        self.measure: Callable[[LandmarkSet], ScanEvidence] | None = None
        """Tells how far the points of a side lie from the bone of the scan; None without a scan."""
        self.picture: Callable[[], bytes | None] | None = None
        """Draws the small picture that is saved with the specimen, PNG."""
        self.history: History[SpecimenState]
        """What can be undone and redone."""
        self.store: SpecimenStore
        """Keeps it safe on disk."""
        self._thread = threading.get_ident()
        self._abandoned: SpecimenState | None = None
        self._hold(begun)

    # What it holds

    @property
    def state(self) -> SpecimenState:
        """The specimen as it stands."""
        return self.history.state

    @property
    def volume(self) -> VolumeLike | None:
        """The attached volume; None while only `state.volume`, its reference, is known."""
        return self._volume

    @property
    def path(self) -> Path | None:
        """The specimen file; None where it was never saved."""
        return self.store.specimen_file

    @property
    def location(self) -> str:
        """Where it is kept, which tells two of one name apart; empty where it was never saved."""
        if self.path is not None:
            return _location(self.path, self.state.specimen)
        return "" if self._copy_of is None else f"copy of {self._copy_of}"

    @property
    def dirty(self) -> bool:
        """Whether there is something to save."""
        return self.state != self._clean

    @property
    def in_use(self) -> bool:
        """Whether there is a specimen to work on and to keep: one with a scan, or one that was touched."""
        return self.state.volume is not None or bool(self.state.touches)

    @property
    def lacks_scan(self) -> bool:
        """Whether the specimen was touched, and has no scan yet: the next one that is opened is its own."""
        return self.in_use and self.state.volume is None

    @property
    def undo_text(self) -> str | None:
        """What undo would take back, such as ``place FPP left``; None where there is nothing."""
        step = self.history.to_undo
        return None if step is None or self._would_reveal(step.state) else step.text

    def _would_reveal(self, before: SpecimenState) -> bool:
        """Whether a state before this one shows another labelling to someone who labels blind."""
        return self.state.blind and _labelling(before) != _labelling(self.state)

    @property
    def redo_text(self) -> str | None:
        """What redo would do again; None where there is nothing."""
        step = self.history.to_redo
        return None if step is None else step.text

    @property
    def author(self) -> str:
        """Who labels, in the words of that person; empty until somebody says it."""
        return self._author

    @author.setter
    def author(self, name: str) -> None:
        name = " ".join(name.split())
        if name != self._author:
            self._author = name
            self.author_changed.emit(name)

    def landmarks(self, side: Side | str) -> LandmarkSet:
        """Return one side, in the scan frame."""
        return self.state.side(side)

    # Loading

    def begin(self, specimen: str = "unnamed") -> None:
        """Begin an empty specimen; see `new_specimen`."""
        self.load(new_specimen(self.directory, specimen=specimen))

    def open(self, path: str | PathLike[str], *, unsaved: str = "ask", as_copy: bool = False) -> None:
        """Open a specimen file; see `open_specimen` for arguments and errors."""
        self.load(open_specimen(path, self.directory, unsaved=unsaved, as_copy=as_copy))

    def recover(self, recovery: Recovery) -> None:
        """Go on where a killed program stopped; see `recover_specimen`."""
        self.load(recover_specimen(recovery, self.directory))

    def load(self, specimen: SpecimenState | LoadedSpecimen) -> None:
        """Hold another specimen from now on, and announce `reset`.

        Unsaved edits of the one before stay in its journal, unless they were given up by `abandon`.

        Parameters
        ----------
        specimen : SpecimenState or LoadedSpecimen
            A plain state is kept in memory only, until it is saved.
        """
        self._check_thread()
        specimen = _loaded(specimen)
        kept, name = self._keeps_edits, self.state.specimen
        self.close()
        self._hold(specimen)
        self.reset.emit()
        told = (f"Unsaved edits of {name} are kept; the next start offers them",)
        self.loaded.emit((*(told if kept and self.directory is not None else ()), *specimen.notices))

    def abandon(self) -> None:
        """Give up the unsaved edits so far, once something else is loaded or the program ends."""
        self._abandoned = self.state

    @property
    def _keeps_edits(self) -> bool:
        """Whether there are unsaved edits that nobody gave up: some come while a scan is loading."""
        return self.dirty and self.state is not self._abandoned

    def _hold(self, specimen: LoadedSpecimen) -> None:
        self.history, self.store = specimen.history, specimen.store
        self._clean = self.state if specimen.saved is None else specimen.saved
        self._was_dirty = self.dirty
        self._volume: VolumeLike | None = None
        self._abandoned = None
        copied = specimen.copy_of
        self._copy_of = None if copied is None else _location(copied, self.state.specimen)

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
        self.store.record("merge" if merge else "edit", text, new, time=self.now(), edit=edit)
        self.history.push(text, new, focus=self.focus, merge=merge)
        self._announce(old)
        self.edited.emit(edit, merge)
        return True

    def undo(self) -> bool:
        """Take back the last edit; False where there is none."""
        return self._step("undo")

    def redo(self) -> bool:
        """Do again what was undone last; False where there is nothing."""
        return self._step("redo")

    def show_head_frame(self, shown: bool) -> None:
        """Keep whether the views are turned into the head's frame: no edit, but saved with the next."""
        self._check_thread()
        head = self.state.head_frame
        if head is not None and head.shown != shown:
            self.history.change_all(lambda state: _with_head_shown(state, shown))
            self.head_frame_changed.emit()

    def provenance(self, how: How, *, source: str = "") -> Provenance:
        """Return what is to be remembered of a point that is placed now."""
        volume = self.state.volume
        return Provenance(how, self.now(), self.author, volume.spacing if volume else None, source)

    def _step(self, kind: str) -> bool:
        self._check_thread()
        upcoming = self.history.to_undo if kind == "undo" else self.history.to_redo
        if upcoming is None or (kind == "undo" and self._would_reveal(upcoming.state)):
            return False
        old = self.state
        self.store.record(kind, upcoming.text, upcoming.state, time=self.now())
        (self.history.undo if kind == "undo" else self.history.redo)(focus=self.focus)
        self._announce(old)
        self.focus_restored.emit(upcoming.focus)
        self.stepped.emit(kind)
        return True

    def _announce(self, old: SpecimenState) -> None:
        new = self.state
        if changed := changed_points(old, new):
            self.landmarks_changed.emit(changed)
        if _labelling(new) != _labelling(old):
            self.labelling_changed.emit()
        if (new.touches, new.skull) != (old.touches, old.skull):
            self.touches_changed.emit()
        if new.measurements != old.measurements:
            self.measurements_changed.emit()
        if new.head_frame != old.head_frame:
            self.head_frame_changed.emit()
        if new.threshold != old.threshold:
            self.threshold_changed.emit(new.threshold)
        if _details(new) != _details(old):
            self.details_changed.emit()
        self.history_changed.emit()
        self._announce_dirty()

    def _announce_dirty(self) -> None:
        if self.dirty != self._was_dirty:
            self._was_dirty = self.dirty
            self.dirty_changed.emit(self._was_dirty)

    def _check_thread(self) -> None:
        if threading.get_ident() != self._thread:
            raise RuntimeError(
                "a document may only be changed on its own thread; deliver results through Jobs"
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
        """Attach a loaded scan. Undo leaves it alone.

        Its checksum counts where it is known, which takes a while; `confirm_volume` tells it later.

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
        if known is not None and not (accept_changes or reference.checksum):
            reference = replace(reference, checksum=known.checksum)
        choices = getattr(volume, "choices", {}) if import_choices is None else import_choices
        self._refer_to(reference, choices, f"open {reference.name}")
        self._volume = volume
        warning = self.store.claim_volume(reference.path)
        self.volume_changed.emit(volume)
        return () if warning is None else (warning,)

    def confirm_volume(self, checksum: str) -> None:
        """Tell the checksum of the attached scan, which was not known when it was attached.

        Parameters
        ----------
        checksum : str
            Of its voxels and where they lie.

        Raises
        ------
        VolumeChangedError
            It is not the scan that was labelled; it is detached, until it is attached with `accept_changes`.
        """
        self._check_thread()
        known = self.state.volume
        if known is None or self._volume is None:
            return
        reference = replace(known, checksum=checksum)
        if differences := known.differences(reference):
            self._volume = self.measure = None
            self.reset.emit()
            raise VolumeChangedError(differences, reference)
        if self._clean.volume == known:
            self._clean = self._clean.on_volume(reference, self._clean.import_choices)
        self._refer_to(reference, self.state.import_choices, f"check {reference.name}")

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
        self.store.record("change", text, new, time=self.now())
        self.history.change_all(lambda state: state.on_volume(reference, choices))
        if old.volume is None:  # to have opened a scan is nothing to be asked about
            self._clean = self._clean.on_volume(reference, choices)
        self._announce(old)

    # Files

    @property
    def measured_state(self) -> SpecimenState:
        """The state as it is saved and exported: with distances from bone, where there is a scan."""
        return measured(self.state, self.measure)

    def save(self, path: str | PathLike[str] | None = None, *, overwrite: bool = False) -> Path:
        """Save the specimen; see `SpecimenStore.save` for arguments and errors."""
        self._check_thread()
        picture = None if self.picture is None else self.picture()
        file = self.store.save(self.measured_state, path, overwrite=overwrite, thumbnail=picture)
        self._clean = self.state
        self.saved.emit(file)
        self._announce_dirty()
        return file

    def close(self, *, discard: bool = False) -> None:
        """Release journal, locks and scan.

        Unsaved edits stay in the journal, and are offered at the next start, unless they were given up by
        `abandon`, or all are to `discard`.
        """
        self.store.close(keep_journal=self._keeps_edits and not discard)
        self._volume = self.measure = None


def _loaded(specimen: SpecimenState | LoadedSpecimen) -> LoadedSpecimen:
    return LoadedSpecimen(History(specimen)) if isinstance(specimen, SpecimenState) else specimen


def _with_head_shown(state: SpecimenState, shown: bool) -> SpecimenState:
    head = state.head_frame
    return state if head is None else replace(state, head_frame=head.seen(shown))


def _labelling(state: SpecimenState) -> tuple[object, ...]:
    return state.observer, state.round, state.blind, tuple((o.observer, o.round) for o in state.others)


def _details(state: SpecimenState) -> tuple[object, ...]:
    return state.specimen, state.notes, state.volume, state.import_choices, state.pose_checks


def _location(file: Path, specimen: str) -> str:
    """Return where a specimen file is, without what its name says already."""
    shown = file.with_name(file.name.removesuffix(SUFFIX))
    shown = shown.parent if shown.name == specimen else shown
    home = Path(os.path.expanduser("~"))  # noqa: PTH111 - which has an answer where nobody has a home
    return str("~" / shown.relative_to(home)) if shown.is_relative_to(home) else str(shown)
