"""Numbers of a pose in words, and words that somebody typed as numbers."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

from gp_core.constants import METHOD_NAMES
from gp_core.errors import GpError
from gp_core.landmarks.features import CODES, feature
from gp_core.landmarks.repeats import combine_repeats
from gp_core.pose.both_ears import EarCheck
from gp_core.pose.cochlea_pose import CochleaPose
from gp_core.pose.next_touch import TouchGain
from gp_labeler.document.touches import Touch, TouchHow
from gp_labeler.models.both_ears import BothEars
from gp_labeler.models.estimate import SideEstimate
from gp_labeler.views.formatting import NONE, degrees_text, number_text, sentence

__all__ = [
    "allowance_text",
    "change_text",
    "ear_notices",
    "fine_mm",
    "gain_text",
    "likely_text",
    "name_of",
    "parse_position",
    "region_text",
    "touch_text",
    "triple",
    "unit_triple",
]


_MINUS = "\N{MINUS SIGN}"
_LITTLE_MM = 0.1
"""Worth of a touch, see `TouchGain.worth`, below which it is not worth the while."""


def parse_position(text: str, name: str) -> tuple[float, float, float]:
    """Return x, y, z in mm as they were typed or pasted: between them blanks, tabs, commas or semicolons.

    Raises
    ------
    GpError
        These are not three numbers.
    """
    plain = text.replace(_MINUS, "-").strip().strip("()[]")
    parts = plain.replace(";", " ").split()
    if len(parts) == 3:  # a comma inside a number is a decimal one
        parts = [part.rstrip(",").replace(",", ".") for part in parts]
    else:
        parts = plain.replace(";", " ").replace(",", " ").split()
    try:
        x, y, z = (float(part) for part in parts)
    except ValueError:
        got = f"{text!r}" if text.strip() else "nothing"
        raise GpError(
            f"a position is three numbers, got {got}",
            landmark=name,
            remedy="Type x y z in mm, such as 12.3 -4.5 101.2.",
        ) from None
    if not all(map(math.isfinite, (x, y, z))):
        raise GpError(f"a position is three finite numbers, got {text!r}", landmark=name)
    return x, y, z


def name_of(name: str) -> str:
    """Return what a touched point is, such as ``lateral process of the malleus`` or ``skull feature``."""
    return feature(name).name if name in CODES else "skull feature"


def triple(position: Iterable[float]) -> str:
    """Return a position such as ``12.34  -4.50  101.22``, with true minus signs."""
    return "   ".join(number_text(value, 2) for value in position)


def unit_triple(direction: Iterable[float]) -> str:
    """Return a direction to three digits."""
    return "   ".join(number_text(value, 3) for value in direction)


def fine_mm(length: float | None) -> str:
    """Return a length such as ``0.42 mm``: two digits, the precision of a probe."""
    return NONE if length is None or not math.isfinite(length) else f"{length:.2f} mm"


def region_text(pose: CochleaPose) -> str:
    """Return the 95 % region in words; for JRMPC, which has none, the scatter of the animals."""
    within = "95 % within" if pose.method == "robust" else "Animals scatter by"
    return f"{within} {_region(pose.radius_95, pose.cone_95)}"


def _region(radius_mm: float, cone_rad: float) -> str:
    return f"{fine_mm(radius_mm)}  ·  cone {degrees_text(cone_rad)}"


def allowance_text(pose: CochleaPose) -> str:
    """Return what a region allows for, and the plain one; empty for a method that allows for nothing.

    The plain region is that of the touches as they are named, where other readings are not ruled out.
    """
    if pose.shared_error is None:
        return ""
    shared = f"It includes a shared error of {pose.shared_error:g} mm."
    if not pose.is_multimodal:
        return shared
    region, plain = (_region(pose.radius_95, pose.cone_95), _region(pose.plain_radius_95, pose.plain_cone_95))
    named = "" if plain == region else f" As named: {plain}."
    return f"It covers several hypotheses.{named} {shared}"


def ear_notices(ears: BothEars | None, *, wanted: bool) -> Iterator[tuple[str, ...]]:
    """Yield level, words and remedy of what the two ears say of each other; `wanted`: one axis of both."""
    if ears is None:
        return
    if ears.comparison is None:
        problem = f"The two ears cannot be compared: {sentence(ears.problem)}"
        yield ("warning", problem, "Nothing is sent to a robot until they can be.")
        return
    check, link = ears.comparison.check, ears.comparison.link
    apart = (
        f"mirrored, CO is {fine_mm(check.origin_mm)} and the axis {check.axis_deg:.1f}° from the other ear's "
        f"(95 %: {fine_mm(check.expected_mm)}, {check.expected_deg:.1f}°)"
    )
    if check.agrees:
        use = ". The axis is that of both" if wanted else ""
        yield ("info", f"The two ears agree: {apart}{use}.")
    else:
        alone = " Until they agree, nothing is sent to a robot"
        alone += ", and the axis is that of this ear alone." if wanted else "."
        yield ("warning", f"The two ears disagree: {_difference(check, apart)}.", check.remedy + alone)
    if link is not None and link.has_moved:
        yield ("warning", sentence(link.text), "Fix the head or its marker before the next touches.")


def _difference(check: EarCheck, apart: str) -> str:
    """Return what is more than expected: of a suspect feature, else of the pose or of all pairs."""
    if check.suspects:
        code = check.suspects[0]
        far, limit = check.plane.pairs_mm[code], check.expected_pairs_mm[code]
        return (
            f"{code} is {fine_mm(far)} from the mirror image of the other ear's "
            f"(expected: up to {fine_mm(limit)})"
        )
    if check.origin_mm > check.expected_mm or check.axis_deg > check.expected_deg:
        return apart
    far, limit = check.plane.residual_mm, check.expected_residual_mm
    return f"their touches are {fine_mm(far)} from being mirror images (expected: up to {fine_mm(limit)})"


def likely_text(probability: float) -> str:
    """Return how likely a reading is, such as ``9 % likely``."""
    return f"{100 * probability:.0f} % likely" if probability >= 0.01 else "less than 1 % likely"


def gain_text(gain: TouchGain, *, as_named: bool = False) -> str:
    """Return what a touch would gain, such as ``Touch IN next: 0.52 → 0.41 mm, 9.3 → 7.6°``.

    `as_named` where the region shown is a larger one, which covers several hypotheses.
    """
    if gain.worth < _LITTLE_MM:
        return f"More touches gain little; {gain.code} gains most"
    radius = _change(f"{gain.radius_95_now:.2f}", f"{gain.radius_95:.2f} mm")
    now, then = (f"{math.degrees(angle):.1f}" for angle in (gain.cone_95_now, gain.cone_95))
    before = "as named, " if as_named else ""
    return f"Touch {gain.code} next:  {before}{radius},  {_change(now, then)}°"


def _change(now: str, then: str) -> str:
    return f"{now} \N{RIGHTWARDS ARROW} {then}"


def change_text(name: str, touch: Touch, change: tuple[float, float] | None) -> str:
    """Return what leaving a touch out, or taking it in again, would change."""
    word = "With" if touch.left_out else "Without"
    if change is None:
        return f"{word} {name}, there is no estimate" if name in CODES else ""
    moved, turned = change
    return f"{word} {name}, CO moves {fine_mm(moved)}, the axis {turned:.1f}°"


def touch_text(name: str, touch: Touch | None, estimate: SideEstimate | None) -> str:
    """Return everything that is known of a touch, a line each."""
    lines = [f"{name}: {name_of(name)}"]
    if name in CODES:
        lines.append(feature(name).definition)
    if touch is None:
        return "\n".join([*lines, "Not touched yet"])
    lines.append(_how(touch))
    if touch.n_samples > 1:
        lines.append(f"Average of {touch.n_samples} readings, spread {touch.spread_mm:.3f} mm")
    if touch.earlier:
        (one,) = combine_repeats({name: touch.positions}).values()
        lines.append(f"{len(one.points)} touches, the mean of {one.n_used}, spread {fine_mm(one.spread_mm)}")
    if touch.left_out:
        lines.append("Left out of the estimate")
    for method, pose in () if estimate is None else estimate.poses.items():
        if name in pose.residuals:
            lines.append(
                f"{METHOD_NAMES[method]}: {fine_mm(pose.residuals[name])} from the position in the atlas"
            )
        if name in pose.suspects:
            lines.append("Does not fit the other points")
    return "\n".join(lines)


def _how(touch: Touch) -> str:
    words = {TouchHow.FILE: "From a file", TouchHow.TYPED: "Typed", TouchHow.SCAN: "Placed on the scan"}
    text = words.get(touch.how, str(touch.how.value).capitalize())
    details = [touch.source, touch.by, touch.time.replace("T", " ").removesuffix("+00:00")]
    return ", ".join(part for part in (text, *details) if part)
