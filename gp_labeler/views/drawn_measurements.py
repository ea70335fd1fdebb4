"""Which measurements of a workspace are drawn, and which handle of them lies under the pointer."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from gp_core.landmarks.measurements import Measurement
from gp_core.validation import FloatArray
from gp_labeler.models.measure import MeasureModel
from gp_labeler.models.workspace import Workspace
from gp_labeler.scene.measurements import DrawnMeasurement
from gp_labeler.views.drawn import point_of

__all__ = ["handle_of", "kept_measurements", "mark_or_handle", "moving_measurements", "snapped"]

_PREFIX = "measurement:"


def kept_measurements(measure: MeasureModel) -> list[DrawnMeasurement]:
    """Return what stays where it is while the pointer moves."""
    moving = None if measure.dragged is None else measure.dragged[0]
    drawn = [_drawn(each, measure) for each in measure.measurements if each.name != moving]
    if (pair := measure.shown_pair()) is not None:
        distance, ends = pair
        label = (
            f"{distance.feature_a}-{distance.feature_b} {distance.measured_mm:.2f} mm "
            f"({distance.mean_mm:.1f} ± {distance.sd_mm:.2f})"
        )
        drawn.append(DrawnMeasurement(ends, label, broken=True))
    return drawn


def moving_measurements(measure: MeasureModel) -> list[DrawnMeasurement]:
    """Return what follows the pointer: one that is being placed or dragged."""
    drawn = []
    if measure.dragged is not None:
        drawn += [_drawn(each, measure) for each in measure.measurements if each.name == measure.dragged[0]]
    if (points := measure.preview()) != ():
        so_far = np.array(points)
        is_whole = len(points) > 1 and bool((np.abs(np.diff(so_far, axis=0)).max(axis=1) > 1e-9).all())
        label = Measurement("new", points).value_text if is_whole else ""
        drawn.append(DrawnMeasurement(so_far, label, broken=True))
    return drawn


def _drawn(measurement: Measurement, measure: MeasureModel) -> DrawnMeasurement:
    label = f"{measurement.name}  {measurement.value_text}"
    selected = measurement.name == measure.selected
    return DrawnMeasurement(np.array(measurement.points), label, selected)


def handle_of(key: str | None) -> tuple[str, int] | None:
    """Return the measurement and the point that a key is of; None for keys of landmarks."""
    if key is None or not key.startswith(_PREFIX):
        return None
    index, _, name = key.removeprefix(_PREFIX).partition(":")
    return name, int(index)


def mark_or_handle(
    workspace: Workspace,
    mark: str | None,
    display: Callable[[FloatArray], FloatArray],
    pixel: tuple[float, float],
    within: float,
) -> str | None:
    """Return the key of what lies under the pointer: a landmark, or the handle of a measurement.

    Parameters
    ----------
    workspace : Workspace
        Whose measurements; handles of the selected one go before landmarks, those of others behind.
    mark : str, optional
        The landmark there.
    display : callable
        Returns the (N, 2) pixels of (N, 3) scan positions, NaN where a position is not drawn.
    pixel : (2,) tuple of float
        Where the pointer is.
    within : float
        How far away a handle may be, pixels.
    """
    measure = workspace.measure
    for each in sorted(measure.measurements, key=lambda one: one.name != measure.selected):
        if mark is not None and each.name != measure.selected:
            break
        away = np.linalg.norm(display(np.array(each.points)) - pixel, axis=1)
        away[np.isnan(away)] = np.inf
        nearest = int(away.argmin())
        if away[nearest] <= within:
            return f"{_PREFIX}{nearest}:{each.name}"
    return mark


def snapped(workspace: Workspace, key: str | None, position: FloatArray | None) -> FloatArray | None:
    """Return where a measuring click lands: on the landmark or handle that it hit, else where it is."""
    handle = handle_of(key)
    if handle is not None:
        name, index = handle
        return np.array(workspace.document.state.measurement(name).points[index])
    if key is None:
        return position
    return workspace.labels.place_of(*point_of(key))
