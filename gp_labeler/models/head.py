"""How the head lies in its scan: finding it, turning the views into its frame, and what follows from it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from gp_core.errors import GpError
from gp_core.frames import RigidTransform
from gp_core.landmarks.features import Side, feature
from gp_core.landmarks.sets import LandmarkSet
from gp_core.validation import FloatArray, check_option
from gp_labeler.document.edits import as_position, point_text
from gp_labeler.document.head_edits import ClearHeadFrame, ConfirmLeft, SetHeadFrame
from gp_labeler.document.head_frame import HeadFrame
from gp_labeler.document.signals import Signal
from gp_labeler.document.specimen_document import SpecimenDocument
from gp_labeler.document.state import Position
from gp_labeler.head_pose import LEFT_OF_LANDMARKS, HeadPose, SeveralHeadsError
from gp_labeler.imaging.anatomical_frame import letter_of
from gp_labeler.imaging.volume import Volume
from gp_labeler.jobs.head import Straighten, StraightenByLandmarks, StraightenByPoints
from gp_labeler.jobs.runner import Job, Jobs, Task
from gp_labeler.models.messages import Messages
from gp_labeler.models.scan import ScanModel
from gp_labeler.models.view import ViewModel

__all__ = ["FREE_POINTS", "HeadModel"]

FREE_POINTS = ("midline", "left", "right")
"""Three points that need be no landmarks: one of the midline, and the same place on both sides."""

_KEY = "straighten"
_RESET_PLANES = "Choose View > Planes of the slices > Reset the planes first."
_WRONG_SIDE_MM = 1.0
"""A point that lies farther on the other side of the mid-plane is said to be there."""


class HeadModel:
    """Straightens the head: automatically, by points, by landmarks or by hand. Nothing of the scan changes.

    Parameters
    ----------
    document : SpecimenDocument
        Keeps the head frame.
    view : ViewModel
        Whose views are turned.
    scan : ScanModel
        Its bone is asked.
    jobs : Jobs
        Where the search runs.
    messages : Messages
        What the user is told by.
    """

    changed = Signal()
    """The head frame, what is running, the free points, the heads to choose from, or the last refusal."""

    def __init__(
        self,
        document: SpecimenDocument,
        view: ViewModel,
        scan: ScanModel,
        jobs: Jobs,
        messages: Messages,
    ) -> None:
        self._document, self._view, self._scan = document, view, scan
        self._jobs, self._messages = jobs, messages
        self._points: dict[str, Position] = {}
        self._awaited: tuple[object, bool] | None = None
        """File and order of slices of a scan that shall be straightened once it is open."""
        self.refusal = ""
        """Why the last attempt found nothing, and what to do; empty where it did."""
        self._warned: tuple[HeadFrame | None, tuple[str, ...]] = None, ()
        self.heads: tuple[Position, ...] = ()
        """Of a scan of several heads, a point in each, mm, until one was chosen; else nothing."""
        document.reset.connect(self._on_reset)
        document.head_frame_changed.connect(self.changed.emit)
        document.landmarks_changed.connect(self._on_landmarks)
        scan.opened.connect(self._on_opened)
        for signal in (jobs.started, jobs.done, jobs.cancelled):
            signal.connect(self._on_task)
        jobs.failed.connect(self._on_failed)

    # What is known

    @property
    def frame(self) -> HeadFrame | None:
        """How the head lies; None before it was straightened."""
        return self._document.state.head_frame

    @property
    def is_shown(self) -> bool:
        """Whether the views are in the head's frame."""
        return self._view.frame.name == "head"

    @property
    def is_running(self) -> bool:
        """Whether it is being straightened."""
        return self._jobs.is_running(_KEY)

    @property
    def asks_left(self) -> bool:
        """Whether it is still to be confirmed which side is left."""
        return self.frame is not None and not self.frame.left_confirmed

    @property
    def warnings(self) -> tuple[str, ...]:
        """What a person should look at in the head frame as it was found, until it is another."""
        frame, warnings = self._warned
        is_same = frame is not None and self.frame is not None and frame.matrix == self.frame.matrix
        return warnings if is_same else ()

    @property
    def points(self) -> Mapping[str, Position]:
        """The free points marked so far, scan mm."""
        return MappingProxyType(self._points)

    @property
    def head_names(self) -> tuple[str, ...]:
        """What each of several heads is called, such as ``Head 1 (towards R)`` of the scan."""
        middle = np.mean(self.heads, axis=0)
        letters = [letter_of(np.subtract(position, middle)) for position in self.heads]
        return tuple(f"Head {n} (towards {letter})" for n, letter in enumerate(letters, 1))

    @property
    def left_text(self) -> str:
        """Say which way left is, and that a person must know."""
        if self.frame is None:
            return ""
        towards = letter_of(self.frame.T_head_scan.rotation[0])
        source = self.frame.left if self.frame.left == LEFT_OF_LANDMARKS else "the file"
        return (
            f"According to {source}, left is towards {towards} of the scan; nothing in the scan can prove "
            "it, because a head and its mirror image look alike. Check it against a mark on the animal."
        )

    def wrong_sides(self, points: frozenset[tuple[Side, str]] | None = None) -> list[str]:
        """Return a sentence for each placed point that lies on the other side of the mid-plane.

        Parameters
        ----------
        points : set of (Side, str), optional
            Which are looked at; by default all.
        """
        found = []
        for side in Side:
            landmarks = self._document.landmarks(side)
            asked = [code for code in landmarks.placed if points is None or (side, code) in points]
            found += self._wrong_sides_of(landmarks, asked)
        return found

    def wrong_sides_in(self, landmarks: LandmarkSet) -> list[str]:
        """Return a sentence for each point that lies on the other side, of landmarks not taken over yet."""
        return self._wrong_sides_of(landmarks, landmarks.placed)

    def _wrong_sides_of(self, landmarks: LandmarkSet, codes: Iterable[str]) -> list[str]:
        if self.frame is None:
            return []
        found, side = [], landmarks.side
        for code in codes:
            if feature(code).shared or feature(code).computed:
                continue
            left = float(self.frame.heights(landmarks[code][None])[0])
            beyond = -left if side is Side.LEFT else left
            if beyond > _WRONG_SIDE_MM:
                text, other = point_text(side, code), side.other.word
                found.append(f"{text} lies {beyond:.1f} mm on the {other} of the mid-plane")
        return found

    # Straightening

    def straighten(self, near: ArrayLike | None = None, *, like: Path | None = None) -> None:
        """Find the head by the symmetry of its bone, in the background.

        Parameters
        ----------
        near : (3,) array_like, LPS mm, optional
            In a scan of several heads, a point in the one that is meant: the crosshair goes there, too.
        like : Path, optional
            Specimen file of a straightened head, which says which way is front and up, and the pitch; by
            default the synthetic guinea pig does.

        Raises
        ------
        GpError
            There is no scan, or `near` is no position.
        """
        point = None if near is None else as_position(near, "near")
        if point is not None:
            self._view.set_crosshair(point)
        self._submit(Straighten(self._volume(), self._document.state.threshold, point, like))

    def straighten_by_landmarks(self) -> None:
        """Find the head by the landmarks of both sides: IN and a pair, or two pairs."""
        sides = {side: self._document.landmarks(side) for side in Side}
        self._submit(StraightenByLandmarks(self._volume(), sides, self._scan.threshold))

    def mark_point(self, name: str, position: ArrayLike | None = None) -> None:
        """Mark one of `FREE_POINTS`, by default at the crosshair; once all three are there, straighten.

        Raises
        ------
        GpError
            There is no such point, or it is no position.
        """
        check_option(name, "point", FREE_POINTS)
        where = self._view.crosshair if position is None else position
        self._points[name] = as_position(where, name)
        self.changed.emit()
        if set(self._points) == set(FREE_POINTS):
            self.straighten_by_points()

    def straighten_by_points(self) -> None:
        """Find the head by the three free points; raises `GpError` where one is missing."""
        missing = [name for name in FREE_POINTS if name not in self._points]
        if missing:
            raise GpError(
                f"no point is marked for {' and '.join(missing)}", remedy="Mark it at the crosshair."
            )
        self._submit(StraightenByPoints(self._volume(), **self._points, threshold=self._scan.threshold))

    def forget_points(self) -> None:
        """Take the free points away."""
        self._points.clear()
        self.changed.emit()

    def cancel(self) -> None:
        """Stop straightening."""
        self._jobs.cancel(_KEY)
        self.changed.emit()

    def take_planes(self, *, merge: bool = False) -> None:
        """Take the planes of the views, as they were turned by hand, for those of the head.

        The mid-plane turns with them; before there is one, it is the sagittal slice through the crosshair.

        Raises
        ------
        GpError
            The views show planes along an ear, or not three planes at right angles.
        """
        if self._view.shows_anatomy:
            raise GpError("the views show planes of an ear, not the head frame", remedy=_RESET_PLANES)
        sagittal, coronal, axial = (self._view.planes[n] for n in ("sagittal", "coronal", "axial"))
        axes = np.stack([sagittal.normal, coronal.normal, axial.normal])
        if np.linalg.det(axes) < 1 - 1e-6:
            raise GpError("the three views are not perpendicular", remedy=_RESET_PLANES)
        origin = sagittal.origin if self.is_shown else self._view.crosshair
        self._take_by_hand(axes, origin, merge=merge)

    def take_mid_plane(self) -> None:
        """Move the mid-plane to the crosshair, in the directions of the views.

        Raises
        ------
        GpError
            The head is not straightened yet.
        """
        if self.frame is None:
            raise GpError("the head is not straightened yet", remedy="Choose View > Straighten the head.")
        axes = self.frame.T_head_scan.rotation
        away = float(self.frame.heights(self._view.crosshair[None])[0])
        origin = self.frame.T_head_scan.inverse().translation + away * axes[0]
        self._take_by_hand(axes, origin, merge=False)

    def turn(self, axis: str, angle: float) -> None:
        """Turn the head's frame about one of its own axes, through the crosshair.

        Parameters
        ----------
        axis : str
            ``pitch`` (about left), ``roll`` (about posterior) or ``yaw`` (about superior).
        angle : float
            Right-handed about that axis, rad.
        """
        check_option(axis, "axis", ("pitch", "roll", "yaw"))
        view = {"pitch": "sagittal", "roll": "coronal", "yaw": "axial"}[axis]
        if not self.is_shown and self.frame is not None:
            self.show(True)
        plane = self._view.planes[view]
        turned = -float(plane.towards_viewer @ plane.normal) * angle
        self._view.rotate_planes(view, turned)
        self.take_planes()

    def confirm_left(self) -> None:
        """Keep that a person knows left to be left."""
        self._document.do(ConfirmLeft())
        self._messages.say("Left is confirmed", "info")

    def reopen_mirrored(self) -> None:
        """Read the scan again with its slices in reverse order, as a new specimen; straighten it if it was.

        Raises
        ------
        GpError
            There is no scan, or it is not in a file.
        """
        volume = self._volume()
        if volume.path is None:
            raise GpError("only a scan in a file can be read again", remedy="Mirror it where it was made.")
        reverse = not volume.choices.get("reverse", False)
        self._awaited = None if self.frame is None else (volume.path, reverse)
        self._scan.open(volume.path, **{**volume.choices, "reverse": reverse})

    def take(self, pose: HeadPose, *, left_confirmed: bool = False) -> None:
        """Turn the views into the frame of a head that was found.

        Parameters
        ----------
        pose : HeadPose
        left_confirmed : bool
            Whether a person has just said which side is left.
        """
        left_is_known = left_confirmed or self._left_is_known
        frame = HeadFrame.of(pose.T_head_scan)
        self._document.do(
            SetHeadFrame(HeadFrame(frame.matrix, pose.found_by, pose.pitch, pose.left, left_is_known))
        )
        self._points.clear()
        self._warned = self.frame, pose.warnings
        words = [
            f"The head lies {pose.tilt_deg:.0f}° from the axes of its scan; the views are now aligned with it"
        ]
        if self.asks_left:
            words.append("confirm which side is left: 1 Scan > Head")
        self._messages.say("; ".join((*words, *pose.warnings)), "warning" if pose.warnings else "info")
        self._say_wrong_sides(None)
        self.changed.emit()

    def forget(self) -> None:
        """Remove the head frame."""
        self._document.do(ClearHeadFrame())

    # The views

    def show(self, on: bool | None = None) -> None:
        """Turn the views into the head's frame, or back into the scan's; by default the other one.

        Raises
        ------
        GpError
            The head is not straightened yet.
        """
        if self.frame is None:
            raise GpError("the head is not straightened yet", remedy="Choose View > Straighten the head.")
        self._document.show_head_frame(not self.is_shown if on is None else on)

    # Inside

    def _volume(self) -> Volume:
        volume = self._scan.volume
        if volume is None:
            raise GpError("there is no scan to straighten", remedy="Open one first.")
        return volume

    @property
    def _left_is_known(self) -> bool:
        """Whether a person has said which side is left: asked once, or when the scan was read in reverse."""
        volume = self._scan.volume
        reversed_by_hand = volume is not None and bool(volume.choices.get("reverse"))
        return reversed_by_hand or (self.frame is not None and self.frame.left_confirmed)

    def _submit(self, job: Job[HeadPose]) -> None:
        self.refusal, self.heads = "", ()
        self._jobs.submit(job, self.take, key=_KEY)

    def _take_by_hand(self, axes: FloatArray, origin: FloatArray, *, merge: bool) -> None:
        T_head_scan = RigidTransform.from_parts(axes, -axes @ origin, dst="head", src="scan")
        left = "" if self.frame is None else self.frame.left
        matrix = HeadFrame.of(T_head_scan).matrix
        head = HeadFrame(matrix, "hand", "by hand", left, self._left_is_known)
        self.refusal, self.heads = "", ()
        self._document.do(SetHeadFrame(head), merge=merge)

    def _on_reset(self) -> None:
        self._points.clear()
        self.refusal, self.heads = "", ()
        self.changed.emit()

    def _on_opened(self, volume: Volume) -> None:
        awaited, self._awaited = self._awaited, None
        if awaited == (volume.path, bool(volume.choices.get("reverse"))) and self.frame is None:
            self.straighten()

    def _on_landmarks(self, changed: frozenset[tuple[Side, str]]) -> None:
        self._say_wrong_sides(changed)

    def _say_wrong_sides(self, points: frozenset[tuple[Side, str]] | None) -> None:
        wrong = self.wrong_sides(points)
        if wrong:
            more = f" (and {len(wrong) - 1} more)" if len(wrong) > 1 else ""
            self._messages.say(f"{wrong[0]}{more}. Are left and right exchanged?", "warning")

    def _on_task(self, task: Task[Any]) -> None:
        if task.key == _KEY:
            self.changed.emit()

    def _on_failed(self, task: Task[Any]) -> None:
        if task.key != _KEY:
            return
        self.refusal = _without_file(task)
        if isinstance(task.error, SeveralHeadsError):
            self.heads = tuple(as_position(centre, "head") for centre in task.error.centres)
        self.changed.emit()


def _without_file(task: Task[Any]) -> str:
    """Return why a task failed and what to do; the file is the scan that is open."""
    error = task.error
    if not isinstance(error, GpError):
        return task.message
    return ". ".join(text.rstrip(".") for text in (error.problem, error.remedy) if text) + "."
