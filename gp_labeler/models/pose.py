"""Touching and the pose: what to touch next, the estimate, how it is drawn, and the files it goes to."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import count
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from gp_core.errors import GpError
from gp_core.frames import RigidTransform
from gp_core.landmarks.features import EXTERNAL, RECOMMENDED, Side
from gp_core.pose.cochlea_pose import CochleaPose
from gp_core.pose.gate import GateReason, named_for_other_side, reasons_against_writing
from gp_core.pose.insertion_path import check_winding
from gp_core.pose.mixture import Hypothesis
from gp_core.pose.next_touch import TouchGain, gains
from gp_labeler.document import touching
from gp_labeler.document.edits import Edit
from gp_labeler.document.signals import Signal
from gp_labeler.document.specimen_document import SpecimenDocument
from gp_labeler.document.specimen_edits import RecordPoseCheck
from gp_labeler.document.state import PoseCheck
from gp_labeler.document.touch_edits import RecordTouch
from gp_labeler.document.touches import TouchHow, touch_name
from gp_labeler.jobs.pose import WarmFit, WarmJoint
from gp_labeler.jobs.runner import Jobs
from gp_labeler.models.atlas import AtlasModel
from gp_labeler.models.both_ears import BothEars
from gp_labeler.models.estimate import EstimateSettings, SideEstimate, verdict_on
from gp_labeler.models.messages import Messages
from gp_labeler.models.pose_estimator import PoseEstimator
from gp_labeler.models.pose_exports import InsertionPath, save_pose, says_its_state
from gp_labeler.models.view import ViewModel

__all__ = ["ORDER", "OverlayOptions", "PoseModel"]

CONFIRMED_MM = 1.0
"""Up to here a second touch of a feature confirms the first."""

_FIRST = (*RECOMMENDED, "ZL")
ORDER = (*_FIRST, *(code for code in EXTERNAL if code not in _FIRST))
"""The paper's six features first, as they give most of the pose; then IN, which tells the side; else ZL."""


@dataclass(frozen=True)
class OverlayOptions:
    """What of an estimate is drawn over bone and slices; the names of parts are those of `scene.pose_data`.

    Parameters
    ----------
    visible : bool
        Whether anything is; then landmarks go without their names, which would hide it.
    estimate, region, cochlea, truth, features, vectors, touches, tip, path, names : bool
        Origin and axis; where they are with 95 %; the outline of the cochlea; the labelled CO and axis; the
        atlas's features in this pose; from there to the labelled ones; the touched points; the tracked probe;
        the insertion path; names and errors.
    opacity : float
        From 0 to 1.
    """

    visible: bool = False
    estimate: bool = True
    region: bool = True
    cochlea: bool = True
    truth: bool = True
    features: bool = False
    vectors: bool = False
    touches: bool = True
    tip: bool = True
    path: bool = True
    names: bool = True
    opacity: float = 1.0


@dataclass(frozen=True)
class _Touched:
    """What was touched on the side in work, and on the other."""

    side: Side
    here: frozenset[str]
    there: frozenset[str]

    def was_moved(self, now: _Touched) -> bool:
        """Whether all touches of this side are those of the other one now."""
        return bool(self.here) and not self.there and not now.here and now.there == self.here


class PoseModel:
    """Keeps the estimate in step with document and atlas, and says what to touch next.

    Parameters
    ----------
    document : SpecimenDocument
        Holds the touches.
    atlas : AtlasModel
        What estimates are made by.
    view : ViewModel
        Brings touched points into view.
    jobs : Jobs
        Where compiled code is made ready.
    messages : Messages
        What the user is told by.
    """

    changed = Signal()
    """The estimate, or what it is made of, changed: ask `estimate` again."""
    target_changed = Signal(object)
    """The feature to touch next, or None where all are touched."""
    overlay_changed = Signal(object)
    """The `OverlayOptions`."""
    path_changed = Signal(object)
    """The `InsertionPath` that is carried to the estimate now, or None."""
    recorded = Signal(str)
    """Name of a touch of this side that was recorded just now: time for a sound."""

    def __init__(
        self,
        document: SpecimenDocument,
        atlas: AtlasModel,
        view: ViewModel,
        jobs: Jobs,
        messages: Messages,
    ) -> None:
        self._document, self._atlas, self._view = document, atlas, view
        self._jobs, self._messages = jobs, messages
        self._estimator = PoseEstimator()
        self._target: str | None = ORDER[0]
        self._overlay = OverlayOptions()
        self._skipped: frozenset[tuple[Side, str]] = frozenset()
        self._gains: tuple[SideEstimate, tuple[TouchGain, ...]] | None = None
        self._path: InsertionPath | None = None
        self._prepared = False
        self._confirmed: set[tuple[Side, str]] = set()
        self._seen = self._touched_now()
        self._on_atlas_changed()
        document.reset.connect(self._on_reset)
        for signal in (document.touches_changed, document.landmarks_changed):
            signal.connect(self._on_changed)
        document.edited.connect(self._on_edited)
        atlas.changed.connect(self._on_atlas_changed)

    # The estimate

    @property
    def settings(self) -> EstimateSettings:
        """What the user chose."""
        return self._estimator.settings

    @property
    def side(self) -> Side:
        """Side of the head that is touched."""
        return self.settings.side

    @property
    def estimate(self) -> SideEstimate | None:
        """The estimate of that side; None without an atlas or with fewer than three touches."""
        return self.of_side(self.side)

    def of_side(self, side: Side) -> SideEstimate | None:
        """Return the estimate of a side, as `estimate` does for the one that is touched."""
        return self._estimator.of_side(self._document.state, side)

    @property
    def ears(self) -> BothEars | None:
        """How the estimates of both ears agree; None where too little was touched of both in one frame."""
        return self._estimator.ears(self._document.state, self.side)

    @property
    def waiting_text(self) -> str:
        """What is missing for an estimate, in words; empty where there is one."""
        return self._estimator.waiting_text(self._document.state)

    @property
    def joint_ready(self) -> bool:
        """Whether JRMPC is compiled."""
        return self._estimator.joint_ready

    def set_joint_ready(self) -> None:
        """Say that JRMPC is compiled."""
        self._estimator.set_joint_ready()
        self._on_changed()

    def set_registration(self, side: Side, T_scan_tracker: RigidTransform | None) -> None:
        """Set the registration of a side, where it is known otherwise than from points; None removes it."""
        self._estimator.set_registration(side, T_scan_tracker)
        self._on_changed()

    def choose(self, **fields: Any) -> None:
        """Change `settings`; raises `GpError` for a value that is not allowed.

        The method ``jrmpc`` is made ready in the background first.
        """
        methods = fields.get("methods", self.settings.methods)
        if "jrmpc" in methods and not self.joint_ready:
            self._jobs.submit(WarmJoint(), lambda _: self.set_joint_ready(), key="joint")
        old_side = self.side
        if self._estimator.choose(**fields):
            self._on_changed()
        if self.side is not old_side:
            self._aim(self._first_untouched())

    def without(self, name: str) -> tuple[float, float] | None:
        """Return by how much the pose moves, mm and degrees, if a touch is left out, or taken in again."""
        return self._estimator.without(self._document.state, name)

    def record_verdict(self, verdict: str, *, by: str = "", note: str = "") -> PoseCheck:
        """Keep a person's verdict on the estimate, ``accept`` or ``reject``, in the specimen.

        Raises
        ------
        GpError
            There is no estimate, or the verdict is another word.
        """
        estimate, document = self.estimate, self._document
        if estimate is None or estimate.pose is None:
            raise GpError("there is no estimate to judge", remedy=self.waiting_text or None)
        who, now = by or document.author, document.now()
        check = PoseCheck(estimate.side, verdict, who, now, note, estimate.as_dict())
        document.do(RecordPoseCheck(check))
        return check

    def gains(self) -> tuple[TouchGain, ...]:
        """Return what one more touch would gain, the best first; empty without an estimate."""
        estimate = self.estimate
        if estimate is None or "robust" not in estimate.poses:
            return ()
        if self._gains is None or self._gains[0] is not estimate:
            settings, both = estimate.settings, self.ears if estimate.poses["robust"].of_both_ears else None
            found = gains(
                replace(estimate.touches, extra={}),
                estimate.atlas,
                probe_noise=settings.probe_noise,
                shared_error=settings.shared_error,
                ears=None if both is None else both.comparison,
            )
            self._gains = (estimate, found)
        return self._gains[1]

    def prepare(self) -> None:
        """Load what makes estimates quick, in the background, once; the first touch does this too."""
        if not self._prepared:
            self._prepared = True
            self._jobs.submit(WarmFit(), key="fit")

    # Touching

    @property
    def names(self) -> tuple[str, ...]:
        """What can be touched: the features in the order they are asked for, then the skull's."""
        known = self._touched() | self._document.state.skull.keys() | {self._target or ORDER[0]}
        return (*ORDER, *sorted(known - set(ORDER), key=_by_number))

    @property
    def next_skull(self) -> str:
        """Name of the first skull feature not yet touched, such as ``S1``."""
        touched = self._touched()
        return next(name for n in count(1) if (name := f"S{n}") not in touched)

    @property
    def target(self) -> str | None:
        """The feature to touch next."""
        return self._target

    @property
    def names_touched(self) -> frozenset[str]:
        """What is touched on this side, left out or not."""
        return self._touched()

    def set_target(self, name: str) -> None:
        """Choose what is touched next."""
        self._skipped -= {(self.side, name)}
        self._aim(name)

    def skip(self) -> None:
        """Go on to the next feature; this one comes again when all others are touched."""
        if self._target is not None:
            self._skipped |= {(self.side, self._target)}
            self._aim(self._first_untouched(after=self._target))

    def record(self, position: ArrayLike, how: TouchHow, *, name: str | None = None, **details: Any) -> None:
        """Record a touch of the target, or of a feature named; the next one becomes the target.

        Parameters
        ----------
        position : (3,) array_like, mm
            Tracker frame; scan frame where it was placed on the scan.
        how : TouchHow
        name : str, optional
        **details
            `source`, `n_samples` and `spread_mm` of `Touch`.

        Raises
        ------
        GpError
            Nothing is left to touch, or as `touching.record_touch`.
        """
        wanted = name or self.require_target()
        keep = self.keeps_earlier(wanted, position, how)
        if not touching.record_touch(self._document, self.side, wanted, position, how, keep=keep, **details):
            self.go_on(wanted)  # the very same touch once more

    def keeps_earlier(self, name: str, position: ArrayLike, how: TouchHow) -> bool:
        """Whether a new touch counts beside those of its feature that are there, or replaces them.

        It counts beside them while the feature is asked for again (`EstimateSettings.touches_each`). Beyond
        that, a touch of the tracked probe does where it confirms the one before, within 1 mm, or where there
        are several already; another one replaces them, as a correction does.
        """
        before = self._document.state.touches.get((self.side, touch_name(name)))
        on_scan = how is TouchHow.SCAN
        if before is None or how is TouchHow.TYPED or (before.frame == "scan") is not on_scan:
            return False
        if len(before.positions) < self.settings.touches_each:
            return True
        if TouchHow.TRACKED not in (how, before.how) or how is not before.how:
            return False
        apart_mm = float(np.linalg.norm(np.asarray(position, float) - np.mean(before.positions, axis=0)))
        return bool(before.earlier) or apart_mm <= CONFIRMED_MM

    def go_on(self, name: str) -> None:
        """Announce that a feature was touched, and go on to the next where it was the target."""
        self.recorded.emit(name)
        if name == self._target and not self._is_wanted(name):
            self._aim(self._first_untouched(after=name))

    def require_target(self) -> str:
        """Return the feature to touch next; raises `GpError` where all are touched."""
        if self._target is None:
            raise GpError("all features are touched", remedy="Select one to touch again.")
        return self._target

    def change_side(self) -> None:
        """Say that the touches are those of the other side, and go on there.

        Raises
        ------
        GpError
            The other side was touched too.
        """
        other = self.side.other
        touching.move_touches(self._document, self.side)
        self.choose(side=other)

    @property
    def swapped(self) -> tuple[str, str] | None:
        """Two touched features that look, or may be, as if each had the other's name, by any method."""
        poses = () if self.estimate is None else self.estimate.poses.values()
        return next((pose.swapped for pose in poses if pose.swapped is not None), None)

    @property
    def misnamed(self) -> tuple[str, ...]:
        """Files of this side's touches that are named for the other one, unless `confirm_side` was told."""
        files = touching.misnamed_files(self._document, self.side)
        return tuple(file for file in files if (self.side, file) not in self._confirmed)

    def confirm_side(self) -> None:
        """Say that the touches are of this side, whatever their files are named."""
        self._confirmed |= {(self.side, file) for file in self.misnamed}
        self.changed.emit()

    @property
    def file_warnings(self) -> tuple[GateReason, ...]:
        """What the names of its files say against the side of the touches."""
        return tuple(named_for_other_side(file, self.side) for file in self.misnamed)

    def swap_names(self) -> None:
        """Give each of these two the other's name; raises `GpError` where none look so."""
        if self.swapped is None:
            raise GpError("no two touches look exchanged")
        touching.swap_touches(self._document, self.side, *self.swapped)

    def take_likelier(self) -> Hypothesis | None:
        """Read the touches as they are likeliest to be meant; None where that is how they are named.

        Raises
        ------
        GpError
            They would go to the other side, which was touched too.
        """
        pose = None if self.estimate is None else self.estimate.poses.get("robust")
        best = None if pose is None else pose.likelier_hypothesis
        if best is None:
            return None
        if best.exchanged is not None:
            touching.swap_touches(self._document, self.side, *best.exchanged)
        else:
            self.change_side()
        return best

    def show(self, name: str) -> None:
        """Bring a touched point into view in every view; nothing happens where it is not in the scan."""
        estimate, touch = self.estimate, self._document.state.touches.get((self.side, name))
        registered = None if estimate is None else estimate.registered
        if touch is None or (registered is None and touch.frame != "scan"):
            return
        position = np.array(touch.position)
        if registered is not None:
            position = registered.T_scan_touches.apply(position[None])[0]
        self._view.show_point(position)

    def load(self, path: str | PathLike[str]) -> None:
        """Take the touches of a file for this side in place of those there are."""
        warnings = touching.load_touches(self._document, path, self.side)
        self._aim(self._first_untouched())
        taken = f"Read {len(self._touched())} touches from {Path(path).name}"
        self._messages.say(". ".join((taken, *warnings)), "warning" if warnings else "info")

    # What leaves

    def export(self, path: str | PathLike[str], *, accept_warnings: bool = False) -> Path:
        """Write the pose in the format that the file's name asks for; see `pose_exports.save_pose`.

        Parameters
        ----------
        path : path
        accept_warnings : bool
            Write a file that a robot could run although side or names are in doubt, and nobody has accepted
            the estimate. The pose's JSON, which says its state, is written in any case.

        Raises
        ------
        GpError
            It is in doubt, or as `save_pose`.
        """
        pose = self._pose()
        if not (accept_warnings or says_its_state(path)):
            self._check_writable(pose, path)
        file = save_pose(pose, path)
        self._messages.say(f"Wrote {file.name}, y to the {pose.round_window} round window")
        self._messages.wrote.emit("pose", file)
        return file

    def carry(self, path: InsertionPath | None) -> None:
        """Carry an insertion path to the estimate, or none any more; raises `GpError` where it cannot be."""
        if path is not None:
            check_winding(path.points, path.side)
        self._path = path
        self.path_changed.emit(path)
        self.changed.emit()

    @property
    def path(self) -> InsertionPath | None:
        """The insertion path that goes with the estimate."""
        return self._path

    def save_path(self, path: str | PathLike[str]) -> Path:
        """Write the carried insertion path in the frame of the touches.

        Raises
        ------
        GpError
            There is none, the pose is in doubt as for `export`, or the file cannot be written.
        """
        if self._path is None:
            raise GpError(
                "there is no insertion path",
                remedy="Choose Estimate > Export and report > Insertion path first.",
            )
        self._check_writable(self._pose(), path)
        assert self.estimate is not None
        file = self._path.save_carried(self.estimate, path)
        self._messages.say(f"Wrote {file.name}")
        self._messages.wrote.emit("path", file)
        return file

    def _check_writable(self, pose: CochleaPose, path: str | PathLike[str]) -> None:
        """Refuse to write for a robot what is in doubt, unless a person has accepted this very estimate."""
        reasons = (*reasons_against_writing(pose), *self.file_warnings)
        estimate = self.estimate
        accepted = estimate is not None and verdict_on(estimate, self._document.state) == "accept"
        if reasons and not accepted:
            raise GpError(
                f"not written, as {' and '.join(reason.text for reason in reasons)}",
                file=path,
                remedy="Correct the touches, or accept the estimate (script: accept_warnings = true).",
            )

    def _pose(self) -> CochleaPose:
        estimate = self.estimate
        if estimate is None or estimate.pose is None:
            raise GpError("there is no estimate yet", remedy=self.waiting_text or None)
        return estimate.pose

    # Drawing

    @property
    def overlay(self) -> OverlayOptions:
        """What is drawn of the estimate."""
        return self._overlay

    def draw(self, **fields: Any) -> None:
        """Change `OverlayOptions`."""
        options = replace(self._overlay, **fields)
        if options != self._overlay:
            self._overlay = options
            self.overlay_changed.emit(options)

    # Inside

    def _on_reset(self) -> None:
        self._estimator.forget_registrations()
        self._skipped, self._seen = frozenset(), self._touched_now()
        self._confirmed.clear()
        self._aim(self._first_untouched())
        self.changed.emit()

    def _on_atlas_changed(self) -> None:
        if self._atlas.current is not None:
            self._estimator.use_atlas(self._atlas.current, self._atlas.specimens)
            self._on_changed()

    def _on_changed(self, *_: object) -> None:
        if self._document.state.touches:
            self.prepare()
        self._follow_touches()
        self.changed.emit()

    def _on_edited(self, edit: Edit, _: bool) -> None:
        if isinstance(edit, RecordTouch) and edit.side is self.side:
            self.go_on(edit.name)

    def _follow_touches(self) -> None:
        """Ask again for what was undone or cleared, and go on where the target was touched."""
        before, self._seen = self._seen, self._touched_now()
        if before.side is not self.side:
            return
        if before.was_moved(self._seen):  # undone or redone: else the side in work would look cleared
            self.choose(side=self.side.other)
            return
        lost, gained = before.here - self._seen.here, self._seen.here - before.here
        if lost:
            self._aim(next(name for name in (*ORDER, *sorted(lost, key=_by_number)) if name in lost))
        elif self._target is None or (self._target in gained and not self._is_wanted(self._target)):
            self._aim(self._first_untouched(after=self._target))

    def _touched(self, side: Side | None = None) -> frozenset[str]:
        wanted = side or self.side
        return frozenset(name for side, name in self._document.state.touches if side is wanted)

    def _is_wanted(self, name: str) -> bool:
        """Whether a feature is to be touched, or touched again."""
        touch = self._document.state.touches.get((self.side, name))
        return touch is None or len(touch.positions) < self.settings.touches_each

    def _touched_now(self) -> _Touched:
        return _Touched(self.side, self._touched(), self._touched(self.side.other))

    def _first_untouched(self, after: str | None = None) -> str | None:
        start = ORDER.index(after) + 1 if after in ORDER else 0
        around: Iterable[str] = (*ORDER[start:], *ORDER[:start])
        left = [code for code in around if self._is_wanted(code)]
        fresh = [code for code in left if (self.side, code) not in self._skipped]
        return next(iter(fresh or left), None)

    def _aim(self, name: str | None) -> None:
        if name != self._target:
            self._target = name
            self.target_changed.emit(name)


def _by_number(name: str) -> tuple[str, int, str]:
    """Sort S2 before S10."""
    letters = name.rstrip("0123456789")
    return letters, int(name[len(letters) :] or 0), name
