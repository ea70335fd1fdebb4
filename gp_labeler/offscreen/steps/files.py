"""Steps that take landmarks from files, and write them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from gp_core.errors import GpError
from gp_labeler.offscreen.rig import Rig
from gp_labeler.offscreen.step import Step
from gp_labeler.session.landmark_export import export_landmarks
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

    def run(self, rig: Rig) -> str:  # noqa: D102
        _ = rig.voxel
        answers = ("Import nevertheless",) if self.accept_misfit else ()
        rig.prompts.prepare([rig.to_read(file) for file in self.files], answers)
        since, before = len(rig.messages), rig.desk.session.state
        rig.window.commands.run("file.import")
        rig.settle(in_passing=False)
        texts = " ".join(text for text, _ in rig.messages[since:])
        if (
            rig.desk.session.state is before
            and not rig.prompts.unanswered
            and not texts.startswith("Imported")
        ):
            raise GpError(texts or "nothing was imported")
        return texts


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
