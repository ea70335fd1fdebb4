"""Steps on an estimated cochlea: estimate it, draw it over the scan, judge it, report it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from gp_core import PROBE, Atlas, CochleaPose, fit_atlas, load_specimens
from gp_core.errors import GpError
from gp_core.landmarks.anatomy import modiolar_axis
from gp_core.landmarks.features import Side
from gp_core.pose.systematic_error import DEFAULT_SHARED_ERROR_MM
from gp_core.validation import FloatArray
from gp_labeler.models.estimate import SideEstimate, apart
from gp_labeler.models.pose_exports import InsertionPath
from gp_labeler.scene.pose_data import PARTS
from gp_labeler.scripting.events import leave
from gp_labeler.scripting.step import Step
from gp_labeler.scripting.steps.touching import Points, Touches, current_estimate
from gp_labeler.scripting.window_driver import WindowDriver
from gp_labeler.views.report_file import report_of, save_report

__all__ = ["CarryPath", "EstimateStep", "Estimated", "Overlay", "ReportStep", "VerdictStep"]


@dataclass(frozen=True, eq=False)
class Estimated:
    """A cochlea that a step estimated, compared with what is known of it.

    Parameters
    ----------
    estimate : gp_labeler.models.estimate.SideEstimate
        With a pose.
    pose : CochleaPose
        That pose.
    truth : (origin (3,), axis (3,)), optional
        Of the phantom, scan frame.
    """

    estimate: SideEstimate
    pose: CochleaPose
    truth: tuple[FloatArray, FloatArray] | None = None

    @property
    def errors(self) -> tuple[float, float] | None:
        """Distance of the origin (mm) and angle of the axis (degrees) from the truth, else the labels."""
        placed = self.estimate.in_scan()
        if self.truth is None or placed is None:
            return self.estimate.errors()
        origin, axis = self.truth
        return apart(placed.origin, placed.axis, origin, axis)

    def as_dict(self) -> dict[str, Any]:
        """Return a row of the report."""
        registered, placed, errors = self.estimate.registered, self.estimate.in_scan(), self.errors
        tre = None if registered is None or placed is None else registered.tre_mm(placed.origin)
        return {
            "side": self.pose.side.value,
            "method": self.pose.method,
            "side_state": self.pose.side_state,
            "names_state": self.pose.names_state,
            "ears_agree": None if not self.pose.other_ear else not self.pose.ears_disagree,
            "shared_error_mm": self.pose.shared_error,
            "radius_95_mm": self.pose.radius_95,
            "cone_95_deg": float(np.degrees(self.pose.cone_95)),
            "error_mm": None if errors is None else errors[0],
            "error_deg": None if errors is None else errors[1],
            "registered_by": None if registered is None else registered.way,
            "fre_mm": None if registered is None else registered.fre_mm,
            "tre_mm": tre,
        }


@dataclass(frozen=True)
class EstimateStep(Step):
    """Estimate the pose of a cochlea from touches.

    Parameters
    ----------
    side : L or R
        Side of the head.
    touches : str or table of positions, optional
        As ``points`` of the step ``touches``, done first. By default the touches that are there; simulated
        ones where there are none.
    features : text or texts
        What is touched in a simulation; by default the paper's six.
    noise : float
        Standard deviation of a simulated touch, mm per coordinate.
    seed : int
        Of the simulation.
    atlas : str, optional
        ``published``, or an atlas file, used from here on; by default the one in use.
    specimens : text or texts
        Instead: landmark files of animals, or folders of them, to which the atlas is fitted; ``jrmpc`` needs
        them.
    method : text or texts
        ``robust``, ``jrmpc`` or both; the first is the one that is told and written.
    probe_noise : float, optional
        Ordinary error of a touch, mm per coordinate; by default found from the touches.
    shared_error : float
        RMS length of one offset that all touches share, mm; it widens the 95 % region.
    accept_warnings : bool
        Write files for a robot although side or names are in doubt, or the ears disagree.
    take_best : bool
        Where the other ear, or an exchange of two names, is likelier than what is given, take that; the pose
        is then of the side that was taken.
    round_window : str
        What y of the cochlea frame points to: the ``touched`` round window, or the ``expected`` one.
    both_ears : bool
        Where both ears were touched in one frame and agree, make the axis of both.
    midline : text or texts
        Skull features that lie in the mid-plane of the head, by which the ears are compared.
    path : text or texts
        Where the pose is written: .json, .tfm, .csv (4 x 4) or .mrk.json.
    """

    do: ClassVar[str] = "estimate"
    says: ClassVar[tuple[str, ...]] = ("side",)
    side: Side
    touches: str | Points | None = None
    features: tuple[str, ...] = PROBE
    noise: float = 0.1
    seed: int = 0
    atlas: str | None = None
    specimens: tuple[str, ...] = ()
    method: tuple[str, ...] = ("robust",)
    probe_noise: float | None = None
    shared_error: float = DEFAULT_SHARED_ERROR_MM
    take_best: bool = False
    accept_warnings: bool = False
    round_window: str = "touched"
    both_ears: bool = False
    midline: tuple[str, ...] = ()
    path: tuple[str, ...] = ("pose.json",)

    def run(self, driver: WindowDriver) -> str:  # noqa: D102
        self._take_atlas(driver)
        there = any(side is self.side for side, _ in driver.workspace.document.state.touches)
        points = self.touches if self.touches is not None or there else "simulated"
        if points is not None:
            Touches(self.side, points, features=self.features, noise=self.noise, seed=self.seed).run(driver)
        driver.workspace.pose.choose(
            side=self.side,
            methods=self.method,
            probe_noise=self.probe_noise,
            shared_error=self.shared_error,
            round_window=self.round_window,
            both_ears=self.both_ears,
            midline=self.midline,
        )
        estimate = current_estimate(driver, self.side)
        if self.take_best and (taken := driver.workspace.pose.take_likelier()) is not None:
            driver.workspace.say(
                f"Used as {taken.label}, which is more likely than what was given", "warning"
            )
            estimate = current_estimate(driver, taken.side)
        for method in self.method:
            if method not in estimate.poses:
                raise GpError(estimate.problems.get(method, f"{method} gave no pose"))
        pose = estimate.pose
        assert pose is not None
        for method in self.method:
            for warning in estimate.poses[method].warnings:
                driver.workspace.say(f"{method}: {warning}", "warning")
        self._tell_of_ears(driver)
        side = estimate.side
        driver.poses[side] = Estimated(estimate, pose, _truth(driver, side))
        files = [
            driver.workspace.pose.export(driver.to_write(path), accept_warnings=self.accept_warnings)
            for path in self.path
        ]
        return _told(driver.poses[side], driver.wrote(*files))

    def _tell_of_ears(self, driver: WindowDriver) -> None:
        ears = driver.workspace.pose.ears
        if ears is None:
            return
        if ears.comparison is None:
            driver.workspace.say(ears.problem, "warning")
            return
        for text in ears.comparison.texts:
            driver.workspace.say(text, "info" if ears.comparison.check.agrees else "warning")

    def _take_atlas(self, driver: WindowDriver) -> None:
        if self.specimens:
            animals = load_specimens([driver.to_read(each) for each in self.specimens])
            driver.workspace.atlas.use(fit_atlas(animals), animals)
        elif self.atlas is not None:
            is_published = self.atlas == "published"
            driver.workspace.atlas.use(
                Atlas.published() if is_published else Atlas.load(driver.to_read(self.atlas))
            )


def _told(estimated: Estimated, files: str) -> str:
    pose, errors = estimated.pose, estimated.errors
    text = (
        f"{files or pose.method}, 95 % within {pose.radius_95:.2f} mm and {np.degrees(pose.cone_95):.1f} deg"
    )
    return text if errors is None else f"{text}, off by {errors[0]:.2f} mm and {errors[1]:.1f} deg"


def _truth(driver: WindowDriver, side: Side) -> tuple[FloatArray, FloatArray] | None:
    if driver.workspace.scan.truth is None:
        return None
    ca, cb, co = (driver.truth(side, code) for code in ("CA", "CB", "CO"))
    return co, modiolar_axis(ca, cb)


@dataclass(frozen=True)
class CarryPath(Step):
    """Carry an insertion path to the estimated cochlea, and write it for a robot.

    Parameters
    ----------
    path : str, optional
        A table of three columns; by default the path that is carried already.
    units : str
        What its numbers are in: ``m``, ``cm``, ``mm`` or ``um``. Needed, as a wrong size is driven into bone.
    side : L or R
        The ear that it was drawn for. Needed.
    axes : str
        Which of its axes are x (modiolar axis), y (to the round window) and z, such as ``z,-y,x``.
    rows : int, optional
        How many of its rows are the path.
    save : str, optional
        Where to write it in the frame of the touches, .csv.
    """

    do: ClassVar[str] = "path"
    path: str | None = None
    units: str | None = None
    side: Side | None = None
    axes: str = "x,y,z"
    rows: int | None = None
    save: str | None = None

    def run(self, driver: WindowDriver) -> str:  # noqa: D102
        pose = driver.workspace.pose
        if self.path is None and self.save is None:
            raise GpError("path needs path, or save")
        if self.path is not None:
            if self.units is None or self.side is None:
                raise GpError("path needs units and side: the ear it was drawn for")
            read = InsertionPath.read(driver.to_read(self.path), self.side, units=self.units, axes=self.axes)
            pose.carry(read if self.rows is None else read.first(self.rows))
        told = "" if pose.path is None else f"{len(pose.path.points)} points"
        return (
            told
            if self.save is None
            else f"{driver.wrote(pose.save_path(driver.to_write(self.save)))}, {told}"
        )


@dataclass(frozen=True)
class Overlay(Step):
    """Draw an estimated cochlea over the bone and the slices.

    Parameters
    ----------
    visible : bool
        Whether to draw it, or to take it away again.
    side : L or R, optional
        Which; by default the one estimated, or chosen, last.
    parts : text or texts, optional
        What of it: ``estimate``, ``region``, ``cochlea``, ``truth`` (as labelled), ``features`` (where the
        atlas has them), ``vectors`` (from there to the labels), ``touches``, ``path`` and ``names``.
    opacity : float, optional
        From 0 to 1.
    """

    do: ClassVar[str] = "overlay"
    visible: bool = True
    side: Side | None = None
    parts: tuple[str, ...] | None = None
    opacity: float | None = None

    def run(self, driver: WindowDriver) -> None:  # noqa: D102
        workspace, options = driver.workspace, self._options()
        if self.visible:
            self._find(driver)
        workspace.pose.draw(visible=self.visible, **options)
        driver.app.processEvents()

    def _options(self) -> dict[str, Any]:
        options: dict[str, Any] = {} if self.opacity is None else {"opacity": self.opacity}
        if self.parts is None:
            return options
        for part in self.parts:
            if part not in PARTS:
                raise GpError(f"parts must be of {', '.join(PARTS)}, got {part!r}")
        return options | {part: part in self.parts for part in PARTS}

    def _find(self, driver: WindowDriver) -> None:
        """Choose what is drawn, and bring it into view."""
        placed = current_estimate(driver, self.side or driver.workspace.pose.side).in_scan()
        if placed is None:
            raise GpError(
                "the touches are not registered to the scan",
                remedy="Label three of the touched features of that side, or register by the skull.",
            )
        driver.bring(placed.origin)


@dataclass(frozen=True)
class VerdictStep(Step):
    """Keep a verdict on an estimated cochlea in the specimen.

    Parameters
    ----------
    side : L or R
        Side of the head.
    verdict : str
        ``accept`` or ``reject``.
    by : str
        Initials; by default who is logged in.
    note : str
        Why.
    """

    do: ClassVar[str] = "verdict"
    says: ClassVar[tuple[str, ...]] = ("side", "verdict")
    side: Side
    verdict: str
    by: str = ""
    note: str = ""

    def run(self, driver: WindowDriver) -> str:  # noqa: D102
        current_estimate(driver, self.side)
        check = driver.workspace.pose.record_verdict(self.verdict, by=self.by, note=self.note)
        return f"{check.verdict} by {check.by}"


@dataclass(frozen=True)
class ReportStep(Step):
    """Write a page about an estimated cochlea: what was touched, what came of it, who accepted it.

    Parameters
    ----------
    side : L or R
        Side of the head.
    path : str
        The file, .html or .pdf.
    """

    do: ClassVar[str] = "report"
    says: ClassVar[tuple[str, ...]] = ("side",)
    side: Side
    path: str = "pose.html"

    def run(self, driver: WindowDriver) -> str:  # noqa: D102
        current_estimate(driver, self.side)
        for view in driver.window.grid.views:
            leave(view)
        pose, was_drawn = driver.workspace.pose, driver.workspace.pose.overlay.visible
        pose.draw(visible=True)  # its pictures show it
        file = save_report(report_of(driver.window), driver.to_write(self.path))
        pose.draw(visible=was_drawn)
        return driver.wrote(file)
