"""Findings of the label check of a specimen, kept so that they can be shown at once between two checks."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from gp_core.atlas.label_check import Finding, SideCheck, deviation, far_finding
from gp_core.landmarks.features import FEATURES, Side
from gp_core.landmarks.scan_evidence import ScanEvidence
from gp_core.landmarks.sets import LandmarkSet
from gp_labeler.models.ghosts import fingerprint

__all__ = ["Check", "CheckLabels", "LabelChecks", "Measure"]

Check = Callable[..., SideCheck]
"""Checks the labels of one side: `gp_core.atlas.label_check.check_side` with an atlas."""

Measure = Callable[[LandmarkSet], ScanEvidence]
"""Tells what the scan says of the labels of one side: `imaging.bone_distance.scan_evidence` with a scan."""

N_REMEMBERED = 8


class LabelChecks:
    """The checks of the sets that were asked about last; may be asked from any thread.

    Parameters
    ----------
    check : callable, optional
        The checker; None finds no problem.
    measure : callable, optional
        Asks the scan; None where there is none.
    """

    def __init__(self, check: Check | None = None, measure: Measure | None = None) -> None:
        self.check, self.measure = check, measure
        self._known: dict[tuple[object, ...], SideCheck] = {}
        self._latest: dict[Side, tuple[LandmarkSet, SideCheck]] = {}
        self._lock = threading.Lock()

    def found(self, landmarks: LandmarkSet) -> SideCheck:
        """Check a side, where that was not done before; this may take some 50 ms."""
        found = self.known(landmarks)
        if found is None:
            found = self._asked(landmarks)
            with self._lock:
                self._known[fingerprint(landmarks)] = found
                while len(self._known) > N_REMEMBERED:
                    del self._known[next(iter(self._known))]
        return found

    def _asked(self, landmarks: LandmarkSet) -> SideCheck:
        if self.check is None:
            return SideCheck()
        if self.measure is None:
            return self.check(landmarks)
        return self.check(landmarks, scan=self.measure(landmarks))

    def known(self, landmarks: LandmarkSet) -> SideCheck | None:
        """Return what was found before, else None; at once. It is then forgotten last."""
        key = fingerprint(landmarks)
        with self._lock:
            found = self._known.pop(key, None)
            if found is not None:
                self._known[key] = found
        return found

    def known_problems(self, landmarks: LandmarkSet) -> Mapping[str, Finding]:
        """Return the problems where they are known, else as the last edit leaves those before it; at once.

        Problems of other points wait for the next check, so that they do not blink at every edit; a
        point that was moved is compared with the place where the others expect it, which stays.
        """
        known = self.known(landmarks)
        return self._carried(landmarks) if known is None else known.problems

    def remember(self, landmarks: LandmarkSet, found: SideCheck) -> None:
        """Take the check of a side from which the problems after the next edit follow."""
        with self._lock:
            self._latest[landmarks.side] = landmarks, found

    def _carried(self, landmarks: LandmarkSet) -> dict[str, Finding]:
        with self._lock:
            before, found = self._latest.get(landmarks.side, (landmarks, SideCheck()))
        old, new = before.points, landmarks.points
        stays = ((old == new) | (np.isnan(old) & np.isnan(new))).all(axis=1).tolist()
        moved = {f.code for f, stayed in zip(FEATURES, stays, strict=True) if not (stayed or f.computed)}
        if len(moved) > 1:
            return {}
        carried = {code: problem for code, problem in found.problems.items() if code in landmarks}
        for code in moved & set(carried):
            problem = _moved(carried.pop(code), code, landmarks)
            if problem is not None:
                carried[code] = problem
        return carried


def _moved(problem: Finding, code: str, landmarks: LandmarkSet) -> Finding | None:
    """Return the problem of a point after it was moved; None where only the next check can say."""
    was = problem.deviation_of(code)
    if problem.kind == "other side":
        return problem
    if was is None:
        return None
    away = deviation(code, landmarks[code], was.expected, was.covariance, was.labelling_sd)
    return far_finding(landmarks.side, away) if away.is_outlier else None


@dataclass(frozen=True)
class CheckLabels:
    """A job (see `jobs`) that checks one side, so that its problems are known afterwards."""

    checks: LabelChecks
    landmarks: LandmarkSet
    title: str = "Checking labels"

    def run(self, progress: Callable[[float], None]) -> SideCheck:
        """Check."""
        progress(0.0)
        found = self.checks.found(self.landmarks)
        self.checks.remember(self.landmarks, found)
        return found

    @property
    def known(self) -> SideCheck | None:
        """What it would find, where that was found before, else None; at once."""
        return self.checks.known(self.landmarks)
