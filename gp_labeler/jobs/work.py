"""Long work behind the window, as frozen jobs: looking into scans, reading, meshing, making the phantom."""

from __future__ import annotations

import importlib
import re
import threading
from collections.abc import Mapping
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import Any, Protocol

from gp_core.atlas.atlas import Atlas
from gp_core.errors import GpError
from gp_core.landmarks.features import Side
from gp_core.validation import FloatArray
from gp_labeler.imaging.progress import Progress as Told
from gp_labeler.imaging.readers import ImportPlan, inspect_volume, read_volume
from gp_labeler.imaging.stand_in import coarse_surface
from gp_labeler.imaging.surface import SMALLEST_PART_MM, Surface, extract_isosurface, overview_stride
from gp_labeler.imaging.threshold import propose_threshold
from gp_labeler.imaging.volume import Volume
from gp_labeler.jobs.runner import Progress

__all__ = [
    "Demo",
    "InspectScan",
    "LoadAtlas",
    "MakeDemo",
    "MeshEars",
    "MeshFirst",
    "MeshOverview",
    "Meshes",
    "ProposeThreshold",
    "ReadScan",
    "SaveMesh",
    "WarmFit",
    "WarmJoint",
    "load_modules",
    "phantom_seed",
]

FIRST_LOOK_VOXELS = 96**3
"""A mesh of so many voxels is there in a moment, and turns smoothly without a graphics card."""

QUICK_TRIANGLES = 45_000

_LOADING = threading.Lock()


def load_modules(*modules: str) -> None:
    """Import what takes long, one thread at a time: two that import SciPy at once may find it half made."""
    with _LOADING:
        for module in modules:
            importlib.import_module(module)


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
class Meshes:
    """The bone as it is drawn: parts that do not overlap, and a coarse stand-in while the camera moves."""

    parts: tuple[Surface, ...] = ()
    quick: tuple[Surface, ...] = ()


@dataclass(frozen=True)
class MeshFirst:
    """Mesh a scan so coarsely that there is something to see at once."""

    volume: Volume
    threshold: float
    smallest_mm: float = SMALLEST_PART_MM

    @property
    def title(self) -> str:
        """What the user reads."""
        return "First look"

    def run(self, progress: Progress) -> Meshes:
        """Mesh few voxels; nothing, where so coarse a look shows no bone."""
        stride = overview_stride(self.volume, FIRST_LOOK_VOXELS)
        return Meshes(_mesh_if_any(self, progress, stride=stride))


@dataclass(frozen=True)
class MeshOverview:
    """Mesh a whole scan as finely as can be turned by hand."""

    volume: Volume
    threshold: float
    smallest_mm: float = SMALLEST_PART_MM

    @property
    def title(self) -> str:
        """What the user reads."""
        return "Making the bone surface"

    def run(self, progress: Progress) -> Meshes:
        """Mesh all of it, and a stand-in of few triangles."""
        stride = overview_stride(self.volume)
        whole = _mesh(self, progress, end=0.8, stride=stride)
        if whole.n_triangles <= QUICK_TRIANGLES:
            return Meshes((whole,))
        progress(0.9)
        return Meshes((whole,), (coarse_surface(whole, QUICK_TRIANGLES),))


@dataclass(frozen=True, eq=False)
class MeshEars:
    """Mesh boxes around the ears at full resolution, and cut them out of the overview."""

    volume: Volume
    threshold: float
    overview: Meshes
    boxes: Mapping[Side, FloatArray]
    smallest_mm: float

    @property
    def title(self) -> str:
        """What the user reads."""
        ears = " and ".join(side.word for side in self.boxes)
        return f"{ears.capitalize()} ear{'s' if len(self.boxes) > 1 else ''} at full resolution"

    def run(self, progress: Progress) -> Meshes:
        """Mesh the boxes."""
        rest, ears = list(self.overview.parts), []
        for n, box in enumerate(self.boxes.values()):
            start, end = n / len(self.boxes), (n + 1) / len(self.boxes)
            ear = _mesh(self, progress, start=start, end=end, box=box)
            rest = [part.outside(ear.region) for part in rest]
            ears.append(ear)
        parts = tuple(part.prepare() for part in (*rest, *ears) if part.n_triangles)
        return Meshes(parts, self.overview.quick)


@dataclass(frozen=True)
class LoadAtlas:
    """Make the published atlas ready to say where features should be."""

    title = "Loading the atlas"

    def run(self, progress: Progress) -> Atlas:
        """Build it from the published table."""
        load_modules("gp_core.atlas.prediction", "gp_core.atlas.published")
        progress(0.0)
        return Atlas.published()


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


@dataclass(frozen=True)
class Demo:
    """A synthetic scan, and where its features really are."""

    volume: Volume
    specimen: Any


def phantom_seed(name: str) -> int | None:
    """Return the seed of a phantom by the name of its scan, which is in no file: it can be made anew."""
    found = re.fullmatch(r"phantom-(\d+)", name)
    return int(found[1]) if found else None


@dataclass(frozen=True)
class MakeDemo:
    """Make the phantom: a synthetic head of a guinea pig that never lived."""

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


@dataclass(frozen=True, eq=False)
class SaveMesh:
    """Write the whole bone surface at full resolution."""

    volume: Volume
    threshold: float
    path: Path
    smallest_mm: float = SMALLEST_PART_MM

    @property
    def title(self) -> str:
        """What the user reads."""
        return f"Writing {self.path.name}"

    def run(self, progress: Progress) -> Path:
        """Mesh and write."""
        _mesh(self, progress, end=0.9).save(self.path)
        return self.path


class _Meshing(Protocol):
    """A job that meshes."""

    @property
    def volume(self) -> Volume: ...
    @property
    def threshold(self) -> float: ...
    @property
    def smallest_mm(self) -> float: ...


def _mesh(job: _Meshing, progress: Progress, *, start: float = 0.0, end: float = 1.0, **how: Any) -> Surface:
    """Mesh as one part, from `start` to `end`, of a job."""
    load_modules("gp_labeler.imaging.islands")
    told: Told = lambda fraction: progress(start + (end - start) * fraction)  # noqa: E731
    how["smallest_mm"] = job.smallest_mm
    return extract_isosurface(job.volume, job.threshold, progress=told, cancel=progress.cancelled, **how)


def _mesh_if_any(job: _Meshing, progress: Progress, **how: Any) -> tuple[Surface, ...]:
    """Mesh coarsely; where bone is too thin to be seen like that there is none."""
    try:
        return (_mesh(job, progress, **how),)
    except GpError:
        return ()
