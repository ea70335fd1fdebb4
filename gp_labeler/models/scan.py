"""The scan of the specimen: reading it, attaching it, and the grey value at which its bone begins."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gp_core.landmarks.scan_evidence import ScanEvidence
from gp_core.landmarks.sets import LandmarkSet, Specimen
from gp_core.validation import FloatArray
from gp_labeler.document.opening import tidy_name
from gp_labeler.document.recent_files import RecentFiles
from gp_labeler.document.signals import Signal
from gp_labeler.document.specimen_document import SpecimenDocument, VolumeChangedError
from gp_labeler.document.specimen_edits import RenameSpecimen, SetThreshold
from gp_labeler.document.state import SpecimenState
from gp_labeler.imaging.bone_distance import scan_evidence
from gp_labeler.imaging.near_bone import near_bone
from gp_labeler.imaging.readers import ImportPlan
from gp_labeler.imaging.volume import Volume
from gp_labeler.jobs.runner import Jobs
from gp_labeler.jobs.scan import (
    CheckScan,
    Demo,
    InspectScan,
    MakeDemo,
    ProposeThreshold,
    ReadScan,
    ReadSlice,
    phantom_seed,
)
from gp_labeler.models.messages import Messages
from gp_labeler.models.view import ViewModel

__all__ = ["ScanModel"]

_CHECKING = "check scan"
_READING_SLICE = "read slice"
_PROPOSING = "mesh threshold"
"""Key of the job that looks for a threshold: the first part of making a mesh."""


class ScanModel:
    """Reads scans in the background, and attaches them to the document.

    Parameters
    ----------
    document : SpecimenDocument
        What a scan belongs to; when another specimen is loaded, its scan is read.
    view : ViewModel
        Its crosshair begins in the middle of the scan.
    jobs : Jobs
        Where scans are read.
    messages : Messages
        What the user is told by.
    recent : RecentFiles, optional
        Remembers what was opened.
    """

    opened = Signal(object)
    """The volume that was attached."""
    threshold_changed = Signal(object)
    """The threshold in effect, set or proposed; None while there is none."""
    threshold_previewed = Signal(object)
    """A threshold that is being tried out on the slices; None when that is over."""
    slice_read = Signal()
    """Slices that were shown coarsely can be shown whole; see `read_slice`."""
    import_asked = Signal(object)
    """An `ImportPlan` that needs answers: change its options, then `read` it."""
    differs = Signal(object, object)
    """(VolumeChangedError, Volume): the scan is not the one labelled; `accept` takes it nevertheless."""

    def __init__(
        self,
        document: SpecimenDocument,
        view: ViewModel,
        jobs: Jobs,
        messages: Messages,
        recent: RecentFiles | None = None,
    ) -> None:
        self.truth: Specimen | None = None
        """Where the features of a phantom really are."""
        self._document, self._view, self._jobs, self._messages = document, view, jobs, messages
        self._recent = recent
        self._proposed: float | None = None
        self._unchecked: Volume | None = None
        """A scan whose checksum is not known yet."""
        self._problem_told = False
        document.reset.connect(self._on_reset)
        document.loaded.connect(self._on_loaded)
        document.threshold_changed.connect(self._on_threshold)
        view.crosshair_changed.connect(self._on_crosshair)
        for ended in (jobs.done, jobs.failed, jobs.cancelled):
            ended.connect(self._on_job)

    # What is there

    @property
    def volume(self) -> Volume | None:
        """The scan, with its voxels; None before one is attached."""
        volume = self._document.volume
        return volume if isinstance(volume, Volume) else None

    @property
    def threshold(self) -> float | None:
        """The grey value at which bone begins: what the user set, else what was proposed."""
        chosen = self._document.state.threshold
        return self._proposed if chosen is None else chosen

    @property
    def evidence(self) -> Callable[[LandmarkSet], ScanEvidence] | None:
        """Tells how far the labels of a side are from the bone of this scan; None while there is none."""
        if self.volume is None or self.threshold is None or self.volume.voxels.problem:
            return None
        return partial(scan_evidence, self.volume, self.threshold)

    def near_bone(self, points: FloatArray) -> NDArray[np.bool_]:
        """Return which of (N, 3) scan positions lie within three voxels of bone; all, where there is none."""
        if self.volume is None or self.threshold is None or self.volume.voxels.problem:
            return np.ones(len(points), dtype=bool)
        return near_bone(self.volume, self.threshold, points)

    # Opening

    def open(self, path: str | PathLike[str], **options: Any) -> None:
        """Look into a scan, then read it as a new specimen; `import_asked` first where that needs answers."""
        ask = "spacing" not in options
        self._jobs.submit(InspectScan(path, options), lambda plan: self._take_plan(plan, ask), key="open")

    def read(self, plan: ImportPlan) -> None:
        """Read a scan as planned, as a new specimen."""
        self._jobs.submit(ReadScan(plan), self.begin, key="open")

    def open_demo(self, seed: int = 0, spacing: float = 0.2) -> None:
        """Make the phantom and open it as a new specimen."""
        self._jobs.submit(MakeDemo(seed, spacing), self._begin_demo, key="open")

    def begin(self, volume: Volume, *, join: bool = True) -> None:
        """Begin a new specimen on a scan that is in memory.

        Parameters
        ----------
        volume : Volume
            The scan.
        join : bool
            Whether a specimen that was touched without a scan gets it, and goes on.
        """
        name = tidy_name(volume.name)
        if not (join and self._document.lacks_scan):
            self._document.begin(name)
        elif self._document.state.specimen == SpecimenState().specimen:
            self._document.do(RenameSpecimen(name))
        self._attach(volume)
        if volume.path is not None and self._recent is not None:
            self._recent.add(volume.path)

    def find(self, path: str | PathLike[str]) -> None:
        """Say where the scan of this specimen is now, and read it from there."""
        self._document.relink(path)
        self._read_own()

    def accept(self, volume: Volume) -> None:
        """Go on with a scan that is not the one that was labelled."""
        self._attach(volume, accept_changes=True)

    # The threshold

    def preview_threshold(self, value: float | None) -> None:
        """Try a threshold out on the slices; None ends that."""
        self.threshold_previewed.emit(value)

    def set_threshold(self, value: float) -> None:
        """Set the bone threshold, one undoable edit."""
        self.threshold_previewed.emit(None)
        self._document.do(SetThreshold(float(value)))

    def _on_threshold(self, _: float | None) -> None:
        self._measure()
        self.threshold_changed.emit(self.threshold)

    def _take_proposal(self, threshold: float) -> None:
        self._proposed = threshold
        self._measure()
        self.threshold_changed.emit(self.threshold)

    def _measure(self) -> None:
        """Let what is saved and exported say how far it lies from bone as it is now."""
        self._document.measure = self.evidence

    # Inside

    def _take_plan(self, plan: ImportPlan, ask: bool) -> None:
        unsure = not plan.sides_known or len(plan.choices) > 1 or plan.is_unpacked_to_disk
        if plan.errors or (ask and unsure):
            self.import_asked.emit(plan)
        else:
            self.read(plan)

    def _begin_demo(self, demo: Demo) -> None:
        self.begin(demo.volume, join=False)
        self.truth = demo.specimen

    def _on_reset(self) -> None:
        self.truth = self._proposed = self._unchecked = None
        self._jobs.cancel(_PROPOSING, _CHECKING, _READING_SLICE)

    def _on_loaded(self, _: tuple[str, ...]) -> None:
        self._read_own()

    def _read_own(self) -> None:
        """Read the scan that the specimen refers to."""
        reference = self._document.state.volume
        if reference is None or self.volume is not None:
            return
        seed = phantom_seed(reference.name) if reference.path is None else None
        if seed is not None:
            self._jobs.submit(MakeDemo(seed, min(reference.spacing)), self._attach_demo, key="open")
            return
        if reference.path is None or self._document.volume_is_lost:
            where = f"is no longer at {reference.path}" if reference.path else "was never in a file"
            lost = f"The scan {reference.name} {where}. Locate it with File > Find scan."
            self._messages.say(lost, "warning")
            return
        job = InspectScan(reference.path, dict(self._document.state.import_choices))
        self._jobs.submit(job, self._read_known, key="open")

    def _read_known(self, plan: ImportPlan) -> None:
        self._jobs.submit(ReadScan(plan), self._attach, key="open")

    def _attach_demo(self, demo: Demo) -> None:
        self._attach(demo.volume)
        self.truth = demo.specimen

    def _attach(self, volume: Volume, *, accept_changes: bool = False) -> None:
        try:
            warnings = self._document.attach_volume(volume, accept_changes=accept_changes)
        except VolumeChangedError as error:
            self.differs.emit(error, volume)
            return
        for text in warnings:
            self._messages.say(text, "warning")
        self._view.set_crosshair(volume.extent.mean(axis=0))
        self._proposed = None
        self._unchecked = None if volume.known_checksum else volume
        self._problem_told = False
        if self._document.state.threshold is None:
            self._jobs.submit(ProposeThreshold(volume), self._take_proposal, key=_PROPOSING)
        self._measure()
        self.opened.emit(volume)

    # A scan that stays in its file

    def read_slice(self, x: int) -> None:
        """Read in the background what slices of one x need, unless that is being done; `slice_read` tells."""
        if self.volume is not None and not self._jobs.is_running(_READING_SLICE):
            self._jobs.submit(ReadSlice(self.volume, x), lambda _: self.slice_read.emit(), key=_READING_SLICE)

    def _on_job(self, _: object) -> None:
        """Check a new scan as soon as nothing else is to be done: it is read as a whole for that."""
        self._tell_problem()
        if self._unchecked is not None and not self._jobs.running:
            volume, self._unchecked = self._unchecked, None
            self._jobs.submit(CheckScan(volume), self._take_checksum, key=_CHECKING)

    def _take_checksum(self, checksum: str) -> None:
        volume = self.volume
        try:
            self._document.confirm_volume(checksum)
        except VolumeChangedError as error:
            self.differs.emit(error, volume)

    def _on_crosshair(self, _: object) -> None:
        self._tell_problem()

    def _tell_problem(self) -> None:
        """Say once what happened to the file of the scan; what is labelled stays, and can be saved."""
        volume = self.volume
        if volume is None or self._problem_told or (problem := volume.voxels.problem) is None:
            return
        self._problem_told = True
        self._measure()
        self._messages.say(
            f"The scan {volume.name} {problem}. Open it again. All labels are kept.", "warning"
        )
