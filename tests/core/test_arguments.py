"""Whatever is given to a public function, a user sees a `GpError`; and results cannot be written to."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator, Mapping
from dataclasses import fields, is_dataclass, replace
from enum import Enum
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import gp_core
from gp_core import PROBE, Atlas, GpError, LandmarkSet, Specimen, estimate_pose
from gp_core.argument_types import checks_arguments
from gp_core.atlas.sampling import draw_animal

pytestmark = pytest.mark.machine
"""Checks follow annotations, which Python and NumPy change: the newest of both are on a bare Debian."""

ATLAS = Atlas.published()
TOUCHES = {code: ATLAS[code] for code in PROBE}
POSE = estimate_pose(TOUCHES, "L", ATLAS)
SIDE = LandmarkSet.from_mapping(TOUCHES, "L", frame="tracker")
PLANE = gp_core.MirrorPlane(np.array([0.0, 1.0, 0.0]), 0.0, 0.0, ("CL",), 1.0, 0.1)
CHECK = gp_core.EarCheck(PLANE, 0.1, 1.0, 1.0, 10.0, 1.0)
ANIMAL = draw_animal(ATLAS, rng=np.random.default_rng(0))
OTHER = object()

ODD: dict[str, Any] = {
    "none": None,
    "a number": 1.5,
    "not a number": np.nan,
    "beyond a float": 10**400,
    "beyond a machine's integer": -(10**30),
    "a text": "x",
    "bytes": b"x",
    "numbers": [1, 2, 3],
    "a mapping of numbers": {1: [1, 2, 3]},
    "a mapping of nothing": {"CL": None},
    "an unknown feature": {"XX": [1, 2, 3]},
    "an array": np.full((3, 3), np.nan),
    "an array of texts": np.array(["a"]),
    "an array of no dimension": np.array(1.0),
    "lists of different lengths": [[1, 2, 3], [1, 2]],
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
    "Atlas.save": lambda x: ATLAS.save("/" if isinstance(x, str) else x),
    "rows of an atlas": lambda x: ATLAS.rows(x),
    "tfm": lambda x: POSE.save_tfm("/" if isinstance(x, str) else x),
    "load_labellings": lambda x: gp_core.load_labellings(x),
    "names": lambda x: gp_core.load_labellings("/nowhere", names=object() if x is None else x),
    "read_measurements": lambda x: gp_core.read_measurements(x),
    "reliability": lambda x: gp_core.reliability(x),
    "labelling errors": lambda x: gp_core.LabellingError(x),
    "labelling error": lambda x: gp_core.LabellingError({}, -1 if isinstance(x, float) else x),
    "features of a labelling error": lambda x: gp_core.LabellingError().of(x),
    "suggestion": lambda x: gp_core.Suggestion((1, 2, x)),
    "radius": lambda x: gp_core.Suggestion((1, 2, 3), -1 if x is None else x),
    "vectors": lambda x: POSE.transform_to_touches.apply_vector(x),
    "mirrored points": lambda x: PLANE.mirror(x),
    "mirrored direction": lambda x: PLANE.mirror_direction(x),
    "points of a measurement": lambda x: gp_core.Measurement("Ruler 1", x),
    "scan evidence": lambda x: gp_core.ScanEvidence.from_json(x),
    "pairs of a plane": lambda x: replace(PLANE, pairs_mm=x),
    "expected pairs": lambda x: replace(CHECK, expected_pairs_mm=x),
    "epsilon": lambda x: gp_core.JrmpcSettings(epsilon=-1 if isinstance(x, float) else x),
    "gamma": lambda x: gp_core.JrmpcSettings(gamma=-1 if x is None or isinstance(x, float) else x),
    "held_out": lambda x: gp_core.leave_one_out([ANIMAL] * 3, held_out=[] if x is None else x),
}

_FINE = {
    ("atlas", "none"),
    ("probe_noise", "none"),
    ("probe_noise", "a number"),
    ("shared_error", "a number"),
    ("times", "a number"),
    ("times", "beyond a machine's integer"),
    ("epsilon", "an array of no dimension"),
    ("gamma", "an array of no dimension"),
    ("extra", "numbers"),
    ("position", "numbers"),
    ("unseen", "a mapping of nothing"),  # gone through, it is a list of codes
    ("codes", "a mapping of nothing"),
    ("rows of an atlas", "a mapping of nothing"),
    ("features of a labelling error", "a mapping of nothing"),
    ("suggestion", "a number"),
    ("suggestion", "beyond a machine's integer"),
    ("suggestion", "an array of no dimension"),
    ("radius", "a number"),
    ("radius", "an array of no dimension"),
    ("vectors", "numbers"),
    ("vectors", "an array"),  # of NaN, which is missing
    ("mirrored points", "an array"),
    ("mirrored direction", "numbers"),
    ("mirrored direction", "an array"),
}


@pytest.mark.filterwarnings("ignore:Conversion of an array with ndim")  # an error only from NumPy 2.5 on
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


_CHECK_THEMSELVES = {
    "DistanceCheck.suspect",
    "LabellingError.from_dict",
    "LabellingError.from_reliability",
    "LandmarkSet.__contains__",
    "MirrorPlane.mirror",
    "MirrorPlane.mirror_direction",
    "RigidTransform.apply",
    "RigidTransform.apply_vector",
    "RigidTransform.from_parts",
    "RigidTransform.identity",
    "ScanEvidence.from_json",
}
"""They take anything, or are called too often for a check by annotations; `CALLS` has most of them."""


def test_every_public_function_and_method_checks_its_arguments() -> None:
    unchecked = set()
    for name in gp_core.__all__:
        value = getattr(gp_core, name)
        if inspect.isfunction(value) and not hasattr(value, "__wrapped__"):
            unchecked.add(name)
        if inspect.isclass(value) and value.__module__.startswith("gp_core"):
            unchecked |= {f"{value.__name__}.{method}" for method in _unchecked_methods(value)}
    assert unchecked - _CHECK_THEMSELVES == set()


def _unchecked_methods(cls: type) -> Iterator[str]:
    if issubclass(cls, Exception | Enum):
        return
    for name, value in vars(cls).items():
        method = value.__func__ if isinstance(value, classmethod | staticmethod) else value
        if name.startswith("_") and name not in ("__getitem__", "__contains__", "__matmul__"):
            continue
        is_checked = not inspect.isfunction(method) or hasattr(method, "__wrapped__")
        if not is_checked and len(inspect.signature(method).parameters) > 1:
            yield name


def _results() -> Iterator[Any]:
    """Return one of every public result that holds arrays, and of those that hold such results."""
    rng = np.random.default_rng(0)
    animals = [draw_animal(ATLAS, rng=rng, name=name) for name in "abcd"]
    right = LandmarkSet.from_touches(animals[0].side("R").as_mapping(PROBE), "R")
    left = LandmarkSet.from_touches(animals[0].side("L").as_mapping(PROBE), "L")
    repeated = {code: [left[code], left[code] + 0.1, left[code] - 0.1] for code in PROBE}
    poses = estimate_pose(left, "L"), estimate_pose(right, "R"), estimate_pose(repeated, "L", times={})
    yield estimate_pose({code: TOUCHES[code] for code in ("OS", "MN", "RWA")}, "L").hypotheses[0]
    plane = gp_core.mirror_plane(left, right)
    frames = np.repeat(np.eye(4)[None], 12, axis=0)
    frames[:, :3, :3] = Rotation.random(len(frames), random_state=0).as_matrix()
    frames[:, :3, 3] = [100, 200, 300] - frames[:, :3, :3] @ [10, 20, 150]
    marked = animals[0].side("L").with_point("MN", animals[0].side("L")["MN"] + 5)
    yield from (*poses, poses[0].inputs, plane, gp_core.check_ears(*poses[:2], plane))
    yield from (ATLAS, gp_core.fit_atlas(animals), *animals, gp_core.check_side(marked, ATLAS))
    yield gp_core.jrmpc([side.array(PROBE) for side in (left, right)])
    yield gp_core.register_fiducials(left.as_mapping(), left.as_mapping())
    yield gp_core.calibrate_pivot(frames)
    yield from (gp_core.distances(animals), gp_core.check_distances(left), *gp_core.gains(left, ATLAS))
    yield gp_core.leave_one_out(animals, method="robust")
    yield gp_core.conditions(animals, repeats=1, rng=rng, cases=gp_core.touch_conditions()[:1])
    yield gp_core.simulate(animals, n=2, rng=rng)


def test_no_array_of_a_public_result_can_be_written_to() -> None:
    seen: set[type] = set()
    writeable = {path for result in _results() for path in _writeable(result, type(result).__name__, seen)}
    assert writeable == set()
    classes = {value for name in gp_core.__all__ if is_dataclass(value := getattr(gp_core, name))}
    holders = {cls for cls in classes if any("Array" in str(field.type) for field in fields(cls))}
    assert holders - seen == set()  # a new class with arrays: let _results return one


def _writeable(value: Any, path: str, seen: set[type]) -> Iterator[str]:
    if isinstance(value, np.ndarray):
        if value.flags.writeable:
            yield path
    elif is_dataclass(value) and not isinstance(value, type):
        seen.add(type(value))
        for field in fields(value):
            yield from _writeable(getattr(value, field.name), f"{path}.{field.name}", seen)
    elif isinstance(value, Mapping):
        for each in value.values():
            yield from _writeable(each, f"{path}[]", seen)
    elif isinstance(value, tuple | list):
        for each in value:
            yield from _writeable(each, f"{path}[]", seen)


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


def test_a_named_alias_means_what_it_stands_for() -> None:
    """NumPy 2.5 and later name their types by such aliases, which Python 3.12 brought."""
    aliases = pytest.importorskip("typing_extensions")
    number = aliases.TypeAliasType("number", float | None)
    lengths = aliases.TypeAliasType("lengths", dict[str, float])

    def measured(one: Any, many: Any) -> int:
        return 1

    measured.__annotations__.update(one=number, many=lengths)
    checked = checks_arguments(measured)
    assert checked(2.5, {"CL": 1}) == checked(None, {}) == 1
    with pytest.raises(GpError, match="one must be a number or None, got 'x'"):
        checked("x", {})
    with pytest.raises(GpError, match=r"many must be a mapping of text to number, got \[1\]"):
        checked(1, [1])
