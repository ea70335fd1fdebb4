"""Rulers and angles, placed click by click and dragged by their ends; distances between landmarks."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from gp_core.errors import GpError
from gp_core.io import read_measurements
from gp_core.landmarks.features import Side
from gp_core.landmarks.measurements import ANGLE, KINDS, LINE, Measurement, free_name
from gp_core.study.distance_check import DistanceCheck, PairDistance, check_distances
from gp_core.validation import FloatArray
from gp_labeler.document.edits import as_position
from gp_labeler.document.measurement_edits import (
    AddMeasurements,
    MoveMeasurement,
    RemoveMeasurements,
    RenameMeasurement,
)
from gp_labeler.document.measurement_export import export_measurements
from gp_labeler.document.signals import Signal
from gp_labeler.document.specimen_document import SpecimenDocument
from gp_labeler.document.state import Position
from gp_labeler.models.interaction import InteractionModel
from gp_labeler.models.labels import LabelsModel
from gp_labeler.models.messages import Messages
from gp_labeler.models.view import ViewModel

__all__ = ["MEASURING", "MeasureModel"]

MEASURING = {"ruler": LINE, "angle": ANGLE}
"""Tools that measure, and the kind of measurement that each places."""

_ORDINALS = ("first", "second", "third")


class MeasureModel:
    """The measurements of the specimen, the one that is being placed or dragged, and the one selected.

    Parameters
    ----------
    document : SpecimenDocument
        Holds them.
    interaction : InteractionModel
        Its tools ``ruler`` and ``angle`` place one measurement, then give way to the tool before.
    labels : LabelsModel
        Chooses the landmark of a distance.
    view : ViewModel
        Its crosshair goes to what is shown.
    messages : Messages
        What the user is told by.
    """

    changed = Signal()
    """What is drawn or listed: measurements, the selected one, one that is placed or dragged, the pair."""
    pointed = Signal()
    """Where the pointer is while one is being placed or dragged."""

    def __init__(
        self,
        document: SpecimenDocument,
        interaction: InteractionModel,
        labels: LabelsModel,
        view: ViewModel,
        messages: Messages,
    ) -> None:
        self._document, self._interaction, self._labels = document, interaction, labels
        self._view, self._messages = view, messages
        self.placed: tuple[Position, ...] = ()
        """Points of the measurement that is being placed."""
        self.pointer: Position | None = None
        """Where its next point would be; None while the pointer is elsewhere."""
        self.dragged: tuple[str, int] | None = None
        """Name and point of the measurement that is being dragged."""
        self.pair: tuple[Side, str, str] | None = None
        """Landmarks whose distance is shown."""
        self._selected: str | None = None
        self._moved: Measurement | None = None
        self._tool, self._before = interaction.tool, "look"
        document.reset.connect(self._on_reset)
        document.measurements_changed.connect(self._on_edited)
        document.landmarks_changed.connect(self._on_landmarks)
        interaction.tool_changed.connect(self._on_tool)

    # What there is

    @property
    def measurements(self) -> tuple[Measurement, ...]:
        """The measurements as they are drawn: one that is dragged where the pointer is."""
        kept = self._document.state.measurements
        if self.dragged is None or self._moved is None:
            return kept
        return tuple(self._moved if each.name == self.dragged[0] else each for each in kept)

    @property
    def dragged_position(self) -> FloatArray | None:
        """Where the point that is dragged is now, (3,) mm, scan frame; None while none is."""
        if self.dragged is None or self._moved is None:
            return None
        return np.array(self._moved.points[self.dragged[1]])

    @property
    def selected(self) -> str | None:
        """Name of the selected measurement, whose handles go before landmarks."""
        return self._selected

    @property
    def kind(self) -> str | None:
        """Kind of measurement that the tool places; None where another tool is in use."""
        return MEASURING.get(self._interaction.tool)

    @property
    def is_placing(self) -> bool:
        """Whether a measurement has its first point, and not yet its last."""
        return bool(self.placed)

    @property
    def click_text(self) -> str:
        """What the next click places, in words; empty where no measuring tool is in use."""
        if self.kind is None:
            return ""
        n, word = len(self.placed), self._interaction.tool.capitalize()
        which = "vertex" if self.kind == ANGLE and n == 1 else f"{_ORDINALS[n]} point"
        end = "Esc takes the last point back" if n else "Esc ends it"
        return f"{word}: click the {which} on bone, a slice or a landmark · {end}"

    def preview(self) -> tuple[Position, ...]:
        """Return the points of the measurement that is being placed, with the pointer as the next."""
        return self.placed if self.pointer is None or not self.placed else (*self.placed, self.pointer)

    # Placing

    def click(self, position: ArrayLike) -> bool:
        """Place the next point of a new measurement, (3,) mm, scan frame; return whether it is complete.

        Raises
        ------
        GpError
            No measuring tool is in use, or the point lies where the last one does.
        """
        kind = self.kind
        if kind is None:
            raise GpError("no measuring tool is in use", remedy="Choose Measure > Ruler or Angle first.")
        points = (*self.placed, as_position(position, "measurement"))
        if len(points) > 1 and np.allclose(points[-1], points[-2], atol=1e-9):
            raise GpError("a measurement needs two places", remedy="Click somewhere else.")
        if len(points) < KINDS[kind]:
            self.placed, self.pointer = points, None
            self._view.set_crosshair(points[-1])
            self.changed.emit()
            return False
        self.placed, self.pointer = (), None
        self.add(points)
        self.put_away()
        return True

    def point_at(self, position: ArrayLike | None) -> None:
        """Take where the pointer is, (3,) mm, scan frame; None where it would hit nothing."""
        if self.is_placing:
            self.pointer = None if position is None else as_position(position, "measurement")
            self.pointed.emit()

    def take_back(self) -> bool:
        """Take back the last point of the measurement that is being placed, or put the tool away."""
        if self.kind is None:
            return False
        if self.placed:
            self.placed, self.pointer = self.placed[:-1], None
            self.changed.emit()
        else:
            self.put_away()
        return True

    def put_away(self) -> None:
        """Take up the tool again that was in use before, and give up what is being placed."""
        if self.kind is not None:
            self._interaction.set_tool(self._before)

    def add(self, points: ArrayLike, name: str | None = None) -> Measurement:
        """Add a ruler (two points) or an angle (three) as one edit, and select it.

        Parameters
        ----------
        points : (2, 3) or (3, 3) array_like
            Scan frame, mm.
        name : str, optional
            By default the next free one, such as ``Ruler 2``.
        """
        kept = self._document.state.measurements
        made = Measurement(name or "measurement", tuple(points))  # type: ignore[arg-type]  # checked there
        if name is None:
            made = Measurement(free_name(made.kind, [each.name for each in kept]), made.points)
        self._document.do(AddMeasurements((made,)))
        self.select(made.name)
        self._messages.say(f"{made.name}: {made.value_text}")
        return made

    # Dragging

    def begin_drag(self, name: str, index: int) -> None:
        """Take up one point of a measurement."""
        self.dragged, self._moved = (name, index), self._document.state.measurement(name)
        self._selected = name
        self.changed.emit()

    def drag_to(self, position: ArrayLike) -> None:
        """Show the point that is dragged somewhere else, (3,) mm, scan frame; not where its neighbour is."""
        if self.dragged is None or self._moved is None:
            return
        points = list(self._moved.points)
        points[self.dragged[1]] = as_position(position, self.dragged[0])
        try:
            self._moved = Measurement(self._moved.name, tuple(points))
        except GpError:
            return
        self._view.set_crosshair(points[self.dragged[1]])
        self.pointed.emit()

    def end_drag(self, *, keep: bool = True) -> bool:
        """Let go of the point: one edit, or none where it was not moved or shall go back."""
        moved, dragged = self._moved, self.dragged
        self.dragged = self._moved = None
        done = False
        if keep and moved is not None and dragged is not None:
            done = self._document.do(MoveMeasurement(moved.name, moved.points))
        if not done:
            self.changed.emit()
        return done

    # The list

    def select(self, name: str | None) -> None:
        """Select a measurement of the list, or none."""
        if name is not None:
            self._document.state.measurement(name)
        if name != self._selected:
            self._selected = name
            self.changed.emit()

    def go_to(self, name: str, index: int = 0) -> None:
        """Select a measurement, and bring one of its points into every view."""
        points = self._document.state.measurement(name).points
        self.select(name)
        self._view.show_point(points[index % len(points)])

    def rename(self, name: str, new_name: str) -> None:
        """Give one another name; raises `GpError` where that is taken or no name."""
        was_selected = self._selected == name
        if self._document.do(RenameMeasurement(name, new_name)) and was_selected:
            self.select(" ".join(new_name.split()))

    def remove(self, *names: str) -> None:
        """Remove measurements, by default the selected one; raises `GpError` where there is none such."""
        chosen = names or ((self._selected,) if self._selected is not None else ())
        if not chosen:
            raise GpError(
                "no measurement is selected", remedy="Choose one in Measure > Measurements and distances."
            )
        self._document.do(RemoveMeasurements(tuple(chosen)))

    # Files

    def export(self, folder: str | PathLike[str], *, overwrite: bool = False) -> tuple[Path, ...]:
        """Write all measurements as line and angle markups of 3D Slicer; see `export_measurements`."""
        files = export_measurements(self._document.state, folder, overwrite=overwrite)
        self._messages.say(f"Wrote {', '.join(file.name for file in files)}")
        self._messages.wrote.emit("measurements", files)
        return files

    def open(self, *files: str | PathLike[str]) -> tuple[Measurement, ...]:
        """Add the lines and angles of 3D Slicer's files as one edit.

        Names that are taken get a number; the specimen's name before one is left out.

        Raises
        ------
        GpError
            A file cannot be read; nothing is added then.
        """
        taken = {each.name for each in self._document.state.measurements}
        found = []
        for each in (measurement for file in files for measurement in read_measurements(file)):
            name = each.name.removeprefix(f"{self._document.state.specimen}_") or each.name
            tries = (name, *(f"{name} ({n})" for n in range(2, len(taken) + 3)))
            name = next(attempt for attempt in tries if attempt not in taken)
            taken.add(name)
            found.append(Measurement(name, each.points))
        if found:
            self._document.do(AddMeasurements(tuple(found)))
            self._messages.say(f"Measurements added: {', '.join(each.name for each in found)}")
        return tuple(found)

    # Distances between landmarks

    def distances(self, side: Side | str) -> DistanceCheck:
        """Return the distances between the placed landmarks of a side, beside the published ones."""
        return check_distances(self._document.landmarks(side))

    def show_pair(self, side: Side, feature_a: str, feature_b: str) -> None:
        """Draw the distance between two landmarks, and bring the more doubtful of them into every view."""
        found = self._pair_of(side, feature_a, feature_b)
        if found.measured_mm is None:
            raise GpError(f"{feature_a} and {feature_b} {side.word} are not both placed")
        self.pair = (side, feature_a, feature_b)
        suspect = self.distances(side).suspect(found)
        where: FloatArray = self._document.landmarks(side)[suspect]
        self._labels.choose(side, suspect)
        self._view.show_point(where)
        self.changed.emit()

    def clear_pair(self) -> None:
        """Draw no distance between landmarks."""
        if self.pair is not None:
            self.pair = None
            self.changed.emit()

    def shown_pair(self) -> tuple[PairDistance, FloatArray] | None:
        """Return the distance that is drawn, and the (2, 3) scan positions of its ends."""
        if self.pair is None:
            return None
        side, one, other = self.pair
        landmarks = self._document.landmarks(side)
        if one not in landmarks or other not in landmarks:
            return None
        return self._pair_of(side, one, other), np.stack([landmarks[one], landmarks[other]])

    def _pair_of(self, side: Side, one: str, other: str) -> PairDistance:
        pairs = self.distances(side).pairs
        return next(pair for pair in pairs if {pair.feature_a, pair.feature_b} == {one, other})

    # Inside

    def _on_reset(self) -> None:
        self.placed, self.pointer, self.dragged, self._moved = (), None, None, None
        self._selected = self.pair = None
        self.changed.emit()

    def _on_edited(self) -> None:
        names = [each.name for each in self._document.state.measurements]
        self._selected = self._selected if self._selected in names else None
        if self.dragged is not None and self.dragged[0] not in names:
            self.dragged = self._moved = None
        self.changed.emit()

    def _on_landmarks(self, _: object) -> None:
        if self.pair is not None:
            self.changed.emit()

    def _on_tool(self, tool: str) -> None:
        if self._tool not in MEASURING:
            self._before = self._tool
        self._tool = tool
        if tool in MEASURING:
            self._interaction.arm_replacing(False)
        self.placed, self.pointer = (), None
        self.changed.emit()
