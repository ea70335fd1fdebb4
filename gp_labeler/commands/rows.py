"""The rows of the table of commands, a menu at a time."""

from __future__ import annotations

from collections.abc import Iterator

from gp_core.landmarks.features import FEATURES
from gp_labeler.commands.action import IN_WINDOW, Action, Run, Test
from gp_labeler.commands.conditions import always, has_scan, has_tool
from gp_labeler.document.edits import CheckPoint, SwapSides
from gp_labeler.document.state import How, Landmark
from gp_labeler.document.touches import TouchHow
from gp_labeler.models.workspace import Workspace

__all__ = ["edit_rows", "file_rows", "help_rows", "landmark_rows", "view_rows"]

GLYPH_MM = 0.6
"""Diameter of points whose size is in mm."""


# When something can be done


def _lacks_scan(workspace: Workspace) -> bool:
    return workspace.scan.volume is None and workspace.document.state.volume is not None


def _in_use(workspace: Workspace) -> bool:
    return workspace.document.in_use


def _has_labels(workspace: Workspace) -> bool:
    return bool(workspace.document.state.landmarks)


def _mark(workspace: Workspace) -> Landmark | None:
    active = workspace.labels.active
    return None if active.code is None else workspace.document.state.landmark(active.side, active.code)


def _has_active(workspace: Workspace) -> bool:
    return _mark(workspace) is not None


def _is_free(workspace: Workspace) -> bool:
    mark = _mark(workspace)
    return mark is not None and not mark.locked


def _is_placed_or_unseen(workspace: Workspace) -> bool:
    mark = _mark(workspace)
    return mark is not None and mark.decided


def _is_placed(workspace: Workspace) -> bool:
    mark = _mark(workspace)
    return mark is not None and mark.position is not None


def _is_checked(workspace: Workspace) -> bool:
    mark = _mark(workspace)
    return mark is not None and mark.checked


def _is_locked(workspace: Workspace) -> bool:
    mark = _mark(workspace)
    return mark is not None and mark.locked


def _has_ghost(workspace: Workspace) -> bool:
    active = workspace.labels.active
    return active.code is not None and active.code in workspace.labels.ghosts(active.side)


def _is_suggested(workspace: Workspace) -> bool:
    mark = _mark(workspace)
    return mark is not None and mark.suggestion is not None


def _is_shown(workspace: Workspace) -> bool:
    return _is_placed(workspace) or _is_suggested(workspace)


def _can_confirm(workspace: Workspace) -> bool:
    return _is_free(workspace) and (_has_ghost(workspace) or _is_suggested(workspace))


def _can_place(workspace: Workspace) -> bool:
    """Whether placing the chosen point moves none that has a place already, or is asked for."""
    if not has_scan(workspace):
        return False
    if not workspace.interaction.replacing:
        if workspace.measure.kind is not None:
            return True
        if workspace.interaction.tool == "touch":
            return workspace.pose.target is not None
    return _is_free(workspace) and (workspace.interaction.replacing or not _is_shown(workspace))


# What is done


def _toggle(field: str) -> Run:
    def change(workspace: Workspace) -> None:
        workspace.view.update(**{field: not getattr(workspace.view.state, field)})

    return change


def _is_on(field: str) -> Test:
    return lambda workspace: bool(getattr(workspace.view.state, field))


def _set_layout(layout: str) -> Run:
    return lambda workspace: workspace.view.update(layout=layout)


def _has_layout(layout: str) -> Test:
    return lambda workspace: workspace.view.state.layout == layout


def _set_tool(tool: str) -> Run:
    return lambda workspace: workspace.interaction.set_tool(tool)


def _change_opacity(step: float) -> Run:
    def change(workspace: Workspace) -> None:
        opacity = min(max(workspace.view.state.mesh_opacity + step, 0.0), 1.0)
        workspace.view.update(mesh_opacity=round(opacity, 3))

    return change


def _toggle_glyphs(workspace: Workspace) -> None:
    is_mm = workspace.view.state.glyph_mm is not None
    workspace.view.update(glyph_mm=None if is_mm else GLYPH_MM)


def _auto_window_level(workspace: Workspace) -> None:
    workspace.view.update(level=None, width=None)


def _place_at_crosshair(workspace: Workspace) -> None:
    """Do at the crosshair what a click there does: place a landmark, an end of a ruler, or a touch."""
    where = workspace.view.crosshair
    if workspace.measure.kind is not None and not workspace.interaction.replacing:
        workspace.measure.click(where)
    elif workspace.interaction.tool == "touch" and not workspace.interaction.replacing:
        workspace.pose.record(where, TouchHow.SCAN)
    else:
        workspace.labels.place(where, How.SLICE)
        workspace.interaction.arm_replacing(False)


def _confirm(workspace: Workspace) -> None:
    active = workspace.labels.active
    if active.code is not None:
        workspace.interaction.confirm(active.side, active.code)


def _accept_or_confirm(workspace: Workspace) -> None:
    if _is_suggested(workspace):
        _confirm(workspace)
    else:
        workspace.labels.accept_ghost()


def _toggle_lock(workspace: Workspace) -> None:
    mark = _mark(workspace)
    workspace.labels.lock(mark is None or not mark.locked)


def _toggle_check(workspace: Workspace) -> None:
    active, mark = workspace.labels.active, _mark(workspace)
    if active.code is not None and mark is not None:
        workspace.document.do(
            CheckPoint(active.side, active.code, not mark.checked, workspace.document.author)
        )


def _all_locked(workspace: Workspace) -> bool:
    marks = [mark for mark in workspace.document.state.landmarks.values() if mark.decided]
    return bool(marks) and all(mark.locked for mark in marks)


def _step_point(step: int) -> Run:
    def go(workspace: Workspace) -> None:
        codes = [row.code for row in FEATURES if not row.computed]
        active = workspace.labels.active
        at = codes.index(active.code) if active.code in codes else -1 if step > 0 else 0
        workspace.labels.go_to(active.side, codes[(at + step) % len(codes)])

    return go


def _other_side(workspace: Workspace) -> None:
    active = workspace.labels.active
    if active.code is not None:
        workspace.labels.go_to(active.side.other, active.code)


# The rows: id, menu, title, keys, what is done, when it can be


# fmt: off
def file_rows() -> Iterator[Action]:
    """Return the commands of the menu File."""
    def row(id: str, title: str, keys: tuple[str, ...], run: Run | None, enabled: Test = always, *,
            hint: str = "", group: str = "", icon: str = "") -> Action:
        return Action(f"file.{id}", "File", title, keys, run, enabled, hint=hint, group=group, icon=icon)

    yield row("new", "New, without a scan", ("Ctrl+N",), IN_WINDOW,
              hint="A specimen with touches only; you can open its scan later", group="open")
    yield row("open", "Open…", ("Ctrl+O",), IN_WINDOW,
              hint="A scan or a saved specimen", group="open", icon="file")
    yield row("open_folder", "Open folder…", ("Ctrl+Shift+O",), IN_WINDOW,
              hint="A DICOM series or a stack of slices", group="open", icon="folder")
    yield row("demo", "Open the demo", (), IN_WINDOW,
              hint="A synthetic guinea-pig head for practice", group="open", icon="play")
    yield row("specimens", "Specimens…", ("Ctrl+Shift+L",), IN_WINDOW,
              hint="Specimens in your folders: progress, next unfinished, contact sheets", group="open")
    yield row("next_specimen", "Next unfinished specimen", (), IN_WINDOW,
              lambda w: bool(w.specimens.every), group="open")
    yield row("find_scan", "Find scan…", (), IN_WINDOW, _lacks_scan, group="open")
    yield row("save", "Save", ("Ctrl+S",), IN_WINDOW, _in_use, group="save", icon="save")
    yield row("save_as", "Save as…", ("Ctrl+Shift+S",), IN_WINDOW, _in_use,
              group="save")
    yield row("import", "Import landmarks…", ("Ctrl+I",), IN_WINDOW, has_scan,
              group="exchange", icon="import")
    yield row("export", "Export landmarks…", ("Ctrl+E",), IN_WINDOW, _has_labels,
              hint="For 3D Slicer and gp-core", group="exchange", icon="export")
    yield row("save_mesh", "Save bone surface…", (), IN_WINDOW,
              lambda w: bool(w.bone.surfaces), group="exchange")
    yield row("screenshot", "Save picture…", (), IN_WINDOW, group="exchange")
    yield row("show_references", "Show reference points…", (), IN_WINDOW, has_scan,
              hint="Points of any landmark list, shown in grey for comparison; not part of the specimen",
              group="references")
    yield row("clear_references", "Clear reference points", (), lambda w: w.references.clear(),
              lambda w: bool(w.references.points), group="references")
    yield row("add_mesh", "Add mesh…", (), IN_WINDOW, has_scan,
              hint="Show a surface from another program with the bone; not part of the specimen",
              group="references")
    yield row("remove_meshes", "Remove added meshes", (), lambda w: w.meshes.clear(),
              lambda w: bool(w.meshes.meshes), group="references")
    yield row("close", "Close", ("Ctrl+Q",), IN_WINDOW, group="close")


def edit_rows() -> Iterator[Action]:
    """Return the commands of the menu Edit."""
    def row(id: str, title: str, keys: tuple[str, ...], run: Run | None, enabled: Test, icon: str = "",
            hint: str = "") -> Action:
        group = "undo" if id in ("undo", "redo") else "swap"
        return Action(f"edit.{id}", "Edit", title, keys, run, enabled, hint=hint, group=group, icon=icon)

    yield row("undo", "Undo", ("Ctrl+Z",), lambda w: w.document.undo(),
              lambda w: w.document.undo_text is not None, "undo")
    yield row("redo", "Redo", ("Ctrl+Y", "Ctrl+Shift+Z"), lambda w: w.document.redo(),
              lambda w: w.document.redo_text is not None, "redo")
    yield row("swap", "Exchange with…", (), IN_WINDOW, _is_free, "swap",
              "For two points placed under each other's names")
    yield row("swap_sides", "Exchange left and right", (), lambda w: w.document.do(SwapSides()),
              _has_labels)


def view_rows() -> Iterator[Action]:
    """Return the commands of the menu View."""
    def row(id: str, title: str, keys: tuple[str, ...], run: Run | None, enabled: Test = always, *,
            checked: Test | None = None, group: str = "", hint: str = "", icon: str = "") -> Action:
        return Action(id, "View", title, keys, run, enabled, checked, hint, group, icon)

    for title, layout, key in _LAYOUTS:
        yield row(f"view.{layout}", title, (key,), _set_layout(layout), checked=_has_layout(layout),
                  group="layout")
    yield row("view.fit_here", "Show everything in the view under the pointer", ("Ctrl+R",),
              IN_WINDOW, has_scan, group="layout",
              hint="Does not change the other views")
    yield row("view.next_view", "Keyboard to the next view", ("F3",), IN_WINDOW, has_scan, group="layout",
              hint="The view with the border has the keyboard: arrow keys, Space and Enter work there")
    for title, step, key in _STEPS:
        yield row(f"view.step_{step}", title, (key,), IN_WINDOW, has_scan if step == "label" else always,
                  group="step", hint="Shows the panel of this step and moves the keyboard to it")
    yield row("view.reset", "Show everything", ("R",), lambda w: w.view.reset_asked.emit(), has_scan,
              group="show")
    yield row("view.go_to", "Go to position…", ("Ctrl+G",), IN_WINDOW, has_scan,
              group="show", hint="For example L 4.6 P 9.1 S 12.4")
    yield row("view.zoom_to_point", "Zoom to the point", ("E", "Shift+R"),
              IN_WINDOW, has_scan, group="show")
    for word, keys in _VIEWPOINTS:
        yield row(f"view.from_{word}", f"Look from {word}", keys, IN_WINDOW, group="from")
    for title, tool, key in _TOOLS:
        run = IN_WINDOW if tool == "place" else _set_tool(tool)
        yield row(f"tool.{tool}", title, (key,), run, checked=has_tool(tool), group="tool",
                  hint="Sets what the left mouse button does on a slice")
    yield row("view.auto_window_level", "Automatic contrast", ("Shift+W",), _auto_window_level, has_scan,
              group="tool")
    for title, field, key in _SHOWN:
        yield row(f"view.{field}", title, (key,), _toggle(field), checked=_is_on(field), group="what")
    yield row("view.glyph_mm", "Scale points with the zoom", (), _toggle_glyphs,
              checked=lambda w: w.view.state.glyph_mm is not None, group="what",
              hint="When on, their size is in mm; otherwise it is constant on the screen")
    yield row("view.fainter", "Bone more transparent", ("[",), _change_opacity(-0.1), group="bone")
    yield row("view.solider", "Bone more solid", ("]",), _change_opacity(0.1), group="bone")
    yield row("view.projection", "Perspective on or off", ("5", "Num+5"),
              IN_WINDOW, group="bone")
    yield row("view.canvas", "3D canvas…", (), IN_WINDOW, group="theme",
              hint="Painted or native drawing of the 3D view, from the next start on")
    yield row("view.theme", "Dark or light theme", ("Ctrl+T",), IN_WINDOW, group="theme",
              icon="moon")
    for title, id, keys in _TEXT_SIZES:
        yield row(f"view.text_{id}", title, keys, IN_WINDOW, group="text",
                  hint="In the whole window, including slices and the 3D view")


_LAYOUTS = (
    ("Four views", "four-up", "V"), ("3D and the best slice", "two-up", "Ctrl+2"), ("3D only", "3d", "D"),
    ("Axial only", "axial", "Z"), ("Sagittal only", "sagittal", "S"), ("Coronal only", "coronal", "C"),
)
_STEPS = (
    ("Step 1: Scan", "scan", "F5"), ("Step 2: Label", "label", "F6"), ("Step 3: Atlas", "atlas", "F7"),
    ("Step 4: Pose", "pose", "F8"),
)
_TEXT_SIZES = (
    ("Larger text", "larger", ("Ctrl+=", "Ctrl++")), ("Smaller text", "smaller", ("Ctrl+-",)),
    ("Normal text", "normal", ("Ctrl+0",)),
)
_VIEWPOINTS = (
    ("anterior", ("1", "Num+1")), ("left", ("3", "Num+3")), ("superior", ("7", "Num+7")),
    ("posterior", ("Ctrl+1",)), ("right", ("Ctrl+3",)), ("inferior", ("Ctrl+7",)),
)
_TOOLS = (
    ("Tool: place points", "place", "P"), ("Tool: move the crosshair", "look", "H"),
    ("Tool: contrast and brightness", "grey", "W"),
)
_SHOWN = (
    ("Bone edge on slices", "outline_visible", "O"), ("Names of points", "labels_visible", "T"),
    ("Predicted positions (ghosts)", "ghosts_visible", "G"),
    ("Axis and round window lines", "axis_visible", "M"),
)


def landmark_rows() -> Iterator[Action]:
    """Return the commands of the menu Landmarks."""
    def row(id: str, title: str, keys: tuple[str, ...], run: Run | None, enabled: Test = always, *,
            checked: Test | None = None, group: str = "place", hint: str = "", icon: str = "") -> Action:
        return Action(id, "Landmarks", title, keys, run, enabled, checked, hint, group, icon)

    yield row("point.accept_ghost", "Accept the ghost, confirm a suggestion", ("Enter", "Return"),
              _accept_or_confirm, _can_confirm, icon="check",
              hint="An accepted ghost becomes a suggestion. It counts when you confirm it in a close view")
    yield row("point.confirm", "Confirm the suggestion or ghost", ("Ctrl+Enter", "Ctrl+Return"), _confirm,
              _can_confirm, hint="Zooms in first if the point cannot be judged in the current view")
    yield row("point.accept_all", "Accept all ghosts of this side", (),
              lambda w: w.labels.accept_all_ghosts(),
              lambda w: bool(w.labels.ghosts(w.labels.active.side)), group="suggest",
              hint="They become suggestions, which you then confirm")
    yield row("point.suggest_like", "Suggest from my scans…", (), IN_WINDOW,
              lambda w: w.scan.volume is not None, checked=lambda w: w.first_labels.is_running,
              group="suggest", hint="Suggests first labels from labelled scans; choose it again to stop")
    yield row("point.check_page", "Check suggestions in pages…", ("Ctrl+K",), IN_WINDOW,
              lambda w: w.pages.can_begin, group="suggest",
              hint="Close views of nine suggestions at a time; doubtful ones come up in the views afterwards")
    yield row("point.place", "Place at the crosshair", ("Space",), _place_at_crosshair, _can_place,
              icon="label", hint="As a click at the crosshair: a landmark, the end of a ruler, or a touch")
    yield row("point.replace", "Re-place with the next click", ("Shift+P",),
              lambda w: w.interaction.arm_replacing(not w.interaction.replacing),
              lambda w: has_scan(w) and _is_free(w) and _is_shown(w),
              checked=lambda w: w.interaction.replacing,
              hint="The next click moves the selected point; otherwise, clicks never move a placed point")
    yield row("point.skip", "Skip for now", ("N",), lambda w: w.labels.skip(), _has_active,
              icon="skip")
    yield row("point.unseen", "Cannot be seen", ("X",), lambda w: w.labels.mark_unseen(),
              _is_free, icon="unseen")
    yield row("point.clear", "Clear", ("Delete", "Backspace"), lambda w: w.labels.clear(),
              lambda w: _is_free(w) and (_is_placed_or_unseen(w) or _is_suggested(w)))
    yield row("point.check", "Mark as checked", ("K",), _toggle_check, _is_placed, checked=_is_checked,
              group="state")
    yield row("point.lock", "Lock", ("L",), _toggle_lock, _is_placed_or_unseen, checked=_is_locked,
              group="state", icon="lock")
    yield row("point.lock_all", "Lock all", ("Ctrl+L",),
              lambda w: w.labels.lock_all(not _all_locked(w)), _has_labels,
              checked=_all_locked, group="state")
    yield row("point.next", "Next feature", (".",), _step_point(1), group="go")
    yield row("point.previous", "Previous feature", (",",), _step_point(-1), group="go")
    yield row("point.other_side", "Same feature, other side", ("Q",), _other_side, _has_active, group="go")
    for title, field in (
        ("Select the next feature after placing", "auto_advance"),
        ("Show the predicted position of the next feature", "follow_ghost"),
    ):
        yield row(f"view.{field}", title, (), _toggle(field), checked=_is_on(field), group="how")


def help_rows() -> Iterator[Action]:
    """Return the commands of the menu Help."""
    yield Action("help.shortcuts", "Help", "Keyboard and mouse", ("?", "F1"),
                 IN_WINDOW)
    yield Action("help.record", "Help", "Record script…", (), IN_WINDOW,
                 hint="Records your actions as a script for gp-labeler --offscreen; choose it again to stop")
    yield Action("help.about", "Help", "About gp-labeler", (), IN_WINDOW)
# fmt: on
