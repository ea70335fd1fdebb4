"""Jobs that load compiled code, so that estimates are quick."""

from __future__ import annotations

from dataclasses import dataclass

from gp_labeler.jobs.loading import load_modules
from gp_labeler.jobs.runner import Progress

__all__ = ["WarmFit", "WarmJoint"]


@dataclass(frozen=True)
class WarmFit:
    """Make the robust fit ready: its compiled kernels are loaded, the first time on a machine compiled."""

    title = "Preparing estimates"

    def run(self, progress: Progress) -> None:
        """Import them; estimates go on meanwhile, a little slower."""
        progress(0.0)
        load_modules("gp_core.registration.student_t_fit_compiled")


@dataclass(frozen=True)
class WarmJoint:
    """Make JRMPC ready: the first one on a machine is compiled, which takes seconds."""

    title = "Preparing the method JRMPC"

    def run(self, progress: Progress) -> None:
        """Register three points with themselves."""
        progress(0.0)
        load_modules("gp_core.registration.jrmpc_kernels", "gp_core.pose.jrmpc_estimator")
        from gp_core.registration.jrmpc import ESTIMATION, jrmpc

        points = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 2.0, 0.0]]
        jrmpc([points, points], max_iterations=ESTIMATION.max_iterations, gamma=ESTIMATION.gamma)
