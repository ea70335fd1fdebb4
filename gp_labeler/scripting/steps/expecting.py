"""The step that makes a script a test."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from gp_core.errors import GpError
from gp_core.landmarks.features import Side, feature
from gp_labeler.scripting.step import Step, Triple
from gp_labeler.scripting.window_driver import WindowDriver

__all__ = ["Expect"]


@dataclass(frozen=True)
class Expect(Step):
    """Fail unless something is so.

    Parameters
    ----------
    feature : str, optional
        A point, of `side`, that lies `within` mm of `near`.
    side : L or R, optional
        Which side; for `placed`, both where it is not given.
    near : three numbers or str, optional
        A scan position, mm, or ``truth``.
    within : float, optional
        mm; by default one voxel.
    placed : int, optional
        How many points are placed or computed.
    suggested : int, optional
        How many points are suggested and not yet confirmed, of `side` or of both.
    message : str, optional
        A part of something that the window has said.
    pose_within : float, optional
        The estimated cochlea of `side` (L by default) is so near to the true one, else the labelled, mm.
    """

    do: ClassVar[str] = "expect"
    feature: str | None = None
    side: Side | None = None
    near: Triple | str | None = None
    within: float | None = None
    placed: int | None = None
    suggested: int | None = None
    message: str | None = None
    pose_within: float | None = None

    def run(self, driver: WindowDriver) -> str:  # noqa: D102
        driver.wait_until_idle()
        found = []
        if self.feature is not None:
            found.append(self._point(driver, feature(self.feature).code))
        if self.placed is not None:
            found.append(self._count(driver, "placed", self.placed))
        if self.suggested is not None:
            found.append(self._count(driver, "suggested", self.suggested))
        if self.message is not None:
            found.append(self._heard(driver, self.message))
        if self.pose_within is not None:
            found.append(self._pose(driver, self.pose_within))
        if not found:
            raise GpError("expect needs feature, placed, suggested, message or pose_within")
        return ", ".join(found)

    def _point(self, driver: WindowDriver, code: str) -> str:
        side = self.side or Side.LEFT
        there = driver.placed(side, code)
        if there is None:
            is_suggested = code in driver.workspace.document.landmarks(side).suggested
            word = "only suggested" if is_suggested else "not placed"
            raise GpError(f"{code} {side.word} is {word}", landmark=code)
        if self.near is None:
            return f"{code} {side.word} is placed"
        aim = driver.truth(side, code) if self.near == "truth" else np.array(self.near)
        if aim.shape != (3,) or aim.dtype.kind != "f":
            raise GpError(f"near must be a position or truth, got {self.near!r}")
        off, allowed = float(np.linalg.norm(there - aim)), self.within or driver.voxel
        if off > allowed:
            raise GpError(f"{code} {side.word} lies {off:.3f} mm off, allowed are {allowed:g}", landmark=code)
        return f"{code} {side.word} {off:.3f} mm off"

    def _count(self, driver: WindowDriver, state: str, wanted: int) -> str:
        sides = list(Side) if self.side is None else [self.side]
        found = [driver.workspace.labels.progress(side) for side in sides]
        counted = sum(getattr(each, f"n_{state}") for each in found)
        if counted != wanted:
            n_suggested = sum(each.n_suggested for each in found)
            others = f" and {n_suggested} only suggested" if state == "placed" and n_suggested else ""
            raise GpError(f"{counted} points are {state}{others}, expected were {wanted}")
        return f"{wanted} points" if state == "placed" else f"{wanted} suggested"

    def _heard(self, driver: WindowDriver, text: str) -> str:
        if not any(text in said for said, _ in driver.messages):
            last = f"; the last was {driver.messages[-1][0]!r}" if driver.messages else ""
            raise GpError(f"no message holds {text!r}{last}")
        return f"message {text!r}"

    def _pose(self, driver: WindowDriver, allowed: float) -> str:
        pose = driver.poses.get(self.side or Side.LEFT)
        errors = None if pose is None else pose.errors
        if errors is None:
            raise GpError("no pose with a known truth, or of a labelled ear, was estimated")
        if errors[0] > allowed:
            raise GpError(f"the cochlea is {errors[0]:.3f} mm off, allowed are {allowed:g}")
        return f"cochlea {errors[0]:.3f} mm off"
