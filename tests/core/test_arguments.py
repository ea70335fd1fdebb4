"""Whatever is given to a public function, a user sees a `GpError`; and results cannot be written to."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import gp_core
from gp_core import PROBE, Atlas, GpError, LandmarkSet, Specimen, estimate_pose
from gp_core.argument_types import checks_arguments
from gp_core.atlas.sampling import draw_animal

ATLAS = Atlas.published()
TOUCHES = {code: ATLAS[code] for code in PROBE}
POSE = estimate_pose(TOUCHES, "L", ATLAS)
SIDE = LandmarkSet.from_mapping(TOUCHES, "L", frame="tracker")
ANIMAL = draw_animal(ATLAS, rng=np.random.default_rng(0))
OTHER = object()

ODD: dict[str, Any] = {
    "none": None,
    "a number": 1.5,
    "not a number": np.nan,
    "beyond a float": 10**400,
    "a text": "x",
    "bytes": b"x",
    "numbers": [1, 2, 3],
    "a mapping of numbers": {1: [1, 2, 3]},
    "a mapping of nothing": {"CL": None},
    "an unknown feature": {"XX": [1, 2, 3]},
    "an array": np.full((3, 3), np.nan),
    "an array of texts": np.array(["a"]),
    "an object": OTHER,
    "a complex number": 1 + 2j,
    "a pose": POSE,
    "an animal": ANIMAL,
}

CALLS: dict[str, Callable[[Any], Any]] = {
    "touches": lambda x: estimate_pose(x, "L"),
    "position": lambda x: estimate_pose({**TOUCHES, "CL": x}, "L"),
    "side": lambda x: estimate_pose(TOUCHES, x),
    "atlas": lambda x: estimate_pose(TOUCHES, "L", x),
    "method": lambda x: estimate_pose(TOUCHES, "L", method=x),
    "specimens": lambda x: estimate_pose(TOUCHES, "L", method="jrmpc", specimens=x),
    "probe_noise": lambda x: estimate_pose(TOUCHES, "L", probe_noise=x),
    "shared_error": lambda x: estimate_pose(TOUCHES, "L", shared_error=x),
    "times": lambda x: estimate_pose(TOUCHES, "L", times=dict.fromkeys(PROBE, x)),
    "landmark set": lambda x: LandmarkSet(x, "L"),
    "unseen": lambda x: LandmarkSet(SIDE.points, "L", unseen=x),
    "extra": lambda x: LandmarkSet(SIDE.points, "L", extra={"S1": x}),
    "suggested": lambda x: SIDE.with_suggestions(x),
    "code": lambda x: SIDE[x],
    "codes": lambda x: SIDE.array(x),
    "moved": lambda x: SIDE.moved(x),
    "sides": lambda x: Specimen("a", x),
    "rotation": lambda x: gp_core.RigidTransform.from_parts(x, np.zeros(3), dst="a", src="b"),
    "matrix": lambda x: gp_core.RigidTransform(x, "a", "b"),
    "fit_atlas": lambda x: gp_core.fit_atlas(x),
    "mean of an atlas": lambda x: replace(ATLAS, mean=x),
    "feature of an atlas": lambda x: ATLAS[x],
    "path": lambda x: gp_core.carry_path(x, POSE, path_side="L"),
    "pose": lambda x: gp_core.carry_path(np.ones((3, 3)), x if x is not POSE else None, path_side="L"),
    "covariance": lambda x: replace(POSE, covariance=x),
    "check_side": lambda x: gp_core.check_side(x, ATLAS),
    "gains": lambda x: gp_core.gains(x, ATLAS),
    "read_pose": lambda x: gp_core.read_pose(x),
    "load_specimens": lambda x: gp_core.load_specimens(x),
    "limit": lambda x: gp_core.PoseGate(max_radius_mm=-1.0 if isinstance(x, float) else x),
    "fiducials": lambda x: gp_core.register_fiducials(TOUCHES, x),
    "pivot": lambda x: gp_core.calibrate_pivot(x),
    "jrmpc": lambda x: gp_core.jrmpc(x),
    "leave_one_out": lambda x: gp_core.leave_one_out(x),
    "conditions": lambda x: gp_core.conditions([] if x is None else x, rng=np.random.default_rng(0)),
    "Atlas.load": lambda x: Atlas.load(x),
}

_FINE = {
    ("atlas", "none"),
    ("probe_noise", "none"),
    ("probe_noise", "a number"),
    ("shared_error", "a number"),
    ("times", "a number"),
    ("extra", "numbers"),
    ("position", "numbers"),
    ("unseen", "a mapping of nothing"),  # gone through, it is a list of codes
    ("codes", "a mapping of nothing"),
}


@pytest.mark.parametrize("call", CALLS)
def test_odd_arguments_are_refused_in_one_line(call: str) -> None:
    for kind, value in ODD.items():
        if (call, kind) in _FINE:
            CALLS[call](value)
            continue
        with pytest.raises(GpError) as caught:
            CALLS[call](value)
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize("names", [("CL", "cl"), ("rwa ", "RWA")])
def test_a_name_that_is_given_twice_is_refused(names: tuple[str, str]) -> None:
    touches = {**TOUCHES, names[0]: TOUCHES["CL"], names[1]: TOUCHES["OS"]}
    with pytest.raises(GpError, match="is given twice"):
        estimate_pose(touches, "L")


def test_results_own_their_arrays_and_do_not_let_them_be_written() -> None:
    covariance = np.eye(6)
    pose = replace(POSE, covariance=covariance)
    covariance[0, 0] = 99
    assert pose.covariance[0, 0] == 1
    found = gp_core.jrmpc([SIDE.array(PROBE)] * 3)
    three = estimate_pose({code: TOUCHES[code] for code in ("OS", "MN", "RWA")}, "L")
    for array in (
        pose.covariance,
        pose.origin,
        pose.transform,
        ATLAS.mean,
        SIDE["CL"],
        found.rotations,
        three.hypotheses[0].covariance,
    ):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1


def test_the_message_names_the_argument_what_it_must_be_and_what_it_was() -> None:
    @checks_arguments
    def measured(side: gp_core.Side | str, lengths: dict[str, float], n: int = 3) -> int:
        return n

    assert measured("L", {"CL": 1}) == 3
    for arguments, message in (
        (("L", {"CL": "1"}), "lengths must be a mapping of text to number, got {'CL': '1'}"),
        (("L", {}, 2.5), "n must be a whole number, got 2.5"),
        ((3, {}), "side must be a Side or a text, got 3"),
    ):
        with pytest.raises(GpError) as caught:
            measured(*arguments)  # type: ignore[arg-type]
        assert str(caught.value).rstrip(".") == message
