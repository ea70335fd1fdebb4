"""Steps that take landmarks from files, and write them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

from gp_core.errors import GpError
from gp_core.landmarks.features import Side
from gp_labeler.document.landmark_export import export_landmarks
from gp_labeler.document.landmark_import import import_landmarks
from gp_labeler.document.specimen_edits import RenameSpecimen, SetNotes
from gp_labeler.document.specimen_file import SUFFIX
from gp_labeler.scripting.step import Options, Step, Texts
from gp_labeler.scripting.window_driver import WindowDriver

__all__ = ["AddMesh", "Details", "Export", "Import", "Reference", "RemoveMesh", "Save"]


@dataclass(frozen=True)
class Import(Step):
    """Take over the landmarks of files.

    Parameters
    ----------
    files : text or texts
        Landmark files.
    side : L or R, optional
        Where the files do not say it.
    names : table, optional
        The feature's code by the lab's own name of a point, such as ``{"Apex" = "CA"}``; an empty code leaves
        the point out.
    accept_misfit : bool
        Take them even where they cannot belong to this scan.
    keep : bool
        Leave what is placed already, and fill only what is to do.
    """

    do: ClassVar[str] = "import"
    files: tuple[str, ...]
    side: Side | None = None
    names: Texts = field(default_factory=dict)
    accept_misfit: bool = False
    keep: bool = False

    def run(self, driver: WindowDriver) -> None:  # noqa: D102
        _ = driver.voxel  # a scan must be there
        notes = import_landmarks(
            driver.workspace.document,
            [driver.to_read(file) for file in self.files],
            side=self.side,
            names=self.names,
            near_bone=driver.workspace.scan.near_bone,
            accept_off_bone=self.accept_misfit,
            replace_placed=not self.keep,
        )
        for note in notes:
            driver.workspace.say(note, "warning")
        driver.wait_until_idle(in_passing=False)


@dataclass(frozen=True)
class Reference(Step):
    """Show the points of landmark files as grey reference points, in place of those shown before.

    Parameters
    ----------
    files : text or texts
        Landmark files, under any names; none clears them.
    """

    do: ClassVar[str] = "reference"
    files: tuple[str, ...] = ()

    def run(self, driver: WindowDriver) -> None:  # noqa: D102
        if self.files:
            _ = driver.voxel  # a scan must be there
            driver.workspace.references.show(*[driver.to_read(file) for file in self.files])
        else:
            driver.workspace.references.clear()
        driver.wait_until_idle(in_passing=False)


@dataclass(frozen=True)
class AddMesh(Step):
    """Draw a mesh with the bone.

    Parameters
    ----------
    file : text
        PLY, STL, VTP, OBJ or glTF; LPS, mm.
    name : text, optional
        What to remove it by; by default the file's name without its suffix.
    options : table, optional
        As for ``pyvista.Plotter.add_mesh``, such as ``{color = "red", opacity = 0.5}``.
    """

    do: ClassVar[str] = "add_mesh"
    file: str
    name: str | None = None
    options: Options = field(default_factory=dict)

    def run(self, driver: WindowDriver) -> str:  # noqa: D102
        _ = driver.voxel  # a scan must be there
        name = driver.workspace.meshes.add(driver.to_read(self.file), name=self.name, **self.options)
        driver.wait_until_idle(in_passing=False)
        return name


@dataclass(frozen=True)
class RemoveMesh(Step):
    """Take away a mesh that was added, or all.

    Parameters
    ----------
    name : text, optional
        Of which one; by default all.
    """

    do: ClassVar[str] = "remove_mesh"
    name: str | None = None

    def run(self, driver: WindowDriver) -> None:  # noqa: D102
        if self.name is None:
            driver.workspace.meshes.clear()
        else:
            driver.workspace.meshes.remove(self.name)
        driver.wait_until_idle(in_passing=False)


@dataclass(frozen=True)
class Export(Step):
    """Write the landmarks of both sides, ``<specimen>_L`` and ``<specimen>_R``.

    Parameters
    ----------
    folder : str
        Where to.
    formats : text or texts
        Of ``.mrk.json``, ``.fcsv`` and ``.csv``.
    complete : bool
        Fail where a side lacks a feature, or has one only suggested.
    suggested : bool
        Write also what is only suggested, into ``<specimen>_L_suggested.mrk.json`` and ``_R_``.
    """

    do: ClassVar[str] = "export"
    folder: str = "."
    formats: tuple[str, ...] = (".mrk.json",)
    complete: bool = False
    suggested: bool = False

    def run(self, driver: WindowDriver) -> str:  # noqa: D102
        state, folder = driver.workspace.document.measured_state, driver.to_write(self.folder)
        report = export_landmarks(
            state, folder, formats=self.formats, overwrite=True, suggested=self.suggested
        )
        driver.wrote(*report.files)
        if self.complete and not report.is_complete:
            raise GpError(report.text.replace("\n", " "))
        return report.text.replace("\n", " ")


@dataclass(frozen=True)
class Save(Step):
    """Save the specimen file.

    Parameters
    ----------
    path : str, optional
        By default ``<specimen>.gpspecimen.json``.
    """

    do: ClassVar[str] = "save"
    path: str | None = None

    def run(self, driver: WindowDriver) -> str:  # noqa: D102
        document = driver.workspace.document
        file = driver.to_write(self.path or f"{document.state.specimen}{SUFFIX}")
        return driver.wrote(document.save(file, overwrite=True))


@dataclass(frozen=True)
class Details(Step):
    """Name the specimen, and write notes on it.

    Parameters
    ----------
    name : str, optional
        What files are called by.
    notes : str, optional
        In place of those before.
    more : bool
        Whether the notes continue those of the step before: both are one undo.
    """

    do: ClassVar[str] = "specimen"
    name: str | None = None
    notes: str | None = None
    more: bool = False

    def run(self, driver: WindowDriver) -> None:  # noqa: D102
        if self.name is None and self.notes is None:
            raise GpError("specimen needs name or notes")
        if self.name is not None:
            driver.workspace.document.do(RenameSpecimen(self.name))
        if self.notes is not None:
            driver.workspace.document.do(SetNotes(self.notes), merge=self.more)
