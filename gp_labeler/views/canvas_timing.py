"""How fast the 3D view is on either canvas, measured in helper processes: each has one canvas to its end."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from dataclasses import dataclass

from gp_core.errors import GpError
from gp_labeler.jobs.runner import Progress
from gp_labeler.views.canvas_choice import VARIABLE, CanvasTiming

__all__ = ["MeasureCanvases"]

_PATIENCE_S = 120


@dataclass(frozen=True)
class MeasureCanvases:
    """Measure both canvases, one after the other.

    Parameters
    ----------
    renderer : str
        Of OpenGL, to which the figures belong.
    """

    renderer: str
    title = "Measuring the 3D canvases"

    def run(self, progress: Progress) -> CanvasTiming:
        """Run both helper processes."""
        progress(0.0)
        painted = _measured("painted")
        progress(0.5)
        return CanvasTiming(self.renderer, painted, _measured("native"))


def _measured(kind: str) -> float:
    environment = {**os.environ, VARIABLE: kind}
    command = [sys.executable, "-m", "gp_labeler.views.canvas_trial"]
    try:
        done = subprocess.run(
            command, env=environment, capture_output=True, text=True, timeout=_PATIENCE_S, check=True
        )
        return float(json.loads(done.stdout.splitlines()[-1])["frame_ms"])
    except (OSError, subprocess.SubprocessError, ValueError, KeyError, IndexError) as error:
        raise GpError(
            f"the {kind} canvas cannot be measured ({type(error).__name__})",
            remedy="The painted canvas works everywhere; View > 3D canvas chooses one by hand.",
        ) from error
