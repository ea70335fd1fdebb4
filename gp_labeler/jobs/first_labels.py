"""The job that suggests the landmarks of a scan from labelled scans."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from gp_core.validation import FloatArray
from gp_labeler.imaging.volume import Volume
from gp_labeler.jobs.loading import load_modules
from gp_labeler.jobs.runner import Progress

if TYPE_CHECKING:
    from gp_labeler.autolabel import Proposal

__all__ = ["SuggestFromScans"]

_MODULES = ("scipy.ndimage", "scipy.spatial", "scipy.fft", "SimpleITK", "skimage.filters")


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
    """

    volume: Volume
    labelled: tuple[Path, ...]
    folder: Path
    placed: Mapping[str, FloatArray] = field(default_factory=dict)
    most: int = 5

    @property
    def title(self) -> str:
        """What the user reads."""
        return "Suggesting from labelled scans"

    def run(self, progress: Progress) -> Proposal:
        """Read the labelled scans, prepare them where they are not yet, and guess.

        Raises
        ------
        GpError
            There is no labelled scan, or the head is not found.
        """
        load_modules(*_MODULES)
        from gp_labeler.autolabel import TemplateLibrary, propose
        from gp_labeler.autolabel.registration import engine_named
        from gp_labeler.autolabel.registration_process import ProcessRegistration
        from gp_labeler.document.labelled_scans import read_labelled_scans

        progress(0.0, "Reading the labelled scans")
        found = read_labelled_scans(self.labelled)
        library = TemplateLibrary(found.scans, self.folder, most=self.most)
        with ProcessRegistration(engine_named()) as registration:
            return propose(
                self.volume,
                library,
                placed=self.placed,
                stored="as it is",
                registration=registration,
                progress=lambda fraction: progress(fraction, "Registering"),
                cancel=progress.cancelled,
            )
