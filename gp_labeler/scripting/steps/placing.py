"""Steps that place and move points by clicks and drags on the real views."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from gp_core.errors import GpError
from gp_core.landmarks.features import Side, feature
from gp_core.landmarks.suggestion import Suggestion
from gp_core.validation import FloatArray
from gp_labeler.document.edits import PlacePoint, SuggestPoints
from gp_labeler.document.state import How
from gp_labeler.scene.planes import Plane
from gp_labeler.scripting.events import click, drag, press_keys
from gp_labeler.scripting.step import Lengths, Pair, Positions, Step, Triple
from gp_labeler.scripting.viewpoint_search import aim_at_bone, scroll_to
from gp_labeler.scripting.window_driver import VIEWS, WindowDriver

__all__ = ["Choose", "Confirm", "Drag", "Place", "Put", "Suggest"]

_KEYS = {"ghost": "Return", "crosshair": "Space"}


@dataclass(frozen=True)
class Place(Step):
    """Choose a feature by a click on its row, and place it by a click, or a key, in a view.

    Parameters
    ----------
    feature : str
        Its code.
    side : L or R
        Which side.
    at : three numbers or str, optional
        A scan position, mm, through which the click goes: the view is scrolled and zoomed to it.
        ``truth`` is where the phantom has the feature. ``crosshair`` presses the key that places the point
        where the crosshair is. ``ghost`` presses the key that suggests it where the atlas expects it; then it
        counts as placed only once a step `confirm` confirms it.
    pixel : two numbers, optional
        Instead of `at`: a logical pixel of the view as it is, from its top left.
    view : str
        ``3d``, ``axial``, ``sagittal``, ``coronal``, or ``best``: where the feature table says it is found.
    within : float, optional
        Fail where the point comes to lie farther than this from `at`, mm.
    """

    do: ClassVar[str] = "place"
    says: ClassVar[tuple[str, ...]] = ("feature", "side")
    feature: str
    side: Side
    at: Triple | str | None = None
    pixel: Pair | None = None
    view: str = "best"
    within: float | None = None

    def run(self, driver: WindowDriver) -> str:  # noqa: D102
        code = feature(self.feature).code
        if (self.at is None) == (self.pixel is None):
            raise GpError("place needs at or pixel, one of them", landmark=code)
        _ = driver.voxel
        before, since = driver.workspace.document.state, len(driver.messages)
        driver.choose(self.side, code)
        if self.at != "ghost" and driver.shown_at(self.side, code) is not None:
            driver.workspace.interaction.arm_replacing()  # a click alone leaves a point where it is
        name = self._hit(driver, code)
        driver.wait_until_idle(in_passing=False)
        if driver.workspace.document.state is before:
            why = " ".join(text for text, _ in driver.messages[since:]) or "nothing was hit"
            raise GpError(f"{code} {self.side.word} was not placed: {why}", landmark=code)
        return self._result(driver, code, name)

    def _hit(self, driver: WindowDriver, code: str) -> str:
        """Click or press; return where."""
        if isinstance(self.at, str) and self.at in _KEYS:
            view = driver.view("axial" if self.view == "best" else self.view)
            view.setFocus()
            press_keys(view, _KEYS[self.at])
            return self.at
        name = self.view
        if self.pixel is not None:
            name = "axial" if name == "best" else name
            click(driver.view(name), *self.pixel)
            return name
        aim = self._aim(driver, code)
        name = _seen_in(driver, name, code, aim)
        view = driver.view(name)
        click(view, *view.pixel_at(aim))
        return name

    def _aim(self, driver: WindowDriver, code: str) -> FloatArray:
        if isinstance(self.at, str):
            if self.at != "truth":
                raise GpError(f"at must be truth, ghost, crosshair or a position, got {self.at!r}")
            return driver.truth(self.side, code)
        aim, volume = np.array(self.at, dtype=np.float64), driver.workspace.scan.volume
        if volume is not None and not volume.contains(aim[None])[0]:
            low, high = volume.extent
            reach = ", ".join(f"{a:.4g} to {b:.4g}" for a, b in zip(low, high, strict=True))
            raise GpError(f"at lies outside the scan, which reaches from {reach} mm", landmark=code)
        return aim

    def _result(self, driver: WindowDriver, code: str, name: str) -> str:
        there = driver.placed(self.side, code)
        if there is None or (self.at in _KEYS) or self.at is None:
            return name
        off = float(np.linalg.norm(there - self._aim(driver, code)))
        if self.within is not None and off > self.within:
            raise GpError(
                f"{code} {self.side.word} came to lie {off:.3f} mm off, allowed are {self.within:g}",
                landmark=code,
            )
        return f"{name}, {off:.3f} mm from there"


def _seen_in(driver: WindowDriver, name: str, code: str, aim: FloatArray) -> str:
    """Bring a position into view, and return the name of the view to click in."""
    if name == "best":
        name = feature(code).view.lower()
        if name == "3d" and not aim_at_bone(driver, aim, turn=True):
            name = "axial"  # hidden behind bone from everywhere
    elif name == "3d" and not aim_at_bone(driver, aim, turn=False):
        raise GpError(
            "bone hides that position from where the camera is",
            remedy='Change the camera, or use view = "best".',
        )
    if name not in VIEWS:
        raise GpError(f"view must be best or one of {', '.join(VIEWS)}, got {name!r}")
    if name != "3d":
        scroll_to(driver, Plane(name), aim)
    return name


@dataclass(frozen=True)
class Put(Step):
    """Put a point at exactly a position, without a click: how a recorder writes what clicks and drags did.

    Parameters
    ----------
    feature : str
        Its code.
    side : L or R
        Which side.
    at : three numbers
        Scan position, mm.
    how : str
        What is remembered of it: ``mesh``, ``slice``, ``typed``, ``imported``, ``confirmed suggestion`` or
        ``nudged suggestion``. With ``accepted ghost``, as scripts of earlier versions have it, the point is
        only suggested there.
    nudge : bool
        Whether it is moved by arrow keys; such movements in a row are one undo.
    """

    do: ClassVar[str] = "put"
    says: ClassVar[tuple[str, ...]] = ("feature", "side")
    feature: str
    side: Side
    at: Triple
    how: str = "typed"
    nudge: bool = False

    def run(self, driver: WindowDriver) -> None:  # noqa: D102
        _ = driver.voxel  # a scan must be there
        code, how = feature(self.feature).code, _how(self.how)
        driver.choose(self.side, code)
        document, labels = driver.workspace.document, driver.workspace.labels
        if self.nudge:
            how = How.NUDGED if how is How.GHOST else how
            found = document.provenance(how)
            document.do(PlacePoint(self.side, code, self.at, found, verb="nudge"), merge=True)
        else:
            labels.place(self.at, how, side=self.side, code=code)
        driver.wait_until_idle(in_passing=False)


def _how(word: str) -> How:
    words = [how.value for how in How if how is not How.UNSEEN]
    if word not in words:
        raise GpError(f"how must be one of {', '.join(words)}, got {word!r}")
    return How(word)


@dataclass(frozen=True)
class Suggest(Step):
    """Suggest where points are, for a person to confirm; what is placed or unseen stays as it is.

    Parameters
    ----------
    points : mapping of str to three numbers
        Scan positions by feature code, mm.
    side : L or R
        Which side.
    radii : mapping of str to float
        By feature code, where known: radius that holds the point with 95 % probability, mm.
    source : str
        What suggests them.
    """

    do: ClassVar[str] = "suggest"
    says: ClassVar[tuple[str, ...]] = ("side",)
    points: Positions
    side: Side
    radii: Lengths = field(default_factory=dict)
    source: str = ""

    def run(self, driver: WindowDriver) -> str:  # noqa: D102
        _ = driver.voxel  # a scan must be there
        document, labels = driver.workspace.document, driver.workspace.labels
        radii = {feature(code).code: radius for code, radius in self.radii.items()}
        suggestions = {
            code: Suggestion(at, radii.get(feature(code).code), self.source)
            for code, at in self.points.items()
        }
        document.do(SuggestPoints(self.side, suggestions, document.provenance(How.GHOST)))
        driver.wait_until_idle(in_passing=False)
        return f"{labels.progress(self.side).n_suggested} suggested"


@dataclass(frozen=True)
class Confirm(Step):
    """Confirm a suggested point, as a person does: look closely at it, then press the key.

    Parameters
    ----------
    feature : str
        Its code; its ghost is accepted first where it is not suggested yet.
    side : L or R
        Which side.
    within : float, optional
        Fail, and confirm nothing, where it lies farther than this from its true place in the phantom, mm.
    correct : bool
        Place it at its true place instead of failing, as a person does who sees that the suggestion is wrong.
    """

    do: ClassVar[str] = "confirm"
    says: ClassVar[tuple[str, ...]] = ("feature", "side")
    feature: str
    side: Side
    within: float | None = None
    correct: bool = False

    def run(self, driver: WindowDriver) -> str:  # noqa: D102
        code = feature(self.feature).code
        driver.choose(self.side, code)
        off = None if self.within is None else self._off(driver, code)
        if off is not None and self.within is not None and off > self.within:
            return self._refuse(driver, code, off)
        for _ in range(_MOST_LOOKS):
            if driver.workspace.document.state.landmark(self.side, code).decided:
                break
            driver.window.commands.run("point.confirm")
            driver.wait_until_idle(in_passing=False)
        if driver.placed(self.side, code) is None:
            raise GpError(f"{code} {self.side.word} has no suggestion to confirm", landmark=code)
        return "" if off is None else f"{off:.3f} mm from there"

    def _off(self, driver: WindowDriver, code: str) -> float:
        """Return how far it is suggested from its true place, mm."""
        where = driver.workspace.labels.place_of(self.side, code)
        if where is None:
            raise GpError(f"{code} {self.side.word} has no suggestion to confirm", landmark=code)
        return float(np.linalg.norm(where - driver.truth(self.side, code)))

    def _refuse(self, driver: WindowDriver, code: str, off: float) -> str:
        """Correct a suggestion that is too far off, or fail."""
        if not self.correct:
            problem = f"{code} {self.side.word} is suggested {off:.3f} mm off, allowed are {self.within:g}"
            raise GpError(problem, landmark=code)
        placed = Place(self.feature, self.side, at="truth", within=self.within).run(driver)
        return f"suggested {off:.3f} mm off, so placed: {placed}"


_MOST_LOOKS = 3
"""Times that the key is pressed: it brings the view there, perhaps in another layout, then confirms."""


@dataclass(frozen=True)
class Choose(Step):
    """Choose a feature by a click on its row, for a command that follows.

    Parameters
    ----------
    feature : str
        Its code.
    side : L or R
        Which side.
    """

    do: ClassVar[str] = "choose"
    says: ClassVar[tuple[str, ...]] = ("feature", "side")
    feature: str
    side: Side

    def run(self, driver: WindowDriver) -> None:  # noqa: D102
        driver.choose(self.side, self.feature)


@dataclass(frozen=True)
class Drag(Step):
    """Drag a placed point to another place, or a suggested one, which is placed by that.

    Parameters
    ----------
    feature : str
        Its code.
    side : L or R
        Which side.
    to : three numbers, optional
        Scan position, mm, to whose picture it is dragged.
    by : two numbers, optional
        Instead: logical pixels, right and down.
    view : str
        ``3d``, ``axial``, ``sagittal`` or ``coronal``.
    """

    do: ClassVar[str] = "drag"
    says: ClassVar[tuple[str, ...]] = ("feature", "side")
    feature: str
    side: Side
    to: Triple | None = None
    by: Pair | None = None
    view: str = "axial"

    def run(self, driver: WindowDriver) -> str:  # noqa: D102
        code = feature(self.feature).code
        start = driver.shown_at(self.side, code)
        if (self.to is None) == (self.by is None):
            raise GpError("drag needs to or by, one of them", landmark=code)
        if start is None:
            raise GpError(f"{code} {self.side.word} is not placed yet", landmark=code)
        view = driver.view(self.view)
        driver.choose(self.side, code)
        driver.bring(start)
        if self.view == "3d":
            aim_at_bone(driver, start, turn=False)
        elif self.by is None:
            scroll_to(driver, Plane(self.view), start)
        driver.app.processEvents()
        here = view.pixel_at(start)
        there = (here[0] + self.by[0], here[1] + self.by[1]) if self.by else view.pixel_at(np.array(self.to))
        since = len(driver.messages)
        drag(view, here, there)
        driver.wait_until_idle(in_passing=False)
        end = driver.placed(self.side, code)
        if end is None or np.allclose(start, end, atol=1e-9):
            why = " ".join(text for text, _ in driver.messages[since:]) or "it did not move"
            raise GpError(f"{code} {self.side.word} was not moved: {why}", landmark=code)
        return f"by {math.dist(start, end):.3f} mm"
