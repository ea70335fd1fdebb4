"""What an estimate was made from, read back from the JSON file of its pose."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from gp_core.atlas.atlas import Atlas
from gp_core.errors import GpError
from gp_core.io.text import shown
from gp_core.landmarks.features import CODES, Side
from gp_core.landmarks.labels import is_skull_feature
from gp_core.landmarks.sets import LandmarkSet, Specimen
from gp_core.pose.estimate_inputs import EarInputs, EstimateInputs

__all__ = ["inputs_from"]


def inputs_from(content: dict[str, Any]) -> EstimateInputs:
    """Return the inputs of an estimate from the entry ``inputs`` of a pose file.

    Parameters
    ----------
    content : dict
        As `EstimateInputs.as_dict` returns it.

    Returns
    -------
    EstimateInputs
        Equal to the saved ones, to the last bit.

    Raises
    ------
    GpError
        A value cannot be what it should be. A `KeyError`, `TypeError`, `ValueError` or `AttributeError` means
        that the content has another structure.
    """
    inputs = _of_one_ear(content)
    return replace(inputs, other_ear=_other_ear(content.get("other_ear"), inputs))


def _other_ear(content: Mapping[str, Any] | None, own: EstimateInputs) -> EarInputs | None:
    """Return the other ear, with atlas and animals of this one where it has none written of its own."""
    if content is None:
        return None
    midline, flags = content["midline"], (content["combined"], content["in_its_frame"])
    if not isinstance(midline, list) or not all(isinstance(flag, bool) for flag in flags):
        raise GpError(f"expected a list of names, true or false, got {shown([midline, *flags])}")
    inputs = _of_one_ear({"atlas": None, "specimens": [], **content["inputs"]})
    if "atlas" not in content["inputs"]:
        inputs = replace(inputs, atlas=own.atlas)
    if "specimens" not in content["inputs"]:
        inputs = replace(inputs, specimens=own.specimens)
    return EarInputs(inputs, tuple(map(str, midline)), *flags)


def _of_one_ear(content: Mapping[str, Any]) -> EstimateInputs:
    chosen, touched = content["settings"], content["touches"]
    times = content["times_s"]
    noise = chosen["probe_noise_mm"]
    return EstimateInputs(
        touches=_touches(touched, Side.parse(chosen["side"])),
        method=str(chosen["method"]),
        round_window=str(chosen["round_window"]),
        probe_noise=None if noise is None else float(noise),
        shared_error=float(chosen["shared_error_mm"]),
        times=None if times is None else {str(code): float(seconds) for code, seconds in times.items()},
        atlas=None if content["atlas"] is None else Atlas.from_dict(content["atlas"]),
        specimens=tuple(_specimen(entry) for entry in content["specimens"]),
        source=str(touched["source"]),
        versions={str(name): str(word) for name, word in content["versions"].items()},
    )


def _touches(content: dict[str, Any], side: Side) -> LandmarkSet:
    points = {str(name): np.array(rows, dtype=np.float64) for name, rows in content["points_mm"].items()}
    once = {name: rows[0] if len(rows) == 1 else rows for name, rows in points.items()}
    known = {name: at for name, at in once.items() if name in CODES or is_skull_feature(name)}
    if others := once.keys() - known.keys():
        raise GpError(f"expected a touched feature, got {shown(min(others))}")
    touches = LandmarkSet.from_touches(known, side, frame=str(content["frame"]))
    return replace(touches, unseen=frozenset(map(str, content["not_seen"])))


def _specimen(content: dict[str, Any]) -> Specimen:
    sides = {}
    for word, labelled in content["sides"].items():
        side = Side.parse(word)
        points = {code: np.array(at, dtype=np.float64) for code, at in labelled["points_mm"].items()}
        sides[side] = LandmarkSet.from_mapping(points, side, frame=str(labelled["frame"]))
    return Specimen(str(content["name"]), sides)
