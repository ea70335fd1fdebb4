"""Coverage of the 95 % regions under many conditions, and how often wrong sides and names are detected.

Each animal is estimated with an atlas that excludes it, both sides. Without labelled animals, cohorts are
drawn from atlases that differ from the published one by as much as two small cohorts do.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gp_core.argument_types import checks_arguments
from gp_core.atlas.atlas import Atlas
from gp_core.atlas.sampling import draw_animal, perturbed_atlas
from gp_core.errors import GeometryError, GpError
from gp_core.frames import angle_between_deg
from gp_core.landmarks.features import EXTERNAL, PROBE, RECOMMENDED
from gp_core.landmarks.sets import LandmarkSet, Specimen
from gp_core.pose.estimate import estimate_pose
from gp_core.pose.systematic_error import DEFAULT_SHARED_ERROR_MM
from gp_core.study.leave_one_out import held_out_sides
from gp_core.study.parallel import run_map
from gp_core.study.sessions import (
    Disturbance,
    anisotropic,
    drift,
    exchanged,
    knocked_marker,
    mistouch,
    other_size,
    soft_tissue,
    tip_offset,
    touch_session,
    wrong_side,
)
from gp_core.study.subsets import check_labels
from gp_core.validation import FloatArray, freeze_arrays

__all__ = ["GROUPS", "ConditionRow", "ConditionsReport", "TouchCondition", "conditions", "touch_conditions"]

_DEFAULT = DEFAULT_SHARED_ERROR_MM
_CAREFUL = 0.1
_RESAMPLES = 1000
_TRIES = 20

GROUPS = ("noise", "few", "shared", "size", "mistouch", "side", "names")


@dataclass(frozen=True)
class TouchCondition:
    """What is touched, with what errors, and the shared error that the estimate is told.

    Attributes
    ----------
    group : str
        Of `GROUPS`.
    label : str
        A few words.
    codes : tuple of str
        The touched features.
    noise_mm : float
        Gaussian noise of each coordinate.
    shared_error_mm : float
        What `estimate_pose` is told.
    disturbances : tuple of Disturbance
        What goes wrong.
    n_random : int
        Touch only so many of `codes`, drawn each time; 0: all.
    """

    group: str
    label: str
    codes: tuple[str, ...] = PROBE
    noise_mm: float = _CAREFUL
    shared_error_mm: float = _DEFAULT
    disturbances: tuple[Disturbance, ...] = ()
    n_random: int = 0

    @property
    def n_touches(self) -> int:
        """How many features are touched."""
        return self.n_random or len(self.codes)


@checks_arguments
def touch_conditions(groups: Sequence[str] = GROUPS) -> tuple[TouchCondition, ...]:
    """Return all conditions of some groups, in the order of the table.

    Parameters
    ----------
    groups : sequence of str
        Names of groups; by default all.

    Returns
    -------
    tuple of TouchCondition
        The conditions.

    Raises
    ------
    GpError
        There is no such group.
    """
    unknown = [group for group in groups if group not in GROUPS]
    if unknown:
        raise GpError(f"unknown group of conditions {unknown[0]!r}", remedy=f"Choose of {' '.join(GROUPS)}.")
    return tuple(condition for condition in _all_conditions() if condition.group in groups)


def _all_conditions() -> Iterator[TouchCondition]:
    for noise in (0.0, 0.1, 0.25, 0.4):
        for codes in (PROBE, RECOMMENDED):
            yield TouchCondition("noise", f"noise {noise:g}", codes, noise)
    yield TouchCondition("noise", "noise 0.1, 0.4 in depth", disturbances=(anisotropic(4.0),))
    for n in (3, 4):
        for noise in (0.1, 0.25):
            yield TouchCondition("few", f"noise {noise:g}", EXTERNAL, noise, n_random=n)
    for words, disturb in (
        ("tip offset", tip_offset),
        ("soft tissue", soft_tissue),
        ("knocked marker", knocked_marker),
        ("drift", drift),
    ):
        for size in (0.2, 0.3, 0.5, 1.0):
            told = max(size, _DEFAULT)
            yield TouchCondition(
                "shared", f"{words} {size:g}", shared_error_mm=told, disturbances=(disturb(size),)
            )
    timed = drift(1.0, timed=True)
    yield TouchCondition("shared", "drift 1, with times", shared_error_mm=1.0, disturbances=(timed,))
    for factor in (0.85, 0.9, 1.0, 1.1, 1.15, 1.2):
        for codes in (PROBE, EXTERNAL):
            yield TouchCondition("size", f"size {factor:g}", codes, disturbances=(other_size(factor),))
    for noise in (0.1, 0.25):
        for codes in (PROBE, RECOMMENDED):
            off = (mistouch("MN", 3.0),)
            yield TouchCondition("mistouch", f"MN 3 mm off, noise {noise:g}", codes, noise, disturbances=off)
    for noise in (0.1, 0.25, 0.4):
        for codes in (PROBE, RECOMMENDED):
            yield TouchCondition(
                "side", f"wrong side, noise {noise:g}", codes, noise, disturbances=(wrong_side,)
            )
    for noise in (0.1, 0.25):
        for a, b in combinations(PROBE, 2):
            label = f"{a} and {b} exchanged, noise {noise:g}"
            yield TouchCondition("names", label, noise_mm=noise, disturbances=(exchanged((a, b)),))


@dataclass(frozen=True)
class ConditionRow:
    """What came of one condition.

    Attributes
    ----------
    condition : TouchCondition
    animals : (N,) array of int
        Which animal each estimate is of.
    values : dict of str to (N,) array
        ``e_co_mm`` and ``e_ma_deg``, the errors; ``radius_mm`` and ``cone_deg``, the 95 % region; the same
        with ``plain_`` where the touches are taken as they are named, and with ``bare_`` without a shared
        error too.
    states : (N, 2) array of str
        State of the side and of the names.
    """

    condition: TouchCondition
    animals: NDArray[np.int64]
    values: dict[str, FloatArray]
    states: NDArray[np.str_]

    def __post_init__(self) -> None:
        freeze_arrays(self)

    def held(self, region: str) -> FloatArray:
        """Return which estimates have the truth within a region.

        Parameters
        ----------
        region : str
            A region of `values`, such as ``plain_cone_deg``.

        Returns
        -------
        (N,) array
            1 where the region contains the truth, else 0.
        """
        error = "e_co_mm" if region.endswith("mm") else "e_ma_deg"
        return (self.values[error] <= self.values[region]).astype(np.float64)

    def interval(self, values: FloatArray) -> tuple[float, float]:
        """Return the 95 % bootstrap interval of a mean, resampled over animals.

        Parameters
        ----------
        values : (N,) array
            One value per estimate.

        Returns
        -------
        low, high : float
            Bounds of the mean.
        """
        means = np.array([values[self.animals == animal].mean() for animal in np.unique(self.animals)])
        drawn = np.random.default_rng(0).choice(means, (_RESAMPLES, len(means))).mean(axis=1)
        low, high = np.percentile(drawn, (2.5, 97.5))
        return float(low), float(high)

    def as_dict(self) -> dict[str, Any]:
        """Return the row as the JSON file holds it: means, fractions, and 95 % intervals over animals.

        Returns
        -------
        dict
            Plain values for JSON; lengths in mm, angles in degrees.
        """
        condition, values = self.condition, self.values
        out: dict[str, Any] = {
            "group": condition.group,
            "condition": condition.label,
            "n_touches": condition.n_touches,
            "noise_mm": condition.noise_mm,
            "shared_error_mm": condition.shared_error_mm,
            "n": len(self.animals),
            "e_co_mm": float(values["e_co_mm"].mean()),
            "e_ma_deg": float(values["e_ma_deg"].mean()),
        }
        for name in ("radius_mm", "cone_deg"):
            held, plain = self.held(name), values[f"plain_{name}"]
            out[f"{name}_holds"] = float(held.mean())
            out[f"{name}_holds_interval"] = list(self.interval(held))
            out[f"{name}_plain_holds"] = float(self.held(f"plain_{name}").mean())
            out[name] = float(np.median(values[name]))
            out[f"{name}_plain"] = float(np.median(plain))
            out[f"{name}_growth"] = float(np.median(plain / values[f"bare_{name}"]))
        for i, what in enumerate(("side", "names")):
            for state in ("undecided", "wrong"):
                out[f"{what}_{state}"] = float(np.mean(self.states[:, i] == state))
        return out


@dataclass(frozen=True)
class ConditionsReport:
    """All conditions.

    Attributes
    ----------
    animals : str
        What they are, and how often touched.
    rows : tuple of ConditionRow
    """

    animals: str
    rows: tuple[ConditionRow, ...]

    def as_dict(self) -> dict[str, Any]:
        """Return the report as the JSON file holds it.

        Returns
        -------
        dict
            Plain values for JSON; lengths in mm, angles in degrees.
        """
        return {"animals": self.animals, "rows": [row.as_dict() for row in self.rows]}


@checks_arguments
def conditions(
    specimens: Sequence[Specimen] | None = None,
    *,
    repeats: int = 10,
    n_animals: int = 11,
    rng: np.random.Generator,
    cases: Sequence[TouchCondition] | None = None,
    executor: Executor | None = None,
) -> ConditionsReport:
    """Measure the coverage of the 95 % regions, and the detection of wrong sides and names, per condition.

    Parameters
    ----------
    specimens : sequence of Specimen, optional
        At least three labelled animals; each is held out, both sides. By default cohorts are drawn.
    repeats : int
        Number of times that each side is touched in each condition; where animals are drawn, number of
        cohorts.
    n_animals : int
        Number of animals drawn for a cohort.
    rng : numpy Generator
        Source of random numbers.
    cases : sequence of TouchCondition, optional
        By default `touch_conditions`.
    executor : concurrent.futures.Executor, optional
        Runs the repeats; the result does not depend on it.

    Returns
    -------
    ConditionsReport
        One row for each condition.

    Raises
    ------
    GpError
        Too few animals, or a feature is missing.
    """
    if repeats < 1:
        raise GpError(f"the number of repeats must be 1 or more, got {repeats}")
    if specimens is None and n_animals < 3:
        raise GpError(f"a cohort needs at least 3 animals, got {n_animals}")
    if specimens is not None:
        check_labels(specimens, EXTERNAL)
    chosen = touch_conditions() if cases is None else tuple(cases)
    held = None if specimens is None else _held_out(specimens)
    parts = run_map(partial(_repeat, held, n_animals, chosen), rng.spawn(repeats), executor)
    rows = []
    for k, case in enumerate(chosen):
        animals = np.concatenate([part[k].animals for part in parts])
        if specimens is None:  # every cohort has animals of its own
            animals += n_animals * np.repeat(np.arange(len(parts)), [len(part[k].animals) for part in parts])
        values = {
            name: np.concatenate([part[k].values[name] for part in parts]) for name in parts[0][k].values
        }
        rows.append(ConditionRow(case, animals, values, np.concatenate([part[k].states for part in parts])))
    words = (
        f"{repeats} cohorts of {n_animals} animals drawn from perturbed atlases"
        if specimens is None
        else f"{len(specimens)} labelled animals, each side touched {repeats} times"
    )
    return ConditionsReport(words, tuple(rows))


_HeldOut = list[tuple[int, Atlas, LandmarkSet]]


def _held_out(specimens: Sequence[Specimen]) -> _HeldOut:
    atlases, truths = held_out_sides(specimens, EXTERNAL)
    numbers: dict[int, int] = {}  # both sides of an animal share an atlas
    return [
        (numbers.setdefault(id(atlas), len(numbers)), atlas, truth)
        for atlas, truth in zip(atlases, truths, strict=True)
    ]


def _repeat(
    held: _HeldOut | None, n_animals: int, cases: Sequence[TouchCondition], rng: np.random.Generator
) -> list[ConditionRow]:
    """Touch every side once in every case."""
    if held is None:
        atlas = perturbed_atlas(Atlas.published(), rng=rng)
        held = _held_out([draw_animal(atlas, rng=rng, name=f"{i}") for i in range(n_animals)])
    found = []
    for case in cases:
        outcomes = [_estimate(case, atlas, truth, rng) for _, atlas, truth in held]
        values = {name: np.array([one[name] for one, _ in outcomes]) for name in outcomes[0][0]}
        animals = np.array([number for number, _, _ in held])
        found.append(ConditionRow(case, animals, values, np.array([states for _, states in outcomes])))
    return found


def _estimate(
    case: TouchCondition, atlas: Atlas, truth: LandmarkSet, rng: np.random.Generator
) -> tuple[dict[str, float], tuple[str, str]]:
    """Simulate sessions until one gives a pose: a few random touches may be too close together."""
    for _ in range(_TRIES):
        codes = case.codes
        if case.n_random:
            codes = tuple(str(code) for code in rng.choice(codes, case.n_random, replace=False))
        session, reported = touch_session(truth, codes, case.noise_mm, case.disturbances, rng)
        times = {code: float(i) for i, code in enumerate(session.codes)} if session.timed else None
        try:
            pose, bare = (
                estimate_pose(reported, session.side, atlas, shared_error=mm, times=times)
                for mm in (case.shared_error_mm, 0.0)
            )
        except GeometryError:
            continue
        values = {
            "e_co_mm": float(np.linalg.norm(pose.origin - session.truth["CO"])),
            "e_ma_deg": float(angle_between_deg(pose.axis, session.truth["CA"] - session.truth["CO"])),
            "radius_mm": pose.radius_95,
            "cone_deg": np.degrees(pose.cone_95),
            "plain_radius_mm": pose.plain_radius_95,
            "plain_cone_deg": np.degrees(pose.plain_cone_95),
            "bare_radius_mm": bare.plain_radius_95,
            "bare_cone_deg": np.degrees(bare.plain_cone_95),
        }
        return values, (pose.side_state, pose.names_state)
    raise GpError(f"no touches of {case.label!r} give a pose")
