"""Writing down what a person does in the window as a script for ``gp-labeler --offscreen``."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from qtpy.QtCore import QObject

from gp_core.atlas.labelling_error import LabellingError
from gp_core.disk import write_text
from gp_core.landmarks.features import Side
from gp_core.pose.systematic_error import DEFAULT_SHARED_ERROR_MM
from gp_labeler.document.edit_tables import Table, script_table
from gp_labeler.document.edits import Edit
from gp_labeler.document.history import History
from gp_labeler.document.import_edit import ImportLandmarks
from gp_labeler.document.landmark_export import FORMATS, ExportReport
from gp_labeler.document.opening import tidy_name
from gp_labeler.document.specimen_edits import RecordPoseCheck
from gp_labeler.document.specimen_file import SUFFIX, write_specimen
from gp_labeler.document.specimen_json import document_of
from gp_labeler.document.state import SpecimenState
from gp_labeler.imaging.volume import Volume
from gp_labeler.jobs.contact_sheet import MakeContactSheets
from gp_labeler.jobs.library_check import CheckLibrary
from gp_labeler.jobs.mesh import SaveMesh
from gp_labeler.jobs.runner import Task
from gp_labeler.models.added_meshes import AddedMesh
from gp_labeler.models.pose import OverlayOptions
from gp_labeler.models.pose_exports import InsertionPath
from gp_labeler.models.view import ViewState
from gp_labeler.scene.pose_data import PARTS
from gp_labeler.views.signals import follow

if TYPE_CHECKING:
    from gp_labeler.views.main_window import MainWindow

__all__ = ["LOOKS", "Recorder", "script_text"]

_PHANTOM = "phantom-"
_PLAIN = (str, int, float, bool, list, tuple)
"""Kinds of options that a script can hold."""

LOOKS = (
    *("view.reset", "view.projection", "view.from_", "view.cut_", "view.slices_visible"),
    *("view.frame", "view.straight_planes"),
    *("pose.along_axis", "pose.through_window"),
)
"""Commands, or beginnings of their names, that change only what is seen: taken down as they are."""

_OF_THE_ACTIVE_FEATURE = ("view.zoom_to_point", "view.cut_open", "view.plane_")
"""Commands, or beginnings of their names, that a script must choose a feature for."""

_VIEW_KEYS = {
    "layout": "layout",
    "mesh_opacity": "opacity",
    "outline_visible": "outline",
    "hidden_visible": "hidden",
    "labels_visible": "names",
    "ghosts_visible": "ghosts",
    "axis_visible": "axes",
    "auto_advance": "advance",
    "follow_ghost": "follow",
}


class Recorder(QObject):
    """Takes steps down from now on, until it is deleted.

    What is written is what was done, not how the hand moved: a point is put where it came to lie, to the last
    digit, and a command is run. So a script leaves the same files as the person did, times aside. Where
    recording begins in the middle of the work, and where something is undone that was done before, the
    specimen as it stood then is written beside the script, which opens it.

    Parameters
    ----------
    window : MainWindow
        The window; owns it.
    """

    def __init__(self, window: MainWindow) -> None:
        super().__init__(window)
        self._window, workspace = window, window.workspace
        self.tables: list[Table] = []
        self._starts: list[tuple[Table, SpecimenState]] = []
        self._replayed = History(workspace.document.state)
        self._meshes: dict[str, AddedMesh] = {}
        self._pair = workspace.measure.pair
        self._begin()
        self._take_as_here()
        for signal, slot in (
            (workspace.scan.opened, self._on_volume),
            (workspace.document.edited, self._on_edited),
            (workspace.document.stepped, self._on_stepped),
            (workspace.document.saved, self._on_saved),
            (workspace.messages.wrote, self._on_wrote),
            (workspace.jobs.done, self._on_job),
            (workspace.atlas.changed, self._on_atlas),
            (workspace.pose.path_changed, self._on_path),
            (workspace.references.changed, self._on_references),
            (workspace.meshes.changed, self._on_meshes),
            (workspace.measure.changed, self._on_measure),
            (workspace.view.changed, self._on_view_changed),
            (workspace.view.planes_turned, self._on_planes_turned),
            (workspace.document.author_changed, self._on_observer),
            (workspace.atlas.labelling_error_changed, self._on_labelling_error),
            (workspace.interaction.tool_changed, self._on_tool),
            (workspace.pose.overlay_changed, self._on_overlay),
        ):
            follow(self, signal, slot)
        window.commands.done.connect(self._on_command)

    def save(self, path: Path) -> None:
        """Write the script, ``.toml`` or ``.json``, and the specimens that it begins with beside it.

        Raises
        ------
        GpError
            It cannot be written.
        """
        for n, (table, state) in enumerate(self._starts, start=1):
            file = path.with_name(f"{path.stem}_start{n}{SUFFIX}")
            write_specimen(file, state)
            table["labels"] = file.name
        is_json = path.suffix.lower() == ".json"
        write_text(path, json.dumps(self.tables, indent=1) + "\n" if is_json else script_text(self.tables))

    # Where it begins

    def _begin(self) -> None:
        """Write how to come to where the specimen stands now."""
        workspace = self._window.workspace
        self._replayed = History(workspace.document.state)
        state, volume = workspace.document.state, workspace.scan.volume
        fresh = SpecimenState() if volume is None else SpecimenState(tidy_name(volume.name))
        is_fresh = replace(state, volume=None, import_choices={}) == fresh
        if volume is None and is_fresh and not self.tables:
            return
        scan = {"empty": True} if volume is None else _scan(volume)
        table = step("open", **scan, discard=bool(self.tables))
        if not is_fresh:
            self._starts.append((table, state))  # what is done already goes into a file
        self.tables.append(table)
        self._show_as_here()

    def _show_as_here(self) -> None:
        """Write how this person's window differs from one that nobody has used yet."""
        window, state = self._window, self._window.workspace.view.state
        differing = {name for name in vars(state) if getattr(state, name) != getattr(ViewState, name)}
        theme = None if window.theme_name == "dark" else window.theme_name
        text_size = None if window.text_size == 100 else window.text_size
        size = [window.width(), window.height()]
        self.tables.append(step("view", size=size, theme=theme, text_size=text_size) | self._seen(differing))

    def _take_as_here(self) -> None:
        """Write who labels, which atlas is in use, and which insertion path is carried."""
        workspace = self._window.workspace
        if workspace.document.author:
            self._on_observer(workspace.document.author)
        if workspace.atlas.current is not None and not workspace.atlas.is_published:
            self._on_atlas()
        self._on_path(workspace.pose.path)
        if workspace.references.points:
            self._on_references()
        self._on_meshes()

    def _on_observer(self, name: str) -> None:
        self.tables.append(step("observer", name=name))

    def _on_labelling_error(self, error: LabellingError | None) -> None:
        reliability = self._window.workspace.reliability
        if error is not None and reliability.is_used:
            specimens = [str(path.absolute()) for path in reliability.paths]
            self.tables.append(step("reliability", specimens=specimens, use=True))
        elif error is None:
            self.tables.append({"do": "reliability", "use": False})

    def _on_volume(self, _: Volume) -> None:
        self._begin()

    # What is done

    def _on_edited(self, edit: Edit, merge: bool) -> None:
        now, before = self._window.workspace.document.state, self._replayed.state
        if _untimed(now) == _untimed(before):
            return
        tables = self._steps_of(edit)
        if not tables:
            self._begin()
            return
        continues = merge and self._is_last(edit)
        self._replayed.push(edit.text, now, merge=merge)
        if continues:  # one gesture, which ends here
            self.tables[-1] |= tables[-1]
        else:
            self.tables += [table | {"merge": True} for table in tables] if merge else tables

    def _steps_of(self, edit: Edit) -> list[Table]:
        """Return an edit as steps: as itself, or as what reads its files or judges the estimate again."""
        if isinstance(edit, ImportLandmarks) and edit.asked is not None:
            asked = {key: value for key, value in edit.asked.items() if key != "names" or value}
            return [step("import", **asked, keep=not edit.replace_placed)]
        if isinstance(edit, RecordPoseCheck):
            check = edit.check
            said = {"verdict": check.verdict, "by": check.by, "note": check.note or None}
            return [*self._estimated([]), step("verdict", side=check.side.value, **said)]
        table = script_table(edit)
        return [] if table is None else [table]

    def _is_last(self, edit: Edit) -> bool:
        """Whether the last step is an edit of the same text, which this one may continue."""
        last = self._replayed.to_undo
        return last is not None and last.text == edit.text and self.tables[-1]["do"] == edit.do

    def _estimated(self, files: list[str]) -> list[Table]:
        """Return the steps that lead to the estimate as it is set up here, and write it into files."""
        pose = self._window.workspace.pose
        settings, side = pose.settings, pose.side.value
        window = None if settings.round_window == "touched" else settings.round_window
        how = step(
            "estimate",
            side=side,
            method=list(settings.methods),
            probe_noise=settings.probe_noise,
            shared_error=None if settings.shared_error == DEFAULT_SHARED_ERROR_MM else settings.shared_error,
            round_window=window,
            both_ears=settings.both_ears,
            midline=list(settings.midline) or None,
        )
        is_fitted = pose.estimate is not None and pose.estimate.registered is not None
        register = [step("register", side=side, by=settings.registration)] if is_fitted else []
        return [*register, {**how, "path": files}]

    def _on_stepped(self, kind: str) -> None:
        now, replayed = _untimed(self._window.workspace.document.state), self._replayed
        if now == _untimed(replayed.state):
            return
        upcoming = replayed.to_undo if kind == "undo" else replayed.to_redo
        if upcoming is None or _untimed(upcoming.state) != now:
            self._begin()  # it was done before recording began
            return
        (replayed.undo if kind == "undo" else replayed.redo)()
        self.tables.append(step("undo") if kind == "undo" else step("action", id="edit.redo"))

    def _on_command(self, id: str) -> None:
        if id == "file.new":
            self._begin()
        elif id == "view.fit_here":
            self.tables.append(step("view", reset=self._window.grid.name_here))
        elif id == "view.go_to":
            self.tables.append(step("view", go_to=self._window.workspace.view.crosshair.tolist()))
        elif id.startswith(_OF_THE_ACTIVE_FEATURE):
            active = self._window.workspace.labels.active
            if active.code is not None:
                self.tables.append(step("choose", feature=active.code, side=active.side.value))
            self.tables.append(step("action", id=id))
        elif id.startswith(LOOKS):
            self.tables.append(step("action", id=id))
        elif id == "view.theme":
            self.tables.append(step("view", theme=self._window.theme_name))
        elif id.startswith("view.text_"):
            self.tables.append(step("view", text_size=self._window.text_size))

    def _on_planes_turned(self, view: str, angle: float) -> None:
        where = [float(x) for x in self._window.workspace.view.crosshair]
        self.tables.append(step("view", go_to=where, turn={view: float(np.degrees(angle))}))

    def _on_tool(self, tool: str) -> None:
        id = {"touch": "pose.touch", "turn": "head.by_hand"}.get(tool, f"tool.{tool}")
        self.tables.append(step("action", id=id))

    def _on_overlay(self, options: OverlayOptions) -> None:
        estimate = self._window.workspace.pose.estimate
        if not options.visible:
            self.tables.append({"do": "overlay", "visible": False})
        elif estimate is not None and estimate.in_scan() is not None:
            parts = [part for part in PARTS if getattr(options, part)]
            side = estimate.side.value
            self.tables.append(step("overlay", side=side, parts=parts, opacity=options.opacity))

    def _on_view_changed(self, changed: frozenset[str]) -> None:
        seen = self._seen(changed)
        if seen and self.tables and self.tables[-1].keys() == {"do", *seen} and len(seen) == 1:
            self.tables[-1] |= seen  # a slider on its way
        elif seen:
            self.tables.append({"do": "view", **seen})

    def _seen(self, changed: frozenset[str] | set[str]) -> Table:
        """Return keys of a step ``view`` for these fields."""
        state = self._window.workspace.view.state
        seen = {key: getattr(state, name) for name, key in _VIEW_KEYS.items() if name in changed}
        if {"level", "width"} & changed:
            is_set = state.level is not None and state.width is not None
            seen["greys"] = [state.level, state.width] if is_set else "auto"
        if "slab" in changed:
            seen["slab"] = "off" if state.slab is None else {state.slab.mode: state.slab.mm}
        if "denoise" in changed:
            seen["denoise"] = state.denoise or "off"
        if "glyph_mm" in changed:
            seen["glyphs"] = "screen" if state.glyph_mm is None else state.glyph_mm
        return seen

    # What is written

    def _on_saved(self, file: Path) -> None:
        self.tables.append(step("save", path=Path(file).name))

    def _on_exported(self, report: ExportReport) -> None:
        names = [file.name for file in report.files]
        formats = [suffix for suffix in FORMATS if any(name.endswith(suffix) for name in names)]
        suggested = any("_suggested." in name for name in names)
        self.tables.append(step("export", formats=formats, suggested=suggested))

    def _on_wrote(self, what: str, file: Any) -> None:
        if what == "landmarks":
            self._on_exported(file)
            return
        if what == "picture":
            self.tables.append(step("screenshot", path=file.name))
            return
        if what == "measurements":
            self.tables.append(step("export_measurements"))
            return
        if what == "reliability":
            specimens = [str(path.absolute()) for path in self._window.workspace.reliability.paths]
            self.tables.append(step("reliability", specimens=specimens, path=[file.name]))
            return
        if what == "atlas":
            self.tables.append(step("action", id="atlas.save", files=[file.name]))
            return
        if what not in ("pose", "report", "path"):
            return  # contact sheets are recorded by their job; no step checks labels against each other
        self.tables += self._estimated([file.name] if what == "pose" else [])
        if what == "report":
            side = self._window.workspace.pose.side.value
            self.tables.append(step("report", side=side, path=file.name))
        elif what == "path":
            self.tables.append(step("path", save=file.name))

    def _on_atlas(self) -> None:
        workspace = self._window.workspace
        source = workspace.atlas.source
        if workspace.atlas.is_published:
            self.tables.append(step("atlas", path="published"))
        elif source is not None and source.file is not None:
            self.tables.append(step("atlas", path=str(source.file.absolute())))
        elif source is not None:
            how = {key: getattr(source, key) for key in ("keep_doubtful", "weigh_certainty")}
            specimens = [str(path.absolute()) for path in source.animals]
            self.tables.append(step("atlas", specimens=specimens, **how))

    def _on_path(self, path: InsertionPath | None) -> None:
        if path is not None:
            about = {"units": path.units, "side": path.side.value, "axes": path.axes, "rows": path.rows}
            self.tables.append(step("path", path=str(path.source.absolute()), **about))

    def _on_references(self) -> None:
        files = self._window.workspace.references.files
        self.tables.append({"do": "reference", "files": [str(file.absolute()) for file in files]})

    def _on_meshes(self) -> None:
        """Record the meshes that were added from files, and those that were removed."""
        shown = {mesh.name: mesh for mesh in self._window.workspace.meshes.meshes if mesh.file}
        for name in self._meshes.keys() - shown.keys():
            self.tables.append(step("remove_mesh", name=name))
        for name, mesh in shown.items():
            if self._meshes.get(name) is not mesh:
                options = {key: value for key, value in mesh.options.items() if isinstance(value, _PLAIN)}
                file = str(cast(Path, mesh.file).absolute())
                self.tables.append(step("add_mesh", file=file, name=name, options=options or None))
        self._meshes = shown

    def _on_measure(self) -> None:
        """Record which distance between landmarks is drawn."""
        pair = self._window.workspace.measure.pair
        if pair != self._pair:
            side = (pair or self._pair or (Side.LEFT,))[0]
            self.tables.append(
                step("show_distance", side=side.value, features=list(pair[1:]) if pair else [])
            )
            self._pair = pair

    def _on_job(self, task: Task[Any]) -> None:
        if isinstance(task.job, SaveMesh):
            self.tables.append(step("mesh", save=Path(task.job.path).name))
        elif isinstance(task.job, MakeContactSheets):
            self.tables.append(self._sheets_made(task.job))
        elif isinstance(task.job, CheckLibrary):
            labelled = [str(file.absolute()) for file in task.job.files]
            self.tables.append(step("check_library", labelled=labelled, path=task.job.where.name))

    def _sheets_made(self, job: MakeContactSheets) -> Table:
        """Return the step that makes these contact sheets; of the open one as a script saves it."""
        is_open = job.files == (self._window.workspace.document.path,)
        specimens = None if is_open else [str(file.absolute()) for file in job.files]
        every = job.all_labellings
        return step("contact_sheet", specimens=specimens, path=job.where.name, all_labellings=every)


def step(do: str, **keys: Any) -> Table:
    """Return a step without the keys that say nothing."""
    said = {key: value for key, value in keys.items() if value is not None and value is not False}
    return {"do": do, **said}


def script_text(tables: list[Table]) -> str:
    """Return steps as TOML."""
    steps = ["\n".join(["[[step]]", *(f"{key} = {_toml(each)}" for key, each in t.items())]) for t in tables]
    return "\n\n".join(steps) + "\n"


def _toml(value: Any) -> str:
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{json.dumps(k)} = {_toml(v)}" for k, v in value.items()) + " }"
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(_toml(each) for each in value)}]"
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")


def _scan(volume: Volume) -> Table:
    """Return what a step ``open`` says of a scan."""
    if volume.path is None and volume.name.startswith(_PHANTOM):
        return {"phantom": int(volume.name.removeprefix(_PHANTOM)), "spacing": volume.spacing[0]}
    return {"path": volume.name if volume.path is None else str(volume.path), **volume.choices}


def _untimed(state: SpecimenState) -> Any:
    """Return what a specimen holds, without when it was done: a script does it at another time."""
    return _without_times(document_of(state))


def _without_times(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _without_times(each) for key, each in value.items() if key != "time"}
    return [_without_times(each) for each in value] if isinstance(value, (list, tuple)) else value
