"""Jobs on scans: looking into files, reading, proposing a threshold, making the phantom."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import Any

from gp_labeler.imaging.mapped_file import can_map
from gp_labeler.imaging.progress import Progress as Told
from gp_labeler.imaging.progress import Report
from gp_labeler.imaging.readers import ImportPlan, inspect_volume, read_volume
from gp_labeler.imaging.threshold import propose_threshold
from gp_labeler.imaging.volume import Volume
from gp_labeler.jobs.loading import load_modules
from gp_labeler.jobs.runner import Progress

__all__ = [
    "CheckScan",
    "Demo",
    "InspectScan",
    "MakeDemo",
    "ProposeThreshold",
    "ReadScan",
    "ReadSlice",
    "phantom_seed",
]


@dataclass(frozen=True)
class InspectScan:
    """Look into a file or folder; gives an `ImportPlan`."""

    path: str | PathLike[str]
    options: Mapping[str, Any] = field(default_factory=dict)

    @property
    def title(self) -> str:
        """What the user reads."""
        return f"Looking into {Path(self.path).name}"

    def run(self, progress: Progress) -> ImportPlan:
        """Read headers and names."""
        load_modules("gp_labeler.imaging.readers.probe")
        can_map()  # the first answer loads a compiler: here, and not while the window takes the plan
        return inspect_volume(self.path, progress=progress, cancel=progress.cancelled, **self.options)


@dataclass(frozen=True)
class ReadScan:
    """Load a scan."""

    plan: ImportPlan

    @property
    def title(self) -> str:
        """What the user reads."""
        return f"Reading {self.plan.name}"

    def run(self, progress: Progress) -> Volume:
        """Read the voxels, and find the window that suits them."""
        volume = read_volume(self.plan, progress=progress, cancel=progress.cancelled)
        _ = volume.intensity_range  # remembered by the volume: found here, it costs the window nothing
        return volume


@dataclass(frozen=True)
class CheckScan:
    """Find the checksum of a scan that stays in its file, and see that nothing happens to it meanwhile."""

    volume: Volume

    @property
    def title(self) -> str:
        """What the user reads."""
        return f"Checking all voxels of {self.volume.name}"

    def run(self, progress: Progress) -> str:
        """Read all of it once."""
        return self.volume.find_checksum(Report(progress, progress.cancelled))


@dataclass(frozen=True)
class ReadSlice:
    """Read what slices of one x need of a scan that stays in its file, all over which they lie."""

    volume: Volume
    x: int

    @property
    def title(self) -> str:
        """What the user reads."""
        return f"Reading a slice of {self.volume.name}"

    def run(self, progress: Progress) -> None:
        """Read it."""
        self.volume.voxels.read_ahead(self.x, Report(progress, progress.cancelled))
        self.volume.check()


@dataclass(frozen=True)
class ProposeThreshold:
    """Propose the grey value at which bone begins."""

    volume: Volume

    @property
    def title(self) -> str:
        """What the user reads."""
        return "Looking for bone"

    def run(self, progress: Progress) -> float:
        """Look at the histogram."""
        progress(0.0)
        load_modules("skimage.filters")
        return propose_threshold(self.volume)


@dataclass(frozen=True)
class Demo:
    """A synthetic scan, and where its features really are."""

    volume: Volume
    specimen: Any


def phantom_seed(name: str) -> int | None:
    """Return the seed of a phantom by the name of its scan, which is in no file: it can be made again."""
    found = re.fullmatch(r"phantom-(\d+)", name)
    return int(found[1]) if found else None


@dataclass(frozen=True)
class MakeDemo:
    """Make the phantom: the synthetic head of a simulated guinea pig."""

    seed: int = 0
    spacing: float = 0.2

    @property
    def title(self) -> str:
        """What the user reads."""
        return "Making the phantom head"

    def run(self, progress: Progress) -> Demo:
        """Draw the animal and scan it."""
        load_modules("scipy.ndimage", "scipy.interpolate", "gp_labeler.phantom")
        from gp_labeler.phantom import make_phantom

        told: Told = lambda fraction: progress(0.98 * fraction)  # noqa: E731
        phantom = make_phantom(self.seed, spacing=self.spacing, progress=told, cancel=progress.cancelled)
        _ = phantom.volume.intensity_range, phantom.volume.checksum
        return Demo(phantom.volume, phantom.specimen)
