"""Steps that take landmarks from files, and write them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import ClassVar

from gp_core.errors import GpError
from gp_labeler.imaging.near_bone import near_bone
from gp_labeler.offscreen.rig import Rig
from gp_labeler.offscreen.step import Step
from gp_labeler.session.landmark_export import export_landmarks
from gp_labeler.session.landmark_import import import_landmarks
from gp_labeler.session.specimen_file import SUFFIX

__all__ = ["Export", "Import", "Save"]


@dataclass(frozen=True)
class Import(Step):
    """Take over the landmarks of files.

    Parameters
    ----------
    files : text or texts
        Landmark files.
    accept_misfit : bool
        Take them even where they cannot belong to this scan.
    """

    do: ClassVar[str] = "import"
    files: tuple[str, ...]
    accept_misfit: bool = False

    def run(self, rig: Rig) -> None:  # noqa: D102
        volume, threshold = rig.desk.volume, rig.desk.threshold
        if volume is None:
            raise GpError("no scan is open", remedy="Let a step open one first.")
        notes = import_landmarks(
            rig.desk.session,
            [rig.to_read(file) for file in self.files],
            near_bone=None if threshold is None else partial(near_bone, volume, threshold),
            accept_misfit=self.accept_misfit,
        )
        for note in notes:
            rig.desk.say(note, "warning")
        rig.settle(in_passing=False)


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
        Fail where a side lacks a feature.
    """

    do: ClassVar[str] = "export"
    folder: str = "."
    formats: tuple[str, ...] = (".mrk.json",)
    complete: bool = False

    def run(self, rig: Rig) -> str:  # noqa: D102
        state, folder = rig.desk.session.state, rig.to_write(self.folder)
        report = export_landmarks(state, folder, formats=self.formats, overwrite=True)
        rig.wrote(*report.files)
        if self.complete and not report.is_complete:
            raise GpError(report.text)
        return report.text


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

    def run(self, rig: Rig) -> str:  # noqa: D102
        session = rig.desk.session
        file = rig.to_write(self.path or f"{session.state.specimen}{SUFFIX}")
        return rig.wrote(session.save(file, overwrite=True))
