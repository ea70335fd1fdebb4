"""The rows of the table of commands, a menu at a time."""

from __future__ import annotations

from collections.abc import Iterator

from gp_core.landmarks.features import FEATURES
from gp_labeler.commands.action import Action, Run, Test, Ui
from gp_labeler.document.edits import CheckPoint, SwapSides
from gp_labeler.document.state import How, Landmark
from gp_labeler.models import labelling
from gp_labeler.models.workspace import Workbench

__all__ = ["edit_rows", "file_rows", "help_rows", "landmark_rows", "view_rows"]

GLYPH_MM = 0.6
"""Diameter of points whose size is in mm."""


# When something can be done


def _always(desk: Workbench) -> bool:
    return True


def _lacks_scan(desk: Workbench) -> bool:
    return desk.volume is None and desk.session.state.volume is not None


def _has_scan(desk: Workbench) -> bool:
    return desk.volume is not None


def _in_use(desk: Workbench) -> bool:
    return desk.in_use


def _has_labels(desk: Workbench) -> bool:
    return bool(desk.session.state.landmarks)


def _mark(desk: Workbench) -> Landmark | None:
    active = desk.session.active
    return None if active.code is None else desk.session.state.landmark(active.side, active.code)


def _has_active(desk: Workbench) -> bool:
    return _mark(desk) is not None


def _is_free(desk: Workbench) -> bool:
    mark = _mark(desk)
    return mark is not None and not mark.locked


def _is_settled(desk: Workbench) -> bool:
    mark = _mark(desk)
    return mark is not None and mark.settled


def _is_placed(desk: Workbench) -> bool:
    mark = _mark(desk)
    return mark is not None and mark.position is not None


def _is_checked(desk: Workbench) -> bool:
    mark = _mark(desk)
    return mark is not None and mark.checked


def _is_locked(desk: Workbench) -> bool:
    mark = _mark(desk)
    return mark is not None and mark.locked


def _has_ghost(desk: Workbench) -> bool:
    active = desk.session.active
    return active.code is not None and active.code in desk.session.ghosts(active.side)


def _is_suggested(desk: Workbench) -> bool:
    mark = _mark(desk)
    return mark is not None and mark.suggestion is not None


def _is_shown(desk: Workbench) -> bool:
    return _is_placed(desk) or _is_suggested(desk)


def _can_confirm(desk: Workbench) -> bool:
    return _is_free(desk) and (_has_ghost(desk) or _is_suggested(desk))


def _can_place(desk: Workbench) -> bool:
    """Whether placing the chosen point moves none that has a place already, or is asked for."""
    return _has_scan(desk) and _is_free(desk) and (desk.replacing or not _is_shown(desk))


# What is done


def _change_text_size(step: int) -> Run:
    return lambda desk, ui: ui.change_text_size(step)


def _toggle(field: str) -> Run:
    def change(desk: Workbench, ui: Ui) -> None:
        desk.session.view.update(**{field: not getattr(desk.session.view.state, field)})

    return change


def _is_on(field: str) -> Test:
    return lambda desk: bool(getattr(desk.session.view.state, field))


def _set_layout(layout: str) -> Run:
    return lambda desk, ui: desk.session.view.update(layout=layout)


def _has_layout(layout: str) -> Test:
    return lambda desk: desk.session.view.state.layout == layout


def _set_tool(tool: str) -> Run:
    return lambda desk, ui: desk.set_tool(tool)


def _has_tool(tool: str) -> Test:
    return lambda desk: desk.tool == tool


def _change_opacity(step: float) -> Run:
    def change(desk: Workbench, ui: Ui) -> None:
        opacity = min(max(desk.session.view.state.mesh_opacity + step, 0.0), 1.0)
        desk.session.view.update(mesh_opacity=round(opacity, 3))

    return change


def _toggle_glyphs(desk: Workbench, ui: Ui) -> None:
    is_mm = desk.session.view.state.glyph_mm is not None
    desk.session.view.update(glyph_mm=None if is_mm else GLYPH_MM)


def _auto_greys(desk: Workbench, ui: Ui) -> None:
    desk.session.view.update(level=None, width=None)


def _look_from(letter: str) -> Run:
    return lambda desk, ui: ui.look_from(letter)


def _place_at_crosshair(desk: Workbench, ui: Ui) -> None:
    labelling.place(desk.session, desk.session.crosshair, How.SLICE)
    desk.arm_replacing(False)


def _confirm(desk: Workbench, ui: Ui) -> None:
    active = desk.session.active
    if active.code is not None:
        desk.confirm(active.side, active.code)


def _accept_or_confirm(desk: Workbench, ui: Ui) -> None:
    if _is_suggested(desk):
        _confirm(desk, ui)
    else:
        labelling.accept_ghost(desk.session)


def _let_place(desk: Workbench, ui: Ui) -> None:
    if not desk.is_labelling:
        ui.show_step("label")
    desk.set_tool("place")


def _toggle_lock(desk: Workbench, ui: Ui) -> None:
    mark = _mark(desk)
    labelling.lock(desk.session, mark is None or not mark.locked)


def _toggle_check(desk: Workbench, ui: Ui) -> None:
    active, mark = desk.session.active, _mark(desk)
    if active.code is not None and mark is not None:
        desk.session.do(CheckPoint(active.side, active.code, not mark.checked, desk.session.author))


def _all_locked(desk: Workbench) -> bool:
    marks = [mark for mark in desk.session.state.landmarks.values() if mark.settled]
    return bool(marks) and all(mark.locked for mark in marks)


def _step_point(step: int) -> Run:
    def go(desk: Workbench, ui: Ui) -> None:
        codes = [row.code for row in FEATURES if not row.computed]
        active = desk.session.active
        at = codes.index(active.code) if active.code in codes else -1 if step > 0 else 0
        desk.go_to(active.side, codes[(at + step) % len(codes)])

    return go


def _other_side(desk: Workbench, ui: Ui) -> None:
    active = desk.session.active
    if active.code is not None:
        desk.go_to(active.side.other, active.code)


# The rows: id, menu, title, keys, what is done, when it can be


# fmt: off
def file_rows() -> Iterator[Action]:
    """Return the commands of the menu File."""
    def row(id: str, title: str, keys: tuple[str, ...], run: Run, enabled: Test = _always, *,
            hint: str = "", group: str = "", icon: str = "") -> Action:
        return Action(f"file.{id}", "File", title, keys, run, enabled, hint=hint, group=group, icon=icon)

    yield row("new", "New, without a scan", ("Ctrl+N",), lambda d, ui: ui.begin(),
              hint="A specimen that is only touched; a scan can be opened for it later", group="open")
    yield row("open", "Open…", ("Ctrl+O",), lambda d, ui: ui.ask_open_file(),
              hint="A scan, or a specimen saved before", group="open", icon="file")
    yield row("open_folder", "Open folder…", ("Ctrl+Shift+O",), lambda d, ui: ui.ask_open_folder(),
              hint="A DICOM series or a stack of slices", group="open", icon="folder")
    yield row("demo", "Open the demo", (), lambda d, ui: ui.open_demo(),
              hint="A synthetic guinea-pig head to try everything on", group="open", icon="play")
    yield row("find_scan", "Find scan…", (), lambda d, ui: ui.ask_find_scan(), _lacks_scan, group="open")
    yield row("save", "Save", ("Ctrl+S",), lambda d, ui: ui.save(), _in_use, group="save", icon="save")
    yield row("save_as", "Save as…", ("Ctrl+Shift+S",), lambda d, ui: ui.save(ask=True), _in_use,
              group="save")
    yield row("import", "Import landmarks…", ("Ctrl+I",), lambda d, ui: ui.ask_import(), _has_scan,
              group="exchange", icon="import")
    yield row("export", "Export landmarks…", ("Ctrl+E",), lambda d, ui: ui.ask_export(), _has_labels,
              hint="For 3D Slicer and gp-core", group="exchange", icon="export")
    yield row("save_mesh", "Save bone surface…", (), lambda d, ui: ui.ask_save_mesh(),
              lambda d: bool(d.surfaces), group="exchange")
    yield row("screenshot", "Save picture…", (), lambda d, ui: ui.ask_screenshot(), group="exchange")
    yield row("show_references", "Show reference points…", (), lambda d, ui: ui.ask_references(), _has_scan,
              hint="Points of any landmark list, grey, to compare with: no part of the specimen",
              group="references")
    yield row("clear_references", "Clear reference points", (), lambda d, ui: d.references.clear(),
              lambda d: bool(d.references.points), group="references")
    yield row("add_mesh", "Add mesh…", (), lambda d, ui: ui.ask_add_mesh(), _has_scan,
              hint="Draw a surface from another program with the bone: no part of the specimen",
              group="references")
    yield row("remove_meshes", "Remove added meshes", (), lambda d, ui: d.meshes.clear(),
              lambda d: bool(d.meshes.meshes), group="references")
    yield row("close", "Close", ("Ctrl+Q",), lambda d, ui: ui.close_window(), group="close")


def edit_rows() -> Iterator[Action]:
    """Return the commands of the menu Edit."""
    def row(id: str, title: str, keys: tuple[str, ...], run: Run, enabled: Test, icon: str = "",
            hint: str = "") -> Action:
        group = "undo" if id in ("undo", "redo") else "swap"
        return Action(f"edit.{id}", "Edit", title, keys, run, enabled, hint=hint, group=group, icon=icon)

    yield row("undo", "Undo", ("Ctrl+Z",), lambda d, ui: d.session.undo(),
              lambda d: d.session.undo_text is not None, "undo")
    yield row("redo", "Redo", ("Ctrl+Y", "Ctrl+Shift+Z"), lambda d, ui: d.session.redo(),
              lambda d: d.session.redo_text is not None, "redo")
    yield row("swap", "Exchange with…", (), lambda d, ui: ui.ask_swap(), _is_free, "swap",
              "Exchange two points placed under each other's names")
    yield row("swap_sides", "Exchange left and right", (), lambda d, ui: d.session.do(SwapSides()),
              _has_labels)


def view_rows() -> Iterator[Action]:
    """Return the commands of the menu View."""
    def row(id: str, title: str, keys: tuple[str, ...], run: Run, enabled: Test = _always, *,
            checked: Test | None = None, group: str = "", hint: str = "", icon: str = "") -> Action:
        return Action(id, "View", title, keys, run, enabled, checked, hint, group, icon)

    for title, layout, key in _LAYOUTS:
        yield row(f"view.{layout}", title, (key,), _set_layout(layout), checked=_has_layout(layout),
                  group="layout")
    yield row("view.reset", "Show everything", ("R",), lambda d, ui: ui.reset_views(), _has_scan,
              group="show")
    yield row("view.zoom_to_point", "Look closely at the point", ("E", "Shift+R"),
              lambda d, ui: ui.zoom_to_point(), _has_scan, group="show")
    for word, letter, keys in _VIEWPOINTS:
        yield row(f"view.from_{word}", f"Look from {word}", keys, _look_from(letter), group="from")
    for title, tool, key in _TOOLS:
        run = _let_place if tool == "place" else _set_tool(tool)
        yield row(f"tool.{tool}", title, (key,), run, checked=_has_tool(tool), group="tool",
                  hint="What the left button does over a slice")
    yield row("view.auto_greys", "Automatic contrast", ("Shift+W",), _auto_greys, _has_scan, group="tool")
    for title, field, key in _SHOWN:
        yield row(f"view.{field}", title, (key,), _toggle(field), checked=_is_on(field), group="what")
    yield row("view.glyph_mm", "Points grow with the zoom", (), _toggle_glyphs,
              checked=lambda d: d.session.view.state.glyph_mm is not None, group="what",
              hint="Their size is in mm then, else the same on the screen at any zoom")
    yield row("view.fainter", "Bone more transparent", ("[",), _change_opacity(-0.1), group="bone")
    yield row("view.solider", "Bone more solid", ("]",), _change_opacity(0.1), group="bone")
    yield row("view.projection", "Perspective on or off", ("5", "Num+5"),
              lambda d, ui: ui.toggle_projection(), group="bone")
    yield row("view.theme", "Dark or light", ("Ctrl+T",), lambda d, ui: ui.toggle_theme(), group="theme",
              icon="moon")
    for title, id, step, keys in _TEXT_SIZES:
        yield row(f"view.text_{id}", title, keys, _change_text_size(step), group="text",
                  hint="Of the whole window, with what is written on slices and in 3D")


_LAYOUTS = (
    ("Four views", "four-up", "V"), ("3D only", "3d", "D"), ("Axial only", "axial", "Z"),
    ("Sagittal only", "sagittal", "S"), ("Coronal only", "coronal", "C"),
)
_TEXT_SIZES = (
    ("Larger text", "larger", 1, ("Ctrl+=", "Ctrl++")), ("Smaller text", "smaller", -1, ("Ctrl+-",)),
    ("Normal text", "normal", 0, ("Ctrl+0",)),
)
_VIEWPOINTS = (
    ("anterior", "A", ("1", "Num+1")), ("left", "L", ("3", "Num+3")), ("superior", "S", ("7", "Num+7")),
    ("posterior", "P", ("Ctrl+1",)), ("right", "R", ("Ctrl+3",)), ("inferior", "I", ("Ctrl+7",)),
)
_TOOLS = (
    ("Tool: place points", "place", "P"), ("Tool: move the crosshair", "look", "H"),
    ("Tool: contrast and brightness", "grey", "W"),
)
_SHOWN = (
    ("Bone edge on slices", "outline_visible", "O"), ("Names of points", "labels_visible", "T"),
    ("Expected places (ghosts)", "ghosts_visible", "G"), ("Axis and round window lines", "axis_visible", "M"),
)


def landmark_rows() -> Iterator[Action]:
    """Return the commands of the menu Landmarks."""
    def row(id: str, title: str, keys: tuple[str, ...], run: Run, enabled: Test = _always, *,
            checked: Test | None = None, group: str = "place", hint: str = "", icon: str = "") -> Action:
        return Action(id, "Landmarks", title, keys, run, enabled, checked, hint, group, icon)

    yield row("point.accept_ghost", "Accept the ghost, confirm a suggestion", ("Return", "Enter"),
              _accept_or_confirm, _can_confirm, icon="check",
              hint="An accepted ghost is a suggestion: it counts once it is confirmed where it can be judged")
    yield row("point.confirm", "Confirm the suggestion or ghost", ("Ctrl+Return", "Ctrl+Enter"), _confirm,
              _can_confirm, hint="The view comes closer first where the point cannot be judged")
    yield row("point.accept_all", "Accept all ghosts of this side", (),
              lambda d, ui: labelling.accept_all_ghosts(d.session),
              lambda d: bool(d.session.ghosts(d.session.active.side)), hint="As suggestions to confirm")
    yield row("point.place", "Place at the crosshair", ("Space",), _place_at_crosshair, _can_place,
              icon="label")
    yield row("point.replace", "Re-place with the next click", ("Shift+P",),
              lambda d, ui: d.arm_replacing(not d.replacing),
              lambda d: _has_scan(d) and _is_free(d) and _is_shown(d), checked=lambda d: d.replacing,
              hint="One click moves the chosen point; without this, a click leaves it where it is")
    yield row("point.skip", "Skip for now", ("N",), lambda d, ui: labelling.skip(d.session), _has_active,
              icon="skip")
    yield row("point.unseen", "Cannot be seen", ("X",), lambda d, ui: labelling.mark_unseen(d.session),
              _is_free, icon="unseen")
    yield row("point.clear", "Clear", ("Delete", "Backspace"), lambda d, ui: labelling.clear(d.session),
              lambda d: _is_free(d) and (_is_settled(d) or _is_suggested(d)))
    yield row("point.check", "Mark as checked", ("K",), _toggle_check, _is_placed, checked=_is_checked,
              group="state")
    yield row("point.lock", "Lock", ("L",), _toggle_lock, _is_settled, checked=_is_locked, group="state",
              icon="lock")
    yield row("point.lock_all", "Lock all", ("Ctrl+L",),
              lambda d, ui: labelling.lock_all(d.session, not _all_locked(d)), _has_labels,
              checked=_all_locked, group="state")
    yield row("point.next", "Next feature", (".",), _step_point(1), group="go")
    yield row("point.previous", "Previous feature", (",",), _step_point(-1), group="go")
    yield row("point.other_side", "Same feature, other side", ("Q",), _other_side, _has_active, group="go")
    for title, field in (
        ("Go on to the next after placing", "auto_advance"),
        ("Show where the next is expected", "follow_ghost"),
    ):
        yield row(f"view.{field}", title, (), _toggle(field), checked=_is_on(field), group="how")


def help_rows() -> Iterator[Action]:
    """Return the commands of the menu Help."""
    yield Action("help.shortcuts", "Help", "Keyboard and mouse", ("?", "F1"),
                 lambda d, ui: ui.show_shortcuts())
    yield Action("help.record", "Help", "Record script…", (), lambda d, ui: ui.toggle_recording(),
                 hint="Write down what you do, for gp-labeler --offscreen; once more ends it")
    yield Action("help.about", "Help", "About gp-labeler", (), lambda d, ui: ui.show_about())
# fmt: on
