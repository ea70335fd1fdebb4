"""Meshes that a user draws with the bone; they are no part of the specimen."""

from __future__ import annotations

from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import Any, Protocol

from gp_core.errors import GpError
from gp_labeler.document.signals import Signal
from gp_labeler.document.specimen_document import SpecimenDocument
from gp_labeler.imaging.mesh_files import read_mesh
from gp_labeler.jobs.mesh import ReadMesh
from gp_labeler.jobs.runner import Jobs
from gp_labeler.models.messages import Messages
from gp_labeler.models.scan import ScanModel

__all__ = ["AddedMesh", "AddedMeshesModel"]


class _Scene(Protocol):
    """What draws them."""

    def add_mesh(self, dataset: Any, *, name: str, **options: Any) -> Any: ...
    def remove_mesh(self, name: str) -> bool: ...


@dataclass(frozen=True, eq=False)
class AddedMesh:
    """A dataset that is drawn with the bone.

    Parameters
    ----------
    name : str
        What it is taken away by.
    dataset : pyvista dataset
        Scan frame, mm.
    file : Path, optional
        Where it was read from.
    options : dict
        As for `pyvista.Plotter.add_mesh`.
    """

    name: str
    dataset: Any
    file: Path | None = None
    options: dict[str, Any] = field(default_factory=dict)


class AddedMeshesModel:
    """The meshes that are shown; another scan takes them away.

    Parameters
    ----------
    document : SpecimenDocument
        Another specimen takes them away.
    scan : ScanModel
        The scan they lie in; another one takes them away.
    jobs : Jobs
        Where files are read.
    messages : Messages
        What the user is told by.

    Attributes
    ----------
    scene : Scene3D or None
        What draws them.
    """

    changed = Signal()

    def __init__(self, document: SpecimenDocument, scan: ScanModel, jobs: Jobs, messages: Messages) -> None:
        self._jobs, self._messages = jobs, messages
        self._meshes: dict[str, AddedMesh] = {}
        self.scene: _Scene | None = None
        for signal in (document.reset, scan.opened):
            signal.connect(self._on_scan)

    @property
    def meshes(self) -> tuple[AddedMesh, ...]:
        """What is shown."""
        return tuple(self._meshes.values())

    def add(self, mesh: Any, *, name: str | None = None, **options: Any) -> str:
        """Show a dataset of pyvista, or a file; return its name.

        Parameters
        ----------
        mesh : pyvista dataset or path
            Scan frame, mm.
        name : str, optional
            What to take it away by, in place of one of that name; by default the file's, or ``mesh``.
        **options
            As for `pyvista.Plotter.add_mesh`.

        Raises
        ------
        GpError
            The file cannot be read, or pyvista cannot draw it like this. What was shown before stays.
        """
        file = Path(mesh) if isinstance(mesh, (str, PathLike)) else None
        dataset = mesh if file is None else read_mesh(file)
        return self._show(AddedMesh(name or self._free_name(file), dataset, file, options))

    def open(self, path: Path) -> None:
        """Read a file in the background, and show it."""
        self._jobs.submit(ReadMesh(path), lambda read: self._opened(path, read), key="added mesh")

    def remove(self, name: str) -> None:
        """Take one away.

        Raises
        ------
        GpError
            None has this name.
        """
        if name not in self._meshes:
            shown = ", ".join(self._meshes) or "none"
            raise GpError(f"no mesh is called {name!r}", remedy=f"SliceViewport: {shown}.")
        del self._meshes[name]
        if self.scene is not None:
            self.scene.remove_mesh(name)
        self.changed.emit()

    def clear(self) -> None:
        """Take all away."""
        for name in tuple(self._meshes):
            self.remove(name)

    def _opened(self, path: Path, dataset: Any) -> None:
        self._show(AddedMesh(self._free_name(path), dataset, path))

    def _show(self, mesh: AddedMesh) -> str:
        if self.scene is not None:
            self.scene.add_mesh(mesh.dataset, name=mesh.name, **mesh.options)
        self._meshes[mesh.name] = mesh
        self.changed.emit()
        self._messages.say(f"Mesh shown: {mesh.name}")
        return mesh.name

    def _free_name(self, file: Path | None) -> str:
        stem = "mesh" if file is None else file.stem
        names = (stem, *(f"{stem} {n}" for n in range(2, len(self._meshes) + 2)))
        return next(name for name in names if name not in self._meshes)

    def _on_scan(self, *_: object) -> None:
        self.clear()
