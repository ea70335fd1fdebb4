"""Steps that measure: rulers and angles by clicks, their files, and distances between landmarks."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from gp_core.disk import write_text
from gp_core.errors import GpError
from gp_core.landmarks.features import Side, feature
from gp_core.landmarks.measurements import KINDS
from gp_core.validation import FloatArray, check_option
from gp_labeler.models.measure import MEASURING
from gp_labeler.scene.planes import Plane
from gp_labeler.scripting.events import click
from gp_labeler.scripting.step import Places, Step
from gp_labeler.scripting.viewpoint_search import aim_at_bone, scroll_to
from gp_labeler.scripting.window_driver import WindowDriver

__all__ = ["Distances", "ExportMeasurements", "ImportMeasurements", "Measure", "ShowDistance"]


@dataclass(frozen=True)
class Measure(Step):
    """Take up the ruler or the angle, and click its points in a view.

    Parameters
    ----------
    tool : str
        ``ruler`` (two points) or ``angle`` (three, the vertex second).
    at : list
        For each click a scan position, mm, or a placed point such as ``CA L``: the view is scrolled and
        zoomed to it.
    view : str
        ``axial``, ``sagittal``, ``coronal``, or ``3d``, where bone must show the position.
    name : str, optional
        What to call it; by default ``Ruler 1`` and so on.
    """

    do: ClassVar[str] = "measure"
    says: ClassVar[tuple[str, ...]] = ("tool", "name")
    tool: str
    at: Places
    view: str = "axial"
    name: str | None = None

    def __post_init__(self) -> None:
        """Refuse a tool that there is not, and another number of points than it has."""
        check_option(self.tool, "tool", MEASURING)
        wanted = KINDS[MEASURING[self.tool]]
        if len(self.at) != wanted:
            raise GpError(f"measure: at must be {wanted} places for the {self.tool}, got {len(self.at)}")

    def run(self, driver: WindowDriver) -> str:  # noqa: D102
        _ = driver.voxel  # a scan must be there
        measure = driver.workspace.measure
        if measure.kind is not None:
            measure.put_away()
        if not driver.window.commands.run(f"tool.{self.tool}"):
            raise GpError(f"the {self.tool} cannot be used now")
        before = len(driver.workspace.document.state.measurements)
        for place in self.at:
            self._click(driver, _position(driver, place))
        driver.wait_until_idle(in_passing=False)
        made = driver.workspace.document.state.measurements[before:]
        if not made:
            measure.put_away()
            raise GpError("nothing was measured: a click hit nothing, or the same position twice")
        if self.name is not None:
            measure.rename(made[0].name, self.name)
        return f"{self.name or made[0].name}, {made[0].value_text}"

    def _click(self, driver: WindowDriver, aim: FloatArray) -> None:
        view = driver.view(self.view)
        if self.view == "3d":
            if not aim_at_bone(driver, aim, turn=False):
                raise GpError(
                    "bone hides that position from where the camera is", remedy="Choose another position."
                )
        else:
            scroll_to(driver, Plane(self.view), aim)
        click(view, *view.pixel_at(aim))


def _position(driver: WindowDriver, place: object) -> FloatArray:
    if not isinstance(place, str):
        return np.array(place, dtype=np.float64)
    code, _, side = place.partition(" ")
    there = driver.placed(Side.parse(side or "L"), code)
    if there is None:
        raise GpError(f"{place} is not placed", landmark=feature(code).code)
    return there


@dataclass(frozen=True)
class ImportMeasurements(Step):
    """Add rulers and angles from 3D Slicer's files.

    Parameters
    ----------
    files : text or texts
        Line and angle markups, ``.mrk.json``.
    """

    do: ClassVar[str] = "import_measurements"
    files: tuple[str, ...]

    def run(self, driver: WindowDriver) -> str:  # noqa: D102
        found = driver.workspace.measure.open(*(driver.to_read(file) for file in self.files))
        return ", ".join(each.name for each in found)


@dataclass(frozen=True)
class ExportMeasurements(Step):
    """Write all rulers and angles as line and angle markups of 3D Slicer, a file each.

    Parameters
    ----------
    folder : str
        Where, relative to the output folder.
    """

    do: ClassVar[str] = "export_measurements"
    folder: str = "."

    def run(self, driver: WindowDriver) -> str:  # noqa: D102
        return driver.wrote(*driver.workspace.measure.export(driver.to_write(self.folder), overwrite=True))


@dataclass(frozen=True)
class ShowDistance(Step):
    """Draw the distance between two placed landmarks in all views, with the published one.

    Parameters
    ----------
    side : L or R
        Which side.
    features : texts
        Two feature codes; empty draws none any more.
    """

    do: ClassVar[str] = "show_distance"
    says: ClassVar[tuple[str, ...]] = ("side",)
    side: Side
    features: tuple[str, ...]

    def run(self, driver: WindowDriver) -> str | None:  # noqa: D102
        measure = driver.workspace.measure
        if not self.features:
            measure.clear_pair()
            return None
        codes = [feature(code).code for code in self.features]
        if len(codes) != 2 or codes[0] == codes[1]:
            raise GpError(f"features must be two different ones, got {' '.join(codes)}")
        measure.show_pair(self.side, *codes)
        driver.wait_until_idle(in_passing=False)
        shown = measure.shown_pair()
        return None if shown is None else shown[0].text


@dataclass(frozen=True)
class Distances(Step):
    """Write the distances between all landmarks of a side beside the published ones, as JSON.

    Parameters
    ----------
    side : L or R
        Which side.
    path : str
        The file, .json.
    """

    do: ClassVar[str] = "distances"
    says: ClassVar[tuple[str, ...]] = ("side",)
    side: Side
    path: str

    def run(self, driver: WindowDriver) -> str:  # noqa: D102
        check, file = driver.workspace.measure.distances(self.side), driver.to_write(self.path)
        write_text(file, json.dumps(check.as_dict(), indent=1) + "\n")
        return f"{driver.wrote(file)}, {len(check.disagreeing)} disagree"
