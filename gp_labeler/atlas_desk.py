"""What of a workbench concerns the atlas: which one is in use, and where it came from."""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial

from gp_core.atlas.atlas import Atlas
from gp_core.atlas.shape import predict
from gp_core.landmarks.features import Side
from gp_core.landmarks.sets import Specimen
from gp_labeler.desk_signals import DeskSignals
from gp_labeler.session.ghosts import Predict
from gp_labeler.session.jobs import Jobs
from gp_labeler.session.session import Session
from gp_labeler.work import LoadAtlas

__all__ = ["AtlasDesk"]


class AtlasDesk(DeskSignals):
    """Keeps the atlas behind ghosts, doubts and poses; `Workbench` is one.

    Parameters
    ----------
    atlas : Atlas, optional
        To begin with; by default none, until `load_atlas` or `use_atlas`.
    """

    jobs: Jobs
    session: Session

    def __init__(self, atlas: Atlas | None = None) -> None:
        super().__init__()
        self._atlas = atlas
        self._atlas_specimens: tuple[Specimen, ...] = ()

    @property
    def atlas(self) -> Atlas | None:
        """The atlas in use; None while it is being loaded."""
        return self._atlas

    @property
    def atlas_specimens(self) -> tuple[Specimen, ...]:
        """The animals that the atlas was fitted to here; none for the published one and those of files."""
        return self._atlas_specimens

    def load_atlas(self) -> None:
        """Get the published atlas ready in the background, where there is none; ghosts appear when it is."""
        if self._atlas is None:
            self.jobs.submit(LoadAtlas(), self.use_atlas, key="atlas")

    def use_atlas(self, atlas: Atlas, specimens: Iterable[Specimen] = ()) -> None:
        """Take another atlas for ghosts, doubts and poses.

        Parameters
        ----------
        atlas : Atlas
            The atlas.
        specimens : iterable of Specimen
            The animals it was fitted to, where they are at hand: leave-one-out and the method ``jrmpc`` need
            them.
        """
        self._atlas, self._atlas_specimens = atlas, tuple(specimens)
        self.session.set_predict(self._predict)
        self.atlas_changed.emit()
        self._judge(Side)

    @property
    def _predict(self) -> Predict | None:
        """What the session expects features by."""
        return None if self._atlas is None else partial(predict, self._atlas)

    def _judge(self, sides: Iterable[Side]) -> None:
        """Find the doubts of some sides in the background."""
        for side in sides:
            job = self.session.judging(side)
            self.jobs.submit(job, lambda _: self.doubts_changed.emit(), key=f"judging {side.value}")
