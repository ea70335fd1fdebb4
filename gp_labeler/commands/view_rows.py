"""The rows of the menu View about what is seen inside of bone: cuts, and slices in the 3D view."""

from __future__ import annotations

from collections.abc import Iterator

from gp_labeler.commands.action import IN_WINDOW, Action, Run, Test
from gp_labeler.commands.conditions import has_scan
from gp_labeler.models.workspace import Workspace

__all__ = ["cut_rows"]

_STEP_MM = 0.5


def _has_bone(workspace: Workspace) -> bool:
    return bool(workspace.bone.surfaces)


def _has_place(workspace: Workspace) -> bool:
    """Whether there is bone, and it is known where the active feature is or is expected."""
    active = workspace.labels.active
    return (
        _has_bone(workspace)
        and active.code is not None
        and workspace.labels.place_of(active.side, active.code) is not None
    )


def _is_cut(workspace: Workspace) -> bool:
    return workspace.view.state.cut is not None


def _is_cut_by(plane: str) -> Test:
    def test(workspace: Workspace) -> bool:
        cut = workspace.view.state.cut
        return cut is not None and cut.plane == plane

    return test


def _flip(workspace: Workspace) -> None:
    cut = workspace.view.state.cut
    if cut is not None:
        workspace.view.update(cut=cut.flipped())


def _cut_here(workspace: Workspace) -> None:
    cut = workspace.view.state.cut
    if cut is not None:
        workspace.view.update(cut=cut.through(workspace.view.crosshair))


def _move(mm: float) -> Run:
    def change(workspace: Workspace) -> None:
        cut = workspace.view.state.cut
        if cut is not None:
            workspace.view.update(cut=cut.moved(mm))

    return change


def _toggle_slices(workspace: Workspace) -> None:
    workspace.view.update(slices_visible=not workspace.view.state.slices_visible)


# fmt: off
def cut_rows() -> Iterator[Action]:
    """Return the commands of the menu View that look into bone."""
    def row(id: str, title: str, keys: tuple[str, ...], run: Run | None, enabled: Test = _is_cut, *,
            checked: Test | None = None, hint: str = "", group: str = "cut") -> Action:
        return Action(f"view.{id}", "View", title, keys, run, enabled, checked, hint, group)

    for plane, key in (("axial", "Shift+Z"), ("sagittal", "Shift+S"), ("coronal", "Shift+C")):
        yield row(f"cut_{plane}", f"Cut bone: {plane}", (key,), IN_WINDOW, _has_bone,
                  checked=_is_cut_by(plane),
                  hint=f"Remove the bone in front of the {plane} plane through the crosshair")
    yield row("cut_view", "Cut bone: across the view", ("Shift+V",), IN_WINDOW, _has_bone,
              checked=_is_cut_by("view"), hint="Remove the bone between you and the crosshair")
    yield row("cut_open", "Cut bone: open at the feature", ("Shift+E",), IN_WINDOW,
              _has_place,
              hint="Cut in the best plane of the feature, viewed from the open side")
    yield row("cut_flip", "Cut: keep the other side", ("Shift+X",), _flip)
    yield row("cut_here", "Cut: through the crosshair", ("Shift+H",), _cut_here,
              hint="Move the cut to the crosshair")
    yield row("cut_deeper", "Cut: deeper", ("Shift+]",), _move(_STEP_MM), hint="By half a millimetre")
    yield row("cut_shallower", "Cut: less deep", ("Shift+[",), _move(-_STEP_MM),
              hint="By half a millimetre")
    yield row("slices_visible", "Slices in the 3D view", ("Shift+D",), _toggle_slices, has_scan,
              checked=lambda workspace: workspace.view.state.slices_visible)
