"""Steps that ask the atlas: fit one to labelled animals, check the labels."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import ClassVar

from gp_core import Atlas, Specimen, check_specimen, fit_atlas, load_specimens
from gp_core.disk import write_text
from gp_core.errors import GpError
from gp_core.landmarks.features import Side
from gp_labeler.offscreen.rig import Rig
from gp_labeler.offscreen.step import Step

__all__ = ["Check", "Fit", "UseAtlas"]


@dataclass(frozen=True)
class Fit(Step):
    """Fit an atlas to labelled animals.

    Parameters
    ----------
    specimens : text or texts
        Landmark files, or folders of them.
    path : str
        The atlas file.
    """

    do: ClassVar[str] = "fit"
    specimens: tuple[str, ...]
    path: str = "atlas.json"

    def run(self, rig: Rig) -> str:  # noqa: D102
        specimens = load_specimens([rig.to_read(each) for each in self.specimens])
        atlas, file = fit_atlas(specimens), rig.to_write(self.path)
        atlas.save(file)
        return f"{rig.wrote(file)}, {len(specimens)} animals"


@dataclass(frozen=True)
class UseAtlas(Step):
    """Take another atlas: for where features are expected, for doubts and for poses.

    Parameters
    ----------
    path : str, optional
        An atlas file, or ``published``.
    specimens : text or texts
        Instead: labelled animals, files or folders of them, to fit one to.
    """

    do: ClassVar[str] = "atlas"
    path: str | None = None
    specimens: tuple[str, ...] = ()

    def run(self, rig: Rig) -> str:  # noqa: D102
        desk = rig.desk
        if (self.path is None) == (not self.specimens):
            raise GpError("atlas needs path or specimens, one of them")
        if self.specimens:
            desk.fit_atlas([rig.to_read(each) for each in self.specimens])
        elif self.path == "published":
            desk.use_published_atlas()
        else:
            desk.open_atlas(rig.to_read(self.path or ""))
        rig.settle()
        return f"{len(desk.atlas_specimens)} animals" if desk.atlas_specimens else self.path or ""


@dataclass(frozen=True)
class Check(Step):
    """Report labels that are missing, doubtful or exchanged.

    Parameters
    ----------
    path : str, optional
        Where to write what was found, JSON.
    strict : bool
        Fail where a label is doubtful.
    """

    do: ClassVar[str] = "check"
    path: str | None = None
    strict: bool = False

    def run(self, rig: Rig) -> str:  # noqa: D102
        state = rig.desk.session.state
        sides = {side: state.side(side) for side in Side if state.side(side).placed}
        findings = check_specimen(Specimen(state.specimen, sides), rig.desk.atlas or Atlas.published())
        doubtful = [finding for finding in findings if finding.is_doubt]
        if self.path is not None:
            file, rows = rig.to_write(self.path), [finding.as_dict() for finding in findings]
            write_text(file, json.dumps(rows, indent=1) + "\n")
            rig.wrote(file)
        text = " ".join(f"{finding.side.word}: {finding.text}." for finding in doubtful)
        if doubtful and self.strict:
            raise GpError(text)
        return text or f"{len(findings)} not placed, none doubtful"
