"""What the import dialog says of a plan, and the job that makes its preview."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from gp_labeler.imaging.preview import PreviewPlane, preview_planes
from gp_labeler.imaging.readers import MAPPED_FROM, ImportPlan, Problem, read_preview
from gp_labeler.imaging.readers.options import Spacing
from gp_labeler.jobs.runner import Progress
from gp_labeler.views.formatting import TIMES, bytes_text, size_text, spacing_text

__all__ = ["PreviewScan", "bare", "facts_of", "remedy", "why_not"]

_AXES = ("columns", "rows", "slices")
"""What the voxel axes i, j and k count."""

_OPTION = re.compile(r" \(--[^)]*\)")


@dataclass(frozen=True)
class PreviewScan:
    """Read a coarse picture of a scan, as a job."""

    plan: ImportPlan
    title: str = "Reading a preview"

    def run(self, progress: Progress) -> tuple[PreviewPlane, PreviewPlane]:
        """Return its middle slices."""
        progress(0.0)
        return preview_planes(read_preview(self.plan, cancel=progress.cancelled))


def bare(plan: ImportPlan) -> ImportPlan:
    """Return the plan without answers to what it found."""
    return plan.with_options(spacing=None, accept=())


def facts_of(plan: ImportPlan) -> dict[str, str]:
    """Return what there is to know about a scan before it is loaded, as names and words."""
    spacing: Spacing | None = plan.spacing
    size = (
        TIMES.join(f"{n * s:.1f}" for n, s in zip(plan.size, spacing, strict=True)) + " mm" if spacing else ""
    )
    files = f", {len(plan.files)} files" if len(plan.files) > 1 else ""
    return {
        "Format": f"{plan.format}{files}",
        "Voxels": f"{size_text(plan.size)}, {plan.stored_dtype}"
        + (f", {spacing_text(spacing)} each" if spacing else ", of unknown size"),
        "Size": size or "unknown until the voxel size is given",
        "Memory": _memory(plan),
        **({"Left": _left(plan)} if plan.sides_known else {}),
        "Where": str(plan.path),
    }


def _left(plan: ImportPlan) -> str:
    """Say where left is according to the file."""
    to_left = plan.T_scan_voxel()[0, :3]
    axis = int(np.abs(to_left).argmax())
    order = "later" if to_left[axis] > 0 else "earlier"
    return f"towards {order} {_AXES[axis]}, as the file says; nothing in the scan can prove it"


def _memory(plan: ImportPlan) -> str:
    taken = bytes_text(plan.n_bytes)
    if plan.is_unpacked_to_disk:
        return f"unpacked on disk, {taken}"
    return f"stays in its file, {taken}" if plan.stays_in_file and plan.n_bytes >= MAPPED_FROM else taken


def remedy(problem: Problem) -> str:
    """Return what to do in this window; the remedies of `Problem` are for the command as well."""
    if "spacing" in problem.resolved_by:
        return (
            "Type the true voxel size below. Look in the scanner's log, or ask the person who made the scan."
        )
    return _OPTION.sub("", problem.remedy)


def why_not(errors: tuple[Problem, ...]) -> str:
    """Return why it cannot be loaded yet, in a few words."""
    if any(problem.code == "extent" for problem in errors):
        return "Correct the voxel size, or accept it."
    if any("spacing" in problem.resolved_by for problem in errors):
        return "The voxel size is needed first."
    if any("series" in problem.resolved_by for problem in errors):
        return "Choose a scan first."
    if any("accept" in problem.resolved_by for problem in errors):
        return "Review the problems, and accept them to continue."
    return "It cannot be loaded." if errors else ""
