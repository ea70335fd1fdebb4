"""Landmarks and files for the tests of this folder: made-up sets, and what other programs write."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gp_core.landmarks.features import CODES
from gp_core.landmarks.sets import LandmarkSet

SHARED = Path(__file__).resolve().parents[3] / "shared" / "data"

needs_shared_data = pytest.mark.skipif(not SHARED.is_dir(), reason=f"the shared data are not at {SHARED}")


def some_landmarks(side: str = "L", *, seed: int = 0, frame: str = "scan", n_placed: int = 20) -> LandmarkSet:
    rng = np.random.default_rng(seed)
    chosen = sorted(rng.permutation(len(CODES))[:n_placed])
    return LandmarkSet.from_mapping({CODES[i]: rng.normal(0, 7, 3) for i in chosen}, side, frame=frame)


def same_landmarks(a: LandmarkSet, b: LandmarkSet) -> bool:
    """Whether two sets are the same to the last bit."""
    return (
        a.points.tobytes() == b.points.tobytes()
        and (a.side, a.frame, a.unseen) == (b.side, b.frame, b.unseen)
        and {k: v.tobytes() for k, v in a.extra.items()} == {k: v.tobytes() for k, v in b.extra.items()}
    )


def control_point(label: Any = "CA", position: Any = (1.0, 2.0, 3.0), **more: Any) -> dict[str, Any]:
    return {"label": label, "position": list(position) if isinstance(position, tuple) else position, **more}


def markup(*points: dict[str, Any], **more: Any) -> dict[str, Any]:
    return {"type": "Fiducial", "coordinateSystem": "LPS", "controlPoints": list(points), **more}


def write_json(path: Path, *markups: Any, **more: Any) -> Path:
    path.write_text(json.dumps({"@schema": "…v1.0.3.json#", "markups": list(markups), **more}))
    return path
