"""What a script did: each step with its time, each feature with its error, the poses."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from gp_core.disk import write_text
from gp_core.landmarks.features import CODES, Side
from gp_core.landmarks.provenance import LabelProvenance
from gp_labeler.scripting.window_driver import WindowDriver

__all__ = ["RunReport", "StepRecord", "feature_rows", "pose_rows", "suggested_rows"]


@dataclass(frozen=True)
class StepRecord:
    """A step that was done, or failed.

    Parameters
    ----------
    number : int
        Which, from 1.
    title : str
        The step in a few words.
    text : str
        What came of it.
    seconds : float
        How long it took.
    warnings : tuple of str
        What the window warned of meanwhile.
    """

    number: int
    title: str
    text: str = ""
    seconds: float = 0.0
    warnings: tuple[str, ...] = ()


@dataclass
class RunReport:
    """The result of one run.

    Parameters
    ----------
    script : str
        Its name.
    specimen : str
        What was open at the end.
    error : str
        Why it stopped; empty where it came to its end.
    """

    script: str
    specimen: str = ""
    error: str = ""
    observer: str = ""
    round: int = 1
    steps: list[StepRecord] = field(default_factory=list)
    features: list[dict[str, Any]] = field(default_factory=list)
    suggested: list[dict[str, Any]] = field(default_factory=list)
    poses: list[dict[str, Any]] = field(default_factory=list)
    files: list[str] = field(default_factory=list)

    @property
    def ok(self) -> bool:
        """Whether every step was done."""
        return not self.error

    @property
    def seconds(self) -> float:
        """How long all steps took."""
        return sum(step.seconds for step in self.steps)

    def take_stock(self, driver: WindowDriver) -> None:
        """Note what the window holds now."""
        state = driver.workspace.document.state
        self.specimen, self.observer, self.round = state.specimen, state.labeller, state.round
        self.features, self.suggested = feature_rows(driver), suggested_rows(driver)
        self.poses = pose_rows(driver)
        self.files = [_relative(file, driver.output) for file in driver.files]

    def as_dict(self) -> dict[str, Any]:
        """Return the report as its file holds it; lengths in mm."""
        errors = [row["error_mm"] for row in self.features if row.get("error_mm") is not None]
        voxels = [row["error_voxels"] for row in self.features if row.get("error_voxels") is not None]
        return {
            "script": self.script,
            "specimen": self.specimen,
            "observer": self.observer,
            "round": self.round,
            "ok": self.ok,
            "error": self.error,
            "seconds": round(self.seconds, 3),
            "n_placed": len(self.features),
            "n_suggested": len(self.suggested),
            "largest_error_mm": max(errors, default=None),
            "largest_error_voxels": max(voxels, default=None),
            "steps": [
                {
                    "number": step.number,
                    "step": step.title,
                    "result": step.text,
                    "seconds": round(step.seconds, 3),
                    "warnings": list(step.warnings),
                }
                for step in self.steps
            ],
            "features": self.features,
            "suggested": self.suggested,
            "poses": self.poses,
            "files": self.files,
        }

    def save(self, path: Path) -> None:
        """Write the report as JSON."""
        write_text(path, json.dumps(self.as_dict(), indent=1) + "\n")


def feature_rows(driver: WindowDriver) -> list[dict[str, Any]]:
    """Return a row for each placed or computed feature: where it is and, of a phantom, where it should be."""
    rows = []
    for side in Side:
        landmarks = driver.workspace.document.state.described_side(side)
        for code in (code for code in CODES if code in landmarks):
            row: dict[str, Any] = {"side": side.value, "feature": code, "placed": landmarks[code].tolist()}
            row |= _annotation(landmarks.provenance.get(code))
            if driver.workspace.scan.truth is not None:
                truth = driver.truth(side, code)
                off = float(np.linalg.norm(landmarks[code] - truth))
                row |= {"true": truth.tolist(), "error_mm": off, "error_voxels": off / driver.voxel}
            rows.append(row)
    return rows


def _annotation(about: LabelProvenance | None) -> dict[str, Any]:
    """Return who placed a point, how certain that was, and what was noted; without what nobody said."""
    known = {} if about is None else about.as_json()
    names = {"by": "observer", "certainty": "certainty", "note": "note", "checked_by": "checked_by"}
    return {name: known[key] for key, name in names.items() if key in known}


def suggested_rows(driver: WindowDriver) -> list[dict[str, Any]]:
    """Return a row for each feature that is only suggested: where, how sure, and by what."""
    return [
        {
            "side": side.value,
            "feature": code,
            "suggested": list(suggestion.position),
            "radius_95_mm": suggestion.radius_95,
            "source": suggestion.source,
        }
        for side in Side
        for code, suggestion in driver.workspace.document.landmarks(side).suggested.items()
    ]


def pose_rows(driver: WindowDriver) -> list[dict[str, Any]]:
    """Return a row for each estimated cochlea."""
    return [estimated.as_dict() for estimated in driver.poses.values()]


def _relative(file: Path, folder: Path) -> str:
    file, folder = file.absolute(), folder.absolute()
    return file.relative_to(folder).as_posix() if file.is_relative_to(folder) else str(file)
