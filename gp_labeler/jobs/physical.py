"""The job of the paper's physical test: a touched skull compared with its own labelled scan."""

from __future__ import annotations

from dataclasses import dataclass, replace
from io import BytesIO
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from gp_core.atlas.atlas import Atlas
from gp_core.landmarks.features import Side
from gp_core.landmarks.sets import LandmarkSet, Specimen
from gp_labeler.document.state import SpecimenState
from gp_labeler.jobs.loading import load_modules
from gp_labeler.jobs.runner import Progress

if TYPE_CHECKING:
    from gp_core.study.physical import PhysicalReport

__all__ = ["PhysicalResult", "PhysicalTest"]

_FIGURE_DPI = 160


@dataclass(frozen=True, eq=False)
class PhysicalResult:
    """What a physical test gives.

    Parameters
    ----------
    report : PhysicalReport
    figure : bytes
        Figure 6 C and D of the paper with this skull on it, a PNG file.
    """

    report: PhysicalReport
    figure: bytes


@dataclass(frozen=True, eq=False)
class PhysicalTest:
    """Compare touches with the labels and skull features of the same skull's scan.

    Parameters
    ----------
    touches : LandmarkSet
        Probe features, and skull features in `extra`; tracker frame, mm.
    ct : LandmarkSet
        CA, CB, RWA, RWP, and skull features in `extra`; scan frame, mm.
    atlas : Atlas
    specimens : tuple of Specimen
        Labelled animals, for JRMPC and for its simulation; may be none.
    n : int
        Animals to simulate a side.
    """

    touches: LandmarkSet
    ct: LandmarkSet
    atlas: Atlas
    specimens: tuple[Specimen, ...] = ()
    n: int = 1000

    title = "Testing against the scan"

    @classmethod
    def of(
        cls, state: SpecimenState, side: Side, atlas: Atlas, specimens: tuple[Specimen, ...] = ()
    ) -> PhysicalTest:
        """Make the test of one side of a specimen that was touched and labelled."""
        skull = {name: np.array(position) for name, position in state.skull.items()}
        ct = replace(state.side(side), extra=MappingProxyType(skull))
        return cls(state.touched(side), ct, atlas, specimens)

    def run(self, progress: Progress) -> PhysicalResult:
        """Register, estimate, simulate, draw.

        Raises
        ------
        GpError
            As `gp_core.study.physical.physical_test`.
        """
        load_modules("gp_core.study.physical", "gp_core.study.figures", "gp_core.registration.jrmpc_kernels")
        from gp_core.study.figures import draw_physical
        from gp_core.study.physical import physical_simulations, physical_test

        specimens = list(self.specimens) or None
        report = physical_test(self.touches, self.ct, atlas=self.atlas, specimens=specimens)
        progress(0.2, "Simulating animals")
        simulated = physical_simulations(
            self.touches, specimens=specimens, atlas=self.atlas, n=self.n, rng=np.random.default_rng(0)
        )
        progress(0.9, "Drawing")
        picture = BytesIO()
        draw_physical(report, simulated).savefig(picture, format="png", dpi=_FIGURE_DPI)
        return PhysicalResult(report, picture.getvalue())
