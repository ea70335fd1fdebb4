"""The job that suggests the landmarks of a scan from labelled scans."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from platformdirs import user_cache_path

from gp_core.errors import GpError
from gp_core.validation import FloatArray
from gp_labeler.imaging.volume import Volume
from gp_labeler.jobs.loading import load_modules
from gp_labeler.jobs.runner import Progress

if TYPE_CHECKING:
    from gp_core.atlas.atlas import Atlas
    from gp_labeler.autolabel import Proposal
    from gp_labeler.head_pose import HeadPose

__all__ = ["FirstLabels", "SuggestFromScans", "templates_folder"]

_MODULES = (
    "scipy.ndimage",
    "scipy.spatial",
    "scipy.fft",
    "scipy.optimize",
    "SimpleITK",
    "skimage.filters",
    "gp_labeler.phantom",
)
_PROPOSED = 0.95


def templates_folder(directory: Path | None = None) -> Path:
    """Return where what is prepared of labelled scans is kept, by default in the user's cache."""
    return (directory or user_cache_path("gp-labeler", appauthor=False)) / "templates"


@dataclass(frozen=True, eq=False)
class FirstLabels:
    """What was found.

    Parameters
    ----------
    proposal : Proposal
        The suggestions.
    head : HeadPose, optional
        How the head lies by the symmetry of its bone, where that was asked for and found.
    """

    proposal: Proposal
    head: HeadPose | None = None


@dataclass(frozen=True, eq=False)
class SuggestFromScans:
    """Suggest the landmarks of a scan from labelled scans.

    The images are registered in a process of its own, so that the window stays alive and cancelling ends it.

    Parameters
    ----------
    volume : Volume
        The scan.
    labelled : tuple of Path
        Specimen files, landmark files beside their scans, and folders of them.
    folder : Path
        Where what is prepared of labelled scans is kept.
    placed : mapping of str to (3,) array
        Landmarks that are placed in the scan, LPS mm: three of them say how the head lies.
    most : int
        Labelled scans to suggest from.
    straighten : bool
        Whether to find how the head lies, too, so that suggestions can be looked at in straight views.
    threshold : float, optional
        Where its bone begins, for that.
    atlas : Atlas, optional
        What suggestions are compared with; by default the published one.
    """

    volume: Volume
    labelled: tuple[Path, ...]
    folder: Path
    placed: Mapping[str, FloatArray] = field(default_factory=dict)
    most: int = 5
    straighten: bool = False
    threshold: float | None = None
    atlas: Atlas | None = None

    @property
    def title(self) -> str:
        """What the user reads."""
        return "Suggesting from labelled scans"

    def run(self, progress: Progress) -> FirstLabels:
        """Read the labelled scans, prepare them where they are not yet, and guess.

        Raises
        ------
        GpError
            There is no labelled scan, or the head is not found.
        """
        for module in _MODULES:
            progress(0.0, "Starting")
            load_modules(module)
        from gp_labeler.autolabel import TemplateLibrary, propose
        from gp_labeler.autolabel.registration import engine_named
        from gp_labeler.autolabel.registration_process import ProcessRegistration
        from gp_labeler.document.labelled_scans import read_labelled_scans

        progress(0.0, "Reading the labelled scans")
        found = read_labelled_scans(self.labelled)
        library = TemplateLibrary(found.scans, self.folder, most=self.most)
        with ProcessRegistration(engine_named()) as registration:
            proposal = propose(
                self.volume,
                library,
                placed=self.placed,
                stored="as it is",
                registration=registration,
                atlas=self.atlas,
                progress=lambda fraction: progress(_PROPOSED * fraction, "Registering"),
                cancel=progress.cancelled,
            )
        return FirstLabels(proposal, self._head(progress) if self.straighten else None)

    def _head(self, progress: Progress) -> HeadPose | None:
        """Return how the head lies; None where its symmetry does not tell, for the views can stay then."""
        from gp_labeler.head_pose import straighten

        progress(_PROPOSED, "Straightening the head")
        try:
            return straighten(self.volume, threshold=self.threshold, cancel=progress.cancelled)
        except GpError:
            return None
