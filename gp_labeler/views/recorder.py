"""Writing down what a person does in the window as a script for ``gp-labeler --offscreen``."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from PySide6.QtCore import QObject
from PySide6.QtWidgets import QApplication

from gp_core.landmarks.files import write_text
from gp_labeler.imaging.volume import Volume
from gp_labeler.scene.planes import Plane
from gp_labeler.session.state import TO_DO, How, Landmark, PointKey
from gp_labeler.session.workflow import Active
from gp_labeler.views.bind import follow
from gp_labeler.views.slice_view import SliceView

if TYPE_CHECKING:
    from gp_labeler.views.main_window import MainWindow

__all__ = ["Recorder", "script_text"]

_PHANTOM = "phantom-"
_LOOKS = ("view.", "tool.")
"""Commands that change only what is seen, taken down as they are."""

Marks = Mapping[PointKey, Landmark]


class Recorder(QObject):
    """Takes steps down from now on, until it is deleted.

    What is written is what was done, not how the hand moved: a point is placed where it was placed, by a
    click that the script aims itself. Landmarks taken from files leave no step: only their names are known.

    Parameters
    ----------
    window : MainWindow
        The window; owns it.
    """

    def __init__(self, window: MainWindow) -> None:
        super().__init__(window)
        self._window, desk = window, window.workbench
        self.tables: list[dict[str, Any]] = []
        self._threshold = desk.session.state.threshold
        self._seen: list[Marks] = [desk.session.state.landmarks]
        self._at = 0
        follow(self, desk.volume_opened, self._on_volume)
        follow(self, desk.landmarks_changed, self._on_landmarks)
        follow(self, desk.threshold_changed, self._on_threshold)
        follow(self, desk.saved, self._on_saved)
        for id, action in window.commands.actions.items():
            if id.startswith(_LOOKS):
                action.triggered.connect(lambda *_, id=id: self._add("action", id=id))
        if desk.volume is not None:
            self._on_volume(desk.volume)

    def save(self, path: Path) -> None:
        """Write the script, ``.toml`` or ``.json``.

        Raises
        ------
        GpError
            It cannot be written.
        """
        is_json = path.suffix.lower() == ".json"
        write_text(path, json.dumps(self.tables, indent=1) + "\n" if is_json else script_text(self.tables))

    def _add(self, do: str, **keys: Any) -> None:
        self.tables.append({"do": do, **{key: value for key, value in keys.items() if value is not None}})

    def _on_volume(self, volume: Volume) -> None:
        session = self._window.workbench.session
        self._seen, self._at = [session.state.landmarks], 0
        if session.path is not None:
            self._add("open", path=str(session.path))
        elif volume.path is None and volume.name.startswith(_PHANTOM):
            self._add("open", phantom=int(volume.name.removeprefix(_PHANTOM)), spacing=volume.spacing[0])
        else:
            self._add("open", path=str(volume.path), spacing=list(volume.spacing))

    def _on_threshold(self, _: object) -> None:
        value = self._window.workbench.session.state.threshold
        if value is not None and value != self._threshold:
            self._add("threshold", value=value)
        self._threshold = value

    def _on_saved(self, file: Path) -> None:
        self._add("save", path=Path(file).name)

    def _on_landmarks(self, _: object) -> None:
        before, now = self._seen[self._at], self._window.workbench.session.state.landmarks
        if self._at and now == self._seen[self._at - 1]:
            self._at -= 1
            self._add("undo")
            return
        if self._at + 1 < len(self._seen) and now == self._seen[self._at + 1]:
            self._at += 1
            self._add("action", id="edit.redo")
            return
        self._seen[self._at + 1 :] = [now]
        self._at += 1
        changed = [key for key in before.keys() | now.keys() if before.get(key) != now.get(key)]
        if len(changed) == 1:
            self._on_point(changed[0], before.get(changed[0], TO_DO), now.get(changed[0], TO_DO))

    def _on_point(self, key: PointKey, old: Landmark, new: Landmark) -> None:
        active = self._window.workbench.session.active
        side, code = key[0] or active.side, key[1]
        point = {"feature": code, "side": side.value}
        if new.position is not None and old.position is None:
            self._place(point, new)
        elif new.position is not None and new.position != old.position:
            self._move(point, old, new)
        else:
            for field, id in (("unseen", "unseen"), ("locked", "lock"), ("checked", "check")):
                if getattr(old, field) != getattr(new, field):
                    self._choose(Active(side, code), f"point.{id}")
            if new == TO_DO:
                self._choose(Active(side, code), "point.clear")

    def _choose(self, active: Active, id: str) -> None:
        self._add("view", go_to=f"{active.code} {active.side.value}")
        self._add("action", id=id)

    def _place(self, point: dict[str, str], mark: Landmark) -> None:
        how = mark.provenance.how if mark.provenance else How.SLICE
        if how is How.GHOST:
            self._add("place", **point, at="ghost")
        elif how is How.MESH:
            camera = self._window.grid.scene_view.scene.camera
            self._add("view", camera=camera.direction.round(4).tolist())
            self._add("place", **point, at=list(mark.position or ()), view="3d")
        else:
            self._add("place", **point, at=list(mark.position or ()), view=_slice_in_use())

    def _move(self, point: dict[str, str], old: Landmark, new: Landmark) -> None:
        """Take down where a point came to; nudges in a row are one movement."""
        last = self.tables[-1] if self.tables else {}
        if (last.get("do"), last.get("feature"), last.get("side")) == ("drag", *point.values()):
            last["to"] = list(new.position or ())
            return
        on_bone = new.provenance is not None and new.provenance.how is How.MESH
        moved = np.abs(np.subtract(new.position or 0, old.position or 0))
        plane = min(Plane, key=lambda plane: float(moved[plane.axis]))
        view = "3d" if on_bone else plane.value
        self._add("drag", **point, to=list(new.position or ()), view=view)


def script_text(tables: list[dict[str, Any]]) -> str:
    """Return steps as TOML."""
    steps = []
    for table in tables:
        lines = [f"{key} = {json.dumps(value)}" for key, value in table.items()]
        steps.append("\n".join(["[[step]]", *lines]))
    return "\n\n".join(steps) + "\n"


def _slice_in_use() -> str:
    """Return the slice view that keys go to, which is the one under the pointer."""
    view = QApplication.focusWidget()
    return view.plane.value if isinstance(view, SliceView) else Plane.AXIAL.value
