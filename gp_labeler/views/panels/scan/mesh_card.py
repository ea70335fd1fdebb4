"""The bone mesh: how it is shown, how fine it is, and saving it."""

from __future__ import annotations

from typing import Any

from qtpy.QtCore import Qt
from qtpy.QtWidgets import QCheckBox, QHBoxLayout, QProgressBar, QPushButton, QSlider, QWidget

from gp_labeler.jobs.runner import Task
from gp_labeler.models.bone import MESHING
from gp_labeler.models.workspace import Workspace
from gp_labeler.views.fonts import fit, pixels, text_width
from gp_labeler.views.formatting import mm_text
from gp_labeler.views.layouts import in_row, wide
from gp_labeler.views.panels.action_button import Actions, action_button
from gp_labeler.views.panels.flow import FlowLayout
from gp_labeler.views.panels.parts import Card, text_label
from gp_labeler.views.panels.scan.cut_row import CutRow
from gp_labeler.views.signals import blocked, follow

__all__ = ["MeshCard"]

_SAVED_AS = "As PLY, STL, VTP, OBJ or glTF, in LPS mm"

_SHOWN = {
    "outline_visible": ("Outline on slices", "Outline of the bone surface on the slices"),
    "hidden_visible": ("Points behind bone", "Show points behind bone faintly"),
    "slices_visible": ("Slices in the 3D view", "Show the three slices in the 3D view"),
}


class MeshCard(Card):
    """The bone mesh.

    Parameters
    ----------
    workspace : Workspace
        Whose mesh it is about.
    actions : mapping of str to QAction
        What its buttons do.
    """

    def __init__(self, workspace: Workspace, actions: Actions, parent: QWidget | None = None) -> None:
        super().__init__("Bone surface", parent)
        self._workspace = workspace
        self.state = text_label("", "hint", wrap=True)
        self.add(self.state)
        self.opacity = QSlider(Qt.Orientation.Horizontal)
        self.opacity.setRange(5, 100)
        self.opacity.setAccessibleName("Opacity of the bone surface")
        self.opacity.valueChanged.connect(lambda value: self._update(mesh_opacity=value / 100))
        self._percent = text_label("100 %")
        fit(self._percent, lambda: self._percent.setFixedWidth(text_width(self._percent, "100 %")))
        self._percent.setAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
        self.add(in_row(text_label("Opacity", "hint"), wide(self.opacity), self._percent))
        checks = FlowLayout(spacing=8)
        self.checks = {name: self._check(name, checks) for name in _SHOWN}
        self.add(checks)
        self.cut = CutRow(workspace, actions)
        self.add(self.cut)
        self._add_buttons(actions)
        self._listen()
        self.refresh()

    def refresh(self, *_: object) -> None:
        """Show the mesh as it stands."""
        view, surfaces = self._workspace.view.state, self._workspace.bone.surfaces
        with blocked(self.opacity, *self.checks.values()):
            self.opacity.setValue(round(100 * view.mesh_opacity))
            for name, check in self.checks.items():
                check.setChecked(bool(getattr(view, name)))
        self._percent.setText(f"{round(100 * view.mesh_opacity)} %")
        self.state.setText(self._words())
        self.ears.setEnabled(any(s.stride > 1 for s in surfaces))

    def _words(self) -> str:
        surfaces = self._workspace.bone.surfaces
        if not surfaces:
            return (
                "There is no surface yet."
                if self._workspace.scan.volume is None
                else "Extracting the surface…"
            )
        n = sum(surface.n_triangles for surface in surfaces)
        finest, coarsest = (f(s.voxel_mm for s in surfaces) for f in (min, max))
        voxels = mm_text(coarsest) if finest == coarsest else f"{mm_text(coarsest)}, ears {mm_text(finest)}"
        count = f"{n / 1e6:.1f} million" if n >= 1e6 else f"{n / 1e3:.0f} thousand"
        return f"{count} triangles; voxels of {voxels}."

    def _check(self, name: str, row: FlowLayout) -> QCheckBox:
        text, hint = _SHOWN[name]
        check = QCheckBox(text)
        check.setToolTip(hint)
        check.toggled.connect(lambda on: self._update(**{name: on}))
        row.addWidget(check)
        return check

    def _add_buttons(self, actions: Actions) -> None:
        self.ears = QPushButton("Ears at full resolution")
        self.ears.setToolTip("Mesh around each ear with every voxel; needs a placed feature or a ghost there")
        self.ears.clicked.connect(self._mesh_ears)
        self.save = action_button(actions["file.save_mesh"], "Save mesh…", _SAVED_AS)
        self.add(in_row(wide(self.ears, 2), wide(self.save), spacing=6))
        self.progress = QProgressBar()
        self.progress.setRange(0, 100)
        self.progress.setTextVisible(False)
        fit(self.progress, lambda: self.progress.setFixedHeight(pixels(self, 8)))
        self.stop = QPushButton("Stop")
        self._work = QWidget()
        line = QHBoxLayout(self._work)
        line.setContentsMargins(0, 0, 0, 0)
        self._doing = text_label("", "hint", wrap=True)
        line.addWidget(self._doing, 1)
        line.addWidget(self.progress, 1)
        line.addWidget(self.stop)
        self.stop.clicked.connect(self._stop)
        self._work.hide()
        self.add(self._work)

    def _listen(self) -> None:
        workspace = self._workspace
        for signal in (
            workspace.bone.surfaces_changed,
            workspace.view.changed,
            workspace.scan.opened,
            workspace.document.reset,
        ):
            follow(self, signal, self.refresh)
        for signal in (workspace.jobs.started, workspace.jobs.progressed):
            follow(self, signal, self._on_progress)
        for signal in (workspace.jobs.done, workspace.jobs.failed, workspace.jobs.cancelled):
            follow(self, signal, self._on_end)

    def _update(self, **changes: Any) -> None:
        self._workspace.view.update(**changes)

    def _mesh_ears(self) -> None:
        labels = self._workspace.labels
        self._workspace.bone.mesh_ears()
        if not self._workspace.jobs.is_running("mesh ears"):
            where = labels.active.side.word
            self._workspace.say(f"Place a feature first (such as CA {where}) to locate the ear.", "warning")

    def _on_progress(self, task: Task[Any]) -> None:
        if task.key in MESHING:
            self._work.show()
            self._doing.setText(task.job.title)
            self.progress.setValue(round(100 * task.fraction))

    def _on_end(self, _: Task[Any]) -> None:
        self._work.setVisible(self._workspace.jobs.is_running(*MESHING))
        self.refresh()

    def _stop(self) -> None:
        self._workspace.jobs.cancel(*MESHING)
