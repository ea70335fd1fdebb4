"""Jobs that make and write meshes of bone."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

from gp_core.errors import GpError
from gp_core.landmarks.features import Side
from gp_core.validation import FloatArray
from gp_labeler.imaging.mesh_files import read_mesh
from gp_labeler.imaging.preview_mesh import coarse_surface
from gp_labeler.imaging.progress import Progress as Told
from gp_labeler.imaging.seam import shaded_like
from gp_labeler.imaging.surface import SMALLEST_PART_MM, Surface, extract_isosurface, overview_stride
from gp_labeler.imaging.volume import Volume
from gp_labeler.jobs.loading import load_modules
from gp_labeler.jobs.runner import Progress

__all__ = ["EarMesh", "MeshEars", "MeshFirst", "MeshOverview", "Meshes", "ReadMesh", "SaveMesh"]

FIRST_LOOK_VOXELS = 96**3
"""A mesh of so many voxels is there in a moment, and turns smoothly without a graphics card."""


QUICK_TRIANGLES = 45_000


@dataclass(frozen=True, eq=False)
class EarMesh:
    """The surface of a box around an ear, and where the box is, (2, 3) mm."""

    box: FloatArray
    surface: Surface


@dataclass(frozen=True)
class Meshes:
    """The bone as it is drawn: parts that do not overlap, and a preview mesh while the camera moves.

    `ears` are those of the parts that are at full resolution.
    """

    parts: tuple[Surface, ...] = ()
    quick: tuple[Surface, ...] = ()
    ears: Mapping[Side, EarMesh] = field(default_factory=dict)


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
        parts = tuple(part.prepare() for part in _mesh_if_any(self, progress, stride=stride))
        return Meshes(parts, _previews(parts))


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
        """Mesh all of it, and a preview mesh of few triangles."""
        stride = overview_stride(self.volume)
        whole = _mesh(self, progress, end=0.8, stride=stride).prepare()
        progress(0.9)
        return Meshes((whole,), _previews((whole,)))


@dataclass(frozen=True, eq=False)
class MeshEars:
    """Mesh boxes around the ears at full resolution, and cut them out of the overview.

    `kept` are ears that are meshed already, and stay as they are.
    """

    volume: Volume
    threshold: float
    overview: Meshes
    boxes: Mapping[Side, FloatArray]
    smallest_mm: float
    kept: Mapping[Side, EarMesh] = field(default_factory=dict)

    @property
    def title(self) -> str:
        """What the user reads."""
        ears = " and ".join(side.word for side in self.boxes)
        return f"{ears.capitalize()} ear{'s' if len(self.boxes) > 1 else ''} at full resolution"

    def run(self, progress: Progress) -> Meshes:
        """Mesh the boxes."""
        ears, rest = dict(self.kept), list(self.overview.parts)
        for n, (side, box) in enumerate(self.boxes.items()):
            start, end = 0.9 * n / len(self.boxes), 0.9 * (n + 1) / len(self.boxes)
            ear = _mesh(self, progress, start=start, end=end, box=box)
            ears[side] = EarMesh(box, shaded_like(ear, self.overview.parts))
        for made in ears.values():
            rest = [part.outside(made.surface.region) for part in rest]
        fine = [made.surface for made in ears.values()]
        parts = tuple(part.prepare() for part in (*rest, *fine) if part.n_triangles)
        progress(0.95)
        detailed = tuple(made.box for made in ears.values())
        return Meshes(parts, (coarse_surface(parts, QUICK_TRIANGLES, detailed=detailed),), ears)


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


def _previews(parts: tuple[Surface, ...]) -> tuple[Surface, ...]:
    """Return a coarse mesh to draw while the camera moves; none where the mesh itself is small."""
    if sum(part.n_triangles for part in parts) <= QUICK_TRIANGLES:
        return ()
    return (coarse_surface(parts, QUICK_TRIANGLES),)


@dataclass(frozen=True)
class ReadMesh:
    """Read a mesh."""

    path: Path

    @property
    def title(self) -> str:
        """What the user reads."""
        return f"Reading {self.path.name}"

    def run(self, progress: Progress) -> Any:
        """Read."""
        progress(0.0)
        return read_mesh(self.path)
