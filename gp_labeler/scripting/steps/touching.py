"""Steps that take what was touched with the probe, and register it to the scan."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from gp_core import PROBE, RigidTransform
from gp_core.disk import write_text
from gp_core.errors import GpError
from gp_core.landmarks.features import CODES, Side
from gp_core.validation import FloatArray
from gp_labeler.document import touching
from gp_labeler.document.touch_edits import RecordTouch, SetSkull, TakeTouches
from gp_labeler.document.touches import Touch, TouchHow, touch_name
from gp_labeler.models.estimate import Registered, SideEstimate
from gp_labeler.scripting.step import Step, Triple
from gp_labeler.scripting.window_driver import WindowDriver

__all__ = ["Points", "Register", "Skull", "Touches", "current_estimate", "take_touches"]

Points = dict[str, Triple]

_FAR_MM = 200.0


@dataclass(frozen=True)
class Touches(Step):
    """Take touches of one side, in place of those it has.

    Parameters
    ----------
    side : L or R
        Side of the head.
    points : str or table of positions, optional
        A file of touches; positions by name, mm; or ``simulated``: features of the phantom (else as labelled)
        with noise, somewhere else in space. Names are external features, or skull features such as ``S1``.
    features : text or texts
        What is touched in a simulation; by default the paper's six.
    noise : float
        Standard deviation of a simulated touch, mm per coordinate.
    seed : int
        Of the simulation.
    how : str
        Of positions: ``typed``, ``tracked probe``, ``file`` or ``simulated``, all tracker frame; or ``placed
        on the scan``, scan frame.
    source : str
        Of positions: the file or device they come from.
    n_samples, spread_mm : int, float
        Of positions: of how many readings each is the average, and their spread.
    add : bool
        Keep the touches that are there.
    leave_out, take_in, forget : text or texts
        Names that the estimate does without, or with again; touches to forget.
    swap : texts, optional
        Two names, each of whose touches gets the other's.
    other_side : bool
        Say that the touches there are are those of the other side.
    clear : bool
        Forget all touches of the side.
    """

    do: ClassVar[str] = "touches"
    says: ClassVar[tuple[str, ...]] = ("side",)
    side: Side
    points: str | Points | None = None
    features: tuple[str, ...] = PROBE
    noise: float = 0.1
    seed: int = 0
    how: str = TouchHow.TYPED.value
    source: str = ""
    n_samples: int = 1
    spread_mm: float = 0.0
    add: bool = False
    leave_out: tuple[str, ...] = ()
    take_in: tuple[str, ...] = ()
    forget: tuple[str, ...] = ()
    swap: tuple[str, ...] = ()
    other_side: bool = False
    clear: bool = False

    def run(self, driver: WindowDriver) -> str:  # noqa: D102
        document = driver.workspace.document
        edits = (self.leave_out, self.take_in, self.forget, self.swap, self.other_side, self.clear)
        if self.points is None and not any(edits):
            raise GpError("touches needs points, leave_out, take_in, forget, swap, other_side or clear")
        if len(self.swap) not in (0, 2):
            raise GpError(f"touches: swap must be two names, got {' '.join(self.swap)}")
        if self.clear:
            touching.clear_touches(document, self.side)
        if isinstance(self.points, Mapping):
            self._type(driver, self.points)
        elif self.points is not None:
            take_touches(
                driver, self.side, self.points, features=self.features, noise=self.noise, seed=self.seed
            )
        if self.swap:
            touching.swap_touches(document, self.side, *self.swap)
        for name in self.forget:
            touching.clear_touches(document, self.side, touch_name(name))
        for names, left_out in ((self.leave_out, True), (self.take_in, False)):
            for name in names:
                touching.leave_out(document, self.side, touch_name(name), left_out)
        side = self.side.other if self.other_side else self.side
        if self.other_side:
            touching.move_touches(document, self.side)
        driver.workspace.pose.choose(side=side)
        there = [name for of, name in document.state.touches if of is side]
        return f"{len(there)} touched: {' '.join(there)}" if there else "nothing touched"

    def _type(self, driver: WindowDriver, points: Points) -> None:
        """Take positions as they are given."""
        allowed = [how.value for how in TouchHow]
        if self.how not in allowed:
            raise GpError(f"how must be one of {', '.join(allowed)}, got {self.how!r}")
        document = driver.workspace.document
        touches = {
            name: Touch(
                position, TouchHow(self.how), document.now(), document.author, self.source, self.n_samples,
                self.spread_mm,
            )
            for name, position in points.items()
        }  # fmt: skip
        if not self.add:
            document.do(TakeTouches(self.side, touches))
            return
        for name, touch in touches.items():
            document.do(RecordTouch(self.side, name, touch))


def take_touches(
    driver: WindowDriver, side: Side, points: str, *, features: tuple[str, ...], noise: float, seed: int
) -> None:
    """Take the touches of a file, or ``simulated`` ones; the arguments are those of `Touches`."""
    document = driver.workspace.document
    if points != "simulated":
        for text in touching.load_touches(document, driver.to_read(points), side):
            driver.workspace.say(text, "warning")
        driver.workspace.pose.set_registration(side, None)
        return
    rng = np.random.default_rng(seed)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    far = rng.uniform(-_FAR_MM, _FAR_MM, 3)
    T_tracker_scan = RigidTransform.from_parts(turn, far, dst="tracker", src="scan")
    touches = {}
    for name in map(touch_name, features):
        x, y, z = T_tracker_scan.apply(_there(driver, side, name)[None])[0] + rng.normal(0, noise, 3)
        where = (float(x), float(y), float(z))
        touches[name] = Touch(where, TouchHow.SIMULATED, document.now(), document.author)
    document.do(TakeTouches(side, touches))
    driver.workspace.pose.set_registration(side, T_tracker_scan.inverse())


def _there(driver: WindowDriver, side: Side, name: str) -> FloatArray:
    """Return where a simulated probe touches, (3,) mm, scan frame."""
    if name not in CODES:
        if name not in driver.workspace.document.state.skull:
            raise GpError(f"the position of {name} on the scan is not known", landmark=name)
        return np.array(driver.workspace.document.state.skull[name])
    there = driver.truth(side, name) if driver.workspace.scan.truth else driver.placed(side, name)
    if there is None:
        raise GpError(f"{name} {side.word} is not placed, so it cannot be touched", landmark=name)
    return there


@dataclass(frozen=True)
class Skull(Step):
    """Say where the skull's registration features are on the scan.

    Parameters
    ----------
    points : str or table of positions
        A landmark file of the scan, or positions by name such as ``S1``, mm.
    """

    do: ClassVar[str] = "skull"
    points: str | Points

    def run(self, driver: WindowDriver) -> str:  # noqa: D102
        document = driver.workspace.document
        if isinstance(self.points, Mapping):
            document.do(SetSkull(self.points))
        else:
            touching.load_skull(document, driver.to_read(self.points))
        return f"{len(document.state.skull)} skull features"


@dataclass(frozen=True)
class Register(Step):
    """Lay the touches of one side into the scan, and tell how well they fit.

    Parameters
    ----------
    side : L or R
        Side of the head.
    by : str
        ``features`` that are both touched and labelled, ``skull`` features, or ``auto``: the skull's where
        three are known. What a simulation knows is forgotten.
    within : float, optional
        Fail where the fiducial registration error is larger, mm.
    path : str, optional
        Where to write the registration, JSON.
    """

    do: ClassVar[str] = "register"
    says: ClassVar[tuple[str, ...]] = ("side",)
    side: Side
    by: str = "auto"
    within: float | None = None
    path: str | None = None

    def run(self, driver: WindowDriver) -> str:  # noqa: D102
        pose = driver.workspace.pose
        pose.choose(side=self.side, registration=self.by)
        pose.set_registration(self.side, None)
        estimate = current_estimate(driver, self.side)
        registered = estimate.registered
        if registered is None:
            raise GpError(_why_not(estimate))
        found = registered.fiducials
        if self.path is not None and found is not None:
            file = driver.to_write(self.path)
            write_text(file, json.dumps(found.as_dict(), indent=1) + "\n")
            driver.wrote(file)
        for text in () if found is None else found.warnings:
            driver.workspace.say(text, "warning")
        fre = registered.fre_mm
        if self.within is not None and fre is not None and fre > self.within:
            raise GpError(f"fiducial registration error {fre:.3f} mm, allowed are {self.within:g}")
        return _told(estimate, registered)


def current_estimate(driver: WindowDriver, side: Side) -> SideEstimate:
    """Return the estimate of a side as it stands; raises `GpError` where there is none."""
    driver.wait_until_idle()  # the atlas may still be loading
    driver.workspace.pose.choose(side=side)
    estimate = driver.workspace.pose.estimate
    if estimate is None:
        waiting = driver.workspace.pose.waiting_text or "there is no estimate"
        raise GpError(f"{side.word}: {waiting}", remedy="Add a touches step before it.")
    return estimate


def _why_not(estimate: SideEstimate) -> str:
    nothing = "the touches are not registered to the scan: label three of the touched features"
    return estimate.problems.get("registration", nothing)


def _told(estimate: SideEstimate, registered: Registered) -> str:
    if registered.fiducials is None:
        return "the touches were placed on the scan"
    text = f"by {len(registered.fiducials.names)} {registered.way} points, FRE {registered.fre_mm:.3f} mm"
    placed = estimate.in_scan()
    if placed is None:
        return text
    return f"{text}, TRE at the cochlea {registered.tre_mm(placed.origin):.3f} mm"
