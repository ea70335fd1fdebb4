"""One desk: a session, the scan it lies on, the bone meshed from it, and the work that goes on behind.

It knows no Qt and draws nothing. The window, the offscreen script and plain Python all drive it, on one
thread; results of long work come back through the dispatcher it was given.
"""

from __future__ import annotations

import os
from os import PathLike
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from gp_core.atlas.atlas import Atlas
from gp_core.errors import GpError
from gp_core.landmarks.features import Side, feature
from gp_core.landmarks.sets import Specimen
from gp_core.terminal import printable
from gp_core.validation import FloatArray
from gp_labeler.document.atlas_memory import AtlasMemory
from gp_labeler.document.edits import SwapPoints, point_text, require_free
from gp_labeler.document.opening import new_session, open_session, recover_session, tidy_name
from gp_labeler.document.recent_files import RecentFiles
from gp_labeler.document.recovery import Recovery
from gp_labeler.document.specimen_document import VolumeChangedError
from gp_labeler.document.specimen_edits import RenameSpecimen
from gp_labeler.document.specimen_file import SUFFIX
from gp_labeler.document.state import How, SpecimenState, point_key
from gp_labeler.imaging.readers import ImportPlan
from gp_labeler.imaging.volume import Volume
from gp_labeler.jobs.runner import Dispatcher, Jobs, Task
from gp_labeler.jobs.work import Demo, InspectScan, MakeDemo, ReadScan, phantom_seed
from gp_labeler.models import labelling
from gp_labeler.models.added_meshes import AddedMeshes
from gp_labeler.models.atlas import AtlasDesk, expecting, is_atlas_file
from gp_labeler.models.bone_desk import BoneDesk
from gp_labeler.models.pose import PoseDesk
from gp_labeler.models.reference_points import ReferencePoints
from gp_labeler.models.session import Session
from gp_labeler.models.tracker import TrackerDesk

__all__ = ["TOOLS", "Drag", "Sight", "Workbench"]

TOOLS = ("place", "look", "grey", "touch")
"""What a plain left click or drag over a slice does: place, move the crosshair, grey window, touch."""


class Sight(Protocol):
    """What a window knows of what the user sees."""

    def can_judge(self, position: FloatArray) -> bool:
        """Whether a painted view shows a (3,) scan position with voxels at least two screen pixels wide."""

    def bring_close(self, position: FloatArray) -> None:
        """Show a (3,) scan position so closely that it can be judged."""


class Drag:
    """A placed or suggested point on its way: shown where the hand has it, and not yet an edit."""

    def __init__(self, side: Side, code: str, position: FloatArray, how: How) -> None:
        self.side, self.code, self.position, self.how = side, code, position, how


class Workbench(AtlasDesk, BoneDesk):
    """What one window works on; see the module.

    Its signals repeat those of whatever session is open; `session_replaced` says to look at everything anew.

    Parameters
    ----------
    directory : Path, optional
        State directory; None keeps no journal, no list of recent files, and does not remember the atlas.
    dispatcher : callable, optional
        Brings results of jobs to this thread.
    atlas : Atlas, optional
        Behind ghosts, doubts and poses; by default the one chosen last, loaded as a job by `load_atlas`.
    author : str, optional
        Who labels.
    """

    def __init__(
        self,
        directory: Path | None = None,
        dispatcher: Dispatcher | None = None,
        *,
        atlas: Atlas | None = None,
        author: str | None = None,
    ) -> None:
        self.directory = directory
        self.jobs = Jobs(dispatcher)
        self.recent = RecentFiles(directory) if directory else None
        self.atlas_memory = AtlasMemory(directory) if directory else None
        self.truth: Specimen | None = None  # of a phantom: where its features really are
        self.drag: Drag | None = None
        self.sight: Sight | None = None  # of the window, if there is one
        self.tool = "place"
        self.is_labelling = True  # whether a plain click may place
        self.replacing = False  # whether the next click moves the chosen point
        self._author = author
        self._last: tuple[Side, str] | None = None
        self._choices_since_edit = 0
        self._abandoned: SpecimenState | None = None
        self._copied: str | None = None  # of what this is a copy
        super().__init__(atlas)
        self.session: Session = new_session(directory, **self._session_options)
        self._follow(self.session)
        self.jobs.failed.connect(self._on_failed)
        self.landmarks_changed.connect(self._on_landmarks)
        self.volume_opened.connect(self._ask_scan)
        self.threshold_changed.connect(self._ask_scan)
        self.active_changed.connect(self._on_chosen)
        for signal in (self.active_changed, self.session_replaced, self.landmarks_changed):
            signal.connect(self._disarm)
        self.pose = PoseDesk(self)
        self.tracker = TrackerDesk(self)
        self.references = ReferencePoints(self)
        self.meshes = AddedMeshes(self)

    @property
    def _session_options(self) -> dict[str, Any]:
        """What every session begins with."""
        if self._atlas is None:
            return {"author": self._author}
        predicts, checks = expecting(self._atlas)
        return {"author": self._author, "predict": predicts, "check": checks}

    # What is there

    @property
    def in_use(self) -> bool:
        """Whether there is a specimen to work on and to keep: one with a scan, or one that was touched."""
        state = self.session.state
        return state.volume is not None or bool(state.touches)

    @property
    def lacks_scan(self) -> bool:
        """Whether the specimen was touched, and has no scan yet: the next one that is opened is its own."""
        return self.in_use and self.session.state.volume is None

    @property
    def place(self) -> str:
        """Where the specimen is kept, which tells two of one name apart; empty where it was never saved."""
        if self.session.path is None:
            return "" if self._copied is None else f"copy of {self._copied}"
        return _place(self.session.path, self.session.state.specimen)

    # Opening

    def open(self, path: str | PathLike[str], **options: Any) -> None:
        """Open a specimen file, an atlas file, or a scan as a new specimen."""
        if Path(path).name.endswith(SUFFIX):
            self.open_specimen(path)
        elif is_atlas_file(path):
            self.open_atlas(path)
        else:
            self.open_scan(path, **options)

    def open_scan(self, path: str | PathLike[str], **options: Any) -> None:
        """Look into a scan, then read it as a new specimen; `import_asked` first where that needs answers."""
        ask = "spacing" not in options
        self.jobs.submit(InspectScan(path, options), lambda plan: self._take_plan(plan, ask), key="open")

    def read_scan(self, plan: ImportPlan) -> None:
        """Read a scan as planned, as a new specimen."""
        self.jobs.submit(ReadScan(plan), self._begin_with, key="open")

    def open_specimen(
        self, path: str | PathLike[str], *, unsaved: str = "ask", as_copy: bool = False
    ) -> None:
        """Open a specimen file, and its scan; raises as `session.opening.open_session` does."""
        session = open_session(
            path, self.directory, unsaved=unsaved, as_copy=as_copy, **self._session_options
        )
        self._remember(path)
        copied = _place(Path(path).absolute(), session.state.specimen) if as_copy else None
        self._replace(session, copied=copied)

    def recover(self, recovery: Recovery) -> None:
        """Go on where a killed program stopped."""
        self._replace(recover_session(recovery, self.directory, **self._session_options))
        if recovery.content.damage:
            self.say(f"{recovery.content.damage}.", "warning")

    def open_demo(self, seed: int = 0, spacing: float = 0.2) -> None:
        """Make the phantom and open it as a new specimen."""
        self.jobs.submit(MakeDemo(seed, spacing), self._begin_demo, key="open")

    def open_volume(self, volume: Volume) -> None:
        """Begin a new specimen on a scan that is in memory already."""
        self._begin_with(volume)

    def begin(self) -> None:
        """Begin a new specimen without a scan, such as one that is only touched."""
        self._replace(new_session(self.directory, **self._session_options))

    def find_scan(self, path: str | PathLike[str]) -> None:
        """Say where the scan of this specimen is now, and read it from there."""
        self.session.relink(path)
        self._read_own_scan()

    def accept_scan(self, volume: Volume) -> None:
        """Go on with a scan that is not the one that was labelled."""
        self._attach(volume, accept_changes=True)

    def abandon(self) -> None:
        """Say that the unsaved edits so far are not wanted any more, once something else is opened."""
        self._abandoned = self.session.state

    # Working

    def set_tool(self, tool: str) -> None:
        """Choose what a left click over a slice does, one of `TOOLS`."""
        if tool not in TOOLS:
            raise GpError(f"tool must be one of {', '.join(TOOLS)}, got {tool!r}")
        if tool != self.tool:
            self.tool = tool
            self.tool_changed.emit(tool)

    def begin_labelling(self) -> None:
        """Let a click place points; who labels shall not see where an estimate wants the cochlea."""
        self.pose.draw(visible=False)
        self.is_labelling = True
        if self.tool != "grey":
            self.set_tool("place")

    def begin_looking(self) -> None:
        """Let clicks look, not place: outside the step Label, a click is not meant for a landmark."""
        self.is_labelling = False
        self.arm_replacing(False)
        if self.tool in ("place", "touch"):
            self.set_tool("look")

    def begin_judging(self) -> None:
        """Show the estimate, and let no click that is meant to look at it move a landmark."""
        is_touching = self.tool == "touch"
        self.pose.prepare()
        self.pose.draw(visible=True)
        self.begin_looking()
        if is_touching:
            self.set_tool("touch")

    def arm_replacing(self, on: bool = True) -> None:
        """Let the next click, and no other, move the chosen point, or think better of it.

        Raises
        ------
        GpError
            No placed or suggested point is chosen, or it is locked.
        """
        if on:
            active = self.session.active
            mark = None if active.code is None else self.session.state.landmark(active.side, active.code)
            if active.code is None or mark is None or mark.shown_position is None:
                raise GpError("no placed point is chosen to re-place", remedy="Choose one in the table.")
            require_free(self.session.state, [point_key(active.side, active.code)])
        if on != self.replacing:
            self.replacing = on
            self.replacing_changed.emit(on)

    def confirm(self, side: Side, code: str) -> bool:
        """Confirm a suggestion, or a ghost, that was drawn where it can be judged; else bring it there first.

        Returns
        -------
        bool
            Whether it is confirmed. Where not, the view shows it now, for the user to judge and confirm it.

        Raises
        ------
        GpError
            Nothing suggests where the point is, or it is locked.
        """
        session = self.session
        is_ghost = code in session.ghosts(side)
        where = labelling.place_of(session, side, code)
        if where is None or session.state.landmark(side, code).settled:
            point = point_text(side, code)
            raise GpError(f"{point} is not suggested, so there is nothing to confirm", landmark=code)
        if self._had_to_come_close(side, code, where):
            return False
        if is_ghost:
            labelling.accept_ghost(session, side=side, code=code)
        return labelling.confirm(session, side=side, code=code)

    def swap(self, side: Side, code: str, other: str) -> None:
        """Exchange two points of a side, and say which suggestions that drops."""
        swap = SwapPoints(side, code, other)
        told = swap.dropped_text(self.session.state)
        if self.session.do(swap) and told:
            self.say(told, "warning")

    def go_to(self, side: Side, code: str) -> None:
        """Choose a point, and bring it, or where it is suggested or expected, into sight in every view."""
        labelling.go_to(self.session, side, code)
        if labelling.place_of(self.session, side, code) is not None:
            self.point_shown.emit(self.session.crosshair)

    def nudged_point(self) -> tuple[Side, str] | None:
        """Return the point that arrow keys move: the chosen one, or the one of the last edit.

        That one is meant where the chosen one has no place, or is a suggestion that came up by itself.
        """
        active, last = self.session.active, self._last
        mark = None if active.code is None else self.session.state.landmark(active.side, active.code)
        is_last_placed = last is not None and self.session.state.landmark(*last).position is not None
        came_by_itself = mark is not None and mark.suggestion is not None and self._choices_since_edit <= 1
        has_place = mark is not None and mark.shown_position is not None
        if active.code is not None and has_place and not (came_by_itself and is_last_placed):
            return active.side, active.code
        return last if is_last_placed else None

    def nudge(self, offset: FloatArray) -> tuple[Side, str] | None:
        """Move that point by a (3,) offset, mm, scan frame; a suggestion only where it can be judged.

        Returns what was moved, None where nothing was; raises `GpError` where the point is locked.
        """
        target = self.nudged_point()
        if target is None:
            return None
        mark = self.session.state.landmark(*target)
        if mark.suggestion and self._had_to_come_close(*target, np.array(mark.suggestion.position)):
            return None
        labelling.nudge(self.session, offset, side=target[0], code=target[1])
        return target

    def _had_to_come_close(self, side: Side, code: str, where: FloatArray) -> bool:
        """Whether a suggestion could not be judged where it was seen, and so is shown from close by now."""
        active, sight = self.session.active, self.sight
        if sight is None or ((active.side, active.code) == (side, code) and sight.can_judge(where)):
            return False
        labelling.go_to(self.session, side, code)
        sight.bring_close(where)
        self.say(f"Is {point_text(side, code)} right here? Confirm it, or drag it to where it belongs")
        return True

    def begin_drag(self, side: Side, code: str) -> bool:
        """Take up a placed or suggested point; False where it cannot be moved."""
        mark = self.session.state.landmark(side, code)
        if mark.shown_position is None or mark.locked:
            return False
        is_placed = mark.position is not None and mark.provenance is not None
        how = mark.provenance.how if is_placed and mark.provenance else How.SLICE
        self.drag = Drag(side, code, np.array(mark.shown_position), how)
        self.dragged.emit(self.drag)
        return True

    def drag_to(self, position: FloatArray, how: How) -> None:
        """Show the point that is dragged somewhere else, (3,) mm, scan frame."""
        if self.drag is not None:
            self.drag.position, self.drag.how = np.array(position, dtype=np.float64), how
            self.session.set_crosshair(position)
            self.dragged.emit(self.drag)

    def end_drag(self, *, keep: bool = True) -> bool:
        """Let go of the point: one edit, or none where it was not moved or shall go back."""
        drag, self.drag = self.drag, None
        self.dragged.emit(None)
        if drag is None or not keep:
            return False
        here = self.session.state.landmark(drag.side, drag.code).shown_position
        if here is not None and np.allclose(here, drag.position, atol=1e-9):
            return False
        return labelling.place(self.session, drag.position, drag.how, side=drag.side, code=drag.code)

    def say(self, text: str, level: str = "info") -> None:
        """Tell the user something."""
        self.message.emit(printable(text), level)

    def close(self, *, discard: bool = False) -> None:
        """Stop all work and let go of journal and locks; see `Session.close`."""
        self.jobs.close()
        self.tracker.close()
        self._unfollow()
        self.session.close(discard=discard)
        self._bone.forget()

    # Inside

    def _take_plan(self, plan: ImportPlan, ask: bool) -> None:
        if plan.errors or (ask and not plan.sides_known) or (ask and len(plan.choices) > 1):
            self.import_asked.emit(plan)
        else:
            self.read_scan(plan)

    def _begin_demo(self, demo: Demo) -> None:
        self._begin_with(demo.volume, join=False)
        self.truth = demo.specimen

    def _begin_with(self, volume: Volume, *, join: bool = True) -> None:
        """Begin a specimen on a scan; one that was touched without a scan gets it, and goes on."""
        name = tidy_name(volume.name)
        if not (join and self.lacks_scan):
            self._replace(new_session(self.directory, specimen=name, **self._session_options))
        elif self.session.state.specimen == SpecimenState().specimen:
            self.session.do(RenameSpecimen(name))
        self._attach(volume)
        if volume.path is not None:
            self._remember(volume.path)

    def _replace(self, session: Session, *, copied: str | None = None) -> None:
        """Close one session and take another; the old one's unsaved edits stay in its journal."""
        self._unfollow()
        old, self.session = self.session, session
        kept = old.dirty and old.state is not self._abandoned  # edited since: a scan takes seconds to load
        old.close(discard=not kept)
        self._abandoned = None
        if kept and self.directory is not None:
            name = old.state.specimen
            self.say(f"Unsaved edits of {name} are kept, and offered at the next start", "warning")
        self._copied = copied
        self.truth = None
        self.drag = self._last = None
        self._bone.forget()
        session.view.update(**_kept(old.view.state))
        self._follow(self.session)
        self.session_replaced.emit(session)
        self.surfaces_changed.emit()
        for text in session.notices:
            self.say(text, "warning")
        self._read_own_scan()

    def _read_own_scan(self) -> None:
        reference = self.session.state.volume
        if reference is None or self.volume is not None:
            return
        seed = phantom_seed(reference.name) if reference.path is None else None
        if seed is not None:
            self.jobs.submit(MakeDemo(seed, min(reference.spacing)), self._attach_demo, key="open")
            return
        if reference.path is None or self.session.volume_is_lost:
            where = f"is not at {reference.path} any more" if reference.path else "was never in a file"
            self.say(f"The scan {reference.name} {where}. Use File > Find scan.", "warning")
            return
        job = InspectScan(reference.path, dict(self.session.state.import_choices))
        self.jobs.submit(job, self._read_known, key="open")

    def _attach_demo(self, demo: Demo) -> None:
        self._attach(demo.volume)
        self.truth = demo.specimen

    def _read_known(self, plan: ImportPlan) -> None:
        self.jobs.submit(ReadScan(plan), self._attach, key="open")

    def _attach(self, volume: Volume, *, accept_changes: bool = False) -> None:
        try:
            warnings = self.session.attach_volume(volume, accept_changes=accept_changes)
        except VolumeChangedError as error:
            self.scan_differs.emit(error, volume)
            return
        for text in warnings:
            self.say(text, "warning")
        self.session.set_crosshair(volume.extent.mean(axis=0))
        self._bone.begin(volume)
        self.volume_opened.emit(volume)

    def _remember(self, path: str | PathLike[str]) -> None:
        if self.recent is not None:
            self.recent.add(path)

    def _relay_threshold_changed(self, _: object) -> None:
        self._bone.mesh()
        self.threshold_changed.emit(self.threshold)

    def _on_landmarks(self, changed: frozenset[tuple[Side, str]]) -> None:
        touched = [point for point in changed if not feature(point[1]).computed]
        self._last = touched[0] if len({code for _, code in touched}) == 1 else None
        self._choices_since_edit = 0
        self._judge({side for side, _ in changed})
        self._bone.mesh_ears()

    def _ask_scan(self, *_: object) -> None:
        """Judge the labels by this scan, and by its bone as it is now."""
        self.session.set_measure(self.scan_evidence)
        self._judge(Side, after=0.0)

    def _on_chosen(self, _: object) -> None:
        self._choices_since_edit += 1

    def _disarm(self, *_: object) -> None:
        self.arm_replacing(False)

    def _on_failed(self, task: Task[Any]) -> None:
        self.say(task.message, "error")


def _place(file: Path, specimen: str) -> str:
    """Return where a specimen file is, without what its name says already."""
    shown = file.with_name(file.name.removesuffix(SUFFIX))
    shown = shown.parent if shown.name == specimen else shown
    home = Path(os.path.expanduser("~"))  # noqa: PTH111 - which has an answer where nobody has a home
    return str("~" / shown.relative_to(home)) if shown.is_relative_to(home) else str(shown)


def _kept(state: Any) -> dict[str, Any]:
    """Return how the user likes to look at things; grey window and camera belong to one specimen."""
    fields = dict(vars(state))
    for name in ("level", "width", "cut", "camera"):
        fields.pop(name)
    return fields
