"""The rows of the menu Measure."""

from __future__ import annotations

from collections.abc import Iterator

from gp_labeler.commands.action import IN_WINDOW, Action, Run, Test
from gp_labeler.commands.conditions import has_scan, has_tool
from gp_labeler.models.workspace import Workspace

__all__ = ["measure_rows"]


def _has_measurements(workspace: Workspace) -> bool:
    return bool(workspace.document.state.measurements)


def _toggle(tool: str) -> Run:
    def change(workspace: Workspace) -> None:
        if workspace.interaction.tool == tool:
            workspace.measure.put_away()
        else:
            workspace.interaction.set_tool(tool)

    return change


# fmt: off
def measure_rows() -> Iterator[Action]:
    """Return the commands of the menu Measure."""
    def row(id: str, title: str, keys: tuple[str, ...], run: Run | None, enabled: Test = has_scan, *,
            checked: Test | None = None, hint: str = "", group: str = "", icon: str = "") -> Action:
        return Action(id, "Measure", title, keys, run, enabled, checked, hint, group, icon)

    for title, tool, key, hint in (
        ("Ruler", "ruler", "U", "Measure a distance: click its two ends on bone, a slice or a landmark"),
        ("Angle", "angle", "Shift+U", "Measure an angle: click one arm, the vertex, the other arm"),
    ):
        yield row(f"tool.{tool}", title, (key,), _toggle(tool), checked=has_tool(tool), hint=hint,
                  group="measure", icon=tool)
    yield row("measure.show", "Measurements and distances…", ("Ctrl+M",),
              IN_WINDOW, group="list",
              hint="List of rulers and angles; distances between landmarks compared with the published ones")
    yield row("measure.remove", "Remove the selected measurement", (), lambda w: w.measure.remove(),
              lambda w: w.measure.selected is not None, group="list")
    yield row("measure.clear_pair", "Hide the distance of two landmarks", (),
              lambda w: w.measure.clear_pair(), lambda w: w.measure.pair is not None, group="list")
    yield row("measure.import", "Import rulers and angles…", (), IN_WINDOW,
              hint="Line and angle markups of 3D Slicer (.mrk.json)", group="exchange")
    yield row("measure.export", "Export rulers and angles…", (), IN_WINDOW,
              _has_measurements, hint="One line or angle markup of 3D Slicer for each", group="exchange")
# fmt: on
