"""What of a workbench concerns the atlas: which one is in use, where it came from, and how good it is."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from functools import partial
from os import PathLike
from pathlib import Path
from typing import Any

from gp_core.atlas.atlas import Atlas
from gp_core.atlas.label_check import Departure, SideCheck, check_side
from gp_core.atlas.prediction import predict
from gp_core.errors import GpError
from gp_core.landmarks.features import Side
from gp_core.landmarks.sets import Specimen
from gp_core.terminal import printable
from gp_labeler.document.animals import Animals
from gp_labeler.document.atlas_memory import AtlasMemory, AtlasSource
from gp_labeler.jobs.atlas import (
    FEWEST_ANIMALS,
    FitAtlas,
    FittedAtlas,
    ReadAtlas,
    RecallAtlas,
    Recalled,
    RefitAtlas,
    Trial,
    TryAtlas,
)
from gp_labeler.jobs.runner import Jobs, Task
from gp_labeler.jobs.work import LoadAtlas
from gp_labeler.models.desk_signals import DeskSignals
from gp_labeler.models.ghosts import Predict
from gp_labeler.models.label_checks import Check
from gp_labeler.models.session import Session

__all__ = ["AtlasDesk", "expecting", "is_atlas_file"]

_HEAD = 4096

_DRAWN_FIRST_S = 0.1
"""Judging takes the interpreter away from drawing; a click that comes sooner spares it altogether."""


class AtlasDesk(DeskSignals):
    """Keeps the atlas behind ghosts, doubts and poses; `Workbench` is one.

    Parameters
    ----------
    atlas : Atlas, optional
        To begin with; by default none, until `load_atlas` or `use_atlas`.
    """

    jobs: Jobs
    session: Session
    atlas_memory: AtlasMemory | None

    def __init__(self, atlas: Atlas | None = None) -> None:
        super().__init__()
        self._atlas = atlas
        self._atlas_specimens: tuple[Specimen, ...] = ()
        self.atlas_file: Path | None = None
        self.atlas_source: AtlasSource | None = None
        self.atlas_problem = ""  # why the one chosen last is not in use
        self.animals: Animals | None = None
        self.keep_doubtful = False  # in the fits to come
        self.trial: Trial | None = None
        self.session_replaced.connect(self._hold_against)
        self.jobs.cancelled.connect(self._on_cancelled)

    @property
    def atlas(self) -> Atlas | None:
        """The atlas in use; None while it is being loaded."""
        return self._atlas

    @property
    def atlas_specimens(self) -> tuple[Specimen, ...]:
        """The animals that the atlas was fitted to here; none for the published one and those of files."""
        return self._atlas_specimens

    @property
    def is_published_atlas(self) -> bool:
        """Whether the atlas in use is the one that the program comes with."""
        return self._atlas is not None and self._atlas is Atlas.published()

    @property
    def keeps_doubtful(self) -> bool:
        """Whether the atlas in use was fitted to doubtful labels as well."""
        return self.atlas_source is not None and self.atlas_source.keep_doubtful

    @property
    def atlas_words(self) -> str:
        """Which atlas ghosts and doubts come from, where it is not the published one."""
        if self._atlas is None or self.is_published_atlas:
            return ""
        without = f" without {self.session.state.specimen}" if self.is_held_out else ""
        return f"the atlas of {self._atlas.name}{without}"

    @property
    def can_try_atlas(self) -> bool:
        """Whether there are animals enough for leave-one-out."""
        return len(self._atlas_specimens) >= FEWEST_ANIMALS

    @property
    def is_held_out(self) -> bool:
        """Whether the open specimen is one of the animals, so that it is held against the others alone."""
        return any(animal.name == self.session.state.specimen for animal in self._atlas_specimens)

    def departures(self, side: Side) -> Mapping[str, Departure] | None:
        """Return how far the labels of one side are from where the atlas expects them; None while unknown."""
        known = self.session.judging(side).known
        return None if known is None else known.departures

    # Which atlas

    def load_atlas(self) -> None:
        """Get an atlas ready in the background, where there is none; ghosts appear when it is.

        That is the one chosen last; where it is gone or damaged, the published one, with a warning.
        """
        if self._atlas is not None:
            return
        source = None if self.atlas_memory is None else self.atlas_memory.recall()
        self.keep_doubtful = source is not None and source.keep_doubtful
        if source is None:
            self._begin_with_published()
        else:
            self.jobs.submit(RecallAtlas(source), partial(self._take_recalled, source), key="first atlas")

    def use_published_atlas(self) -> None:
        """Take the published atlas, in the background."""

        def take(atlas: Atlas) -> None:
            self.use_atlas(atlas)
            self._remember_source(None)

        self.jobs.submit(LoadAtlas(), take, key="atlas")

    def open_atlas(self, path: str | PathLike[str]) -> None:
        """Read an atlas file in the background, and take it."""
        file = Path(path)

        def take(atlas: Atlas) -> None:
            self._take_read(atlas, file)
            self._remember_source(AtlasSource(file))

        self.jobs.submit(ReadAtlas(file), take, key="atlas")

    def set_keep_doubtful(self, keep: bool) -> None:
        """Believe doubtful labels in the fits to come, or leave them out; a fit in use is made again."""
        if keep == self.keep_doubtful:
            return
        self.keep_doubtful = keep
        source = self.atlas_source
        if source is not None and source.animals and source.keep_doubtful != keep:
            self.fit_atlas(source.animals)
        self.atlas_details_changed.emit()

    def fit_atlas(self, paths: Iterable[str | PathLike[str]], *, keep_doubtful: bool | None = None) -> None:
        """Read labelled animals in the background, fit an atlas to them, and take it.

        Parameters
        ----------
        paths : iterable of path
            Files and folders.
        keep_doubtful : bool, optional
            Believe labels that `screening.screen_labels` would leave out; by default as set by
            `set_keep_doubtful`.
        """
        animals = tuple(map(Path, paths))
        if keep_doubtful is not None:
            self.keep_doubtful = keep_doubtful
        keep_doubtful = self.keep_doubtful

        def take(fitted: FittedAtlas) -> None:
            source = AtlasSource(animals=animals, keep_doubtful=keep_doubtful)
            self._take_fitted(fitted, source)
            self._remember_source(source)

        self.jobs.submit(FitAtlas(animals, keep_doubtful), take, key="atlas")

    def save_atlas(self, path: str | PathLike[str]) -> None:
        """Write the atlas in use; raises `GpError` where there is none, or it cannot be written."""
        if self._atlas is None:
            raise GpError("there is no atlas yet", remedy="Wait until it is loaded.")
        file = Path(path)
        try:
            self._atlas.save(file)
        except OSError as error:
            raise GpError(f"cannot be written ({error.strerror})", file=file) from None
        self.atlas_file = None if self.is_published_atlas else file
        if self.atlas_file is not None and self.animals is None:  # else it is fitted to them again
            self._remember_source(AtlasSource(file))
        self.atlas_details_changed.emit()
        self.wrote.emit("atlas", file)

    def try_atlas(self) -> None:
        """Do leave-one-out on the animals that the atlas was fitted to, in the background."""
        if not self.can_try_atlas:
            raise GpError(
                f"leave-one-out needs at least {FEWEST_ANIMALS} animals, got {len(self._atlas_specimens)}",
                remedy="Fit an atlas from labelled animals first.",
            )
        self.jobs.submit(TryAtlas(self._atlas_specimens), self._take_trial, key="atlas trial")

    def use_atlas(
        self, atlas: Atlas, specimens: Iterable[Specimen] = (), *, file: Path | None = None
    ) -> None:
        """Take another atlas for ghosts, doubts and poses.

        Parameters
        ----------
        atlas : Atlas
            The atlas.
        specimens : iterable of Specimen
            The animals it was fitted to, where they are at hand: leave-one-out and the method ``jrmpc`` need
            them.
        file : Path, optional
            Where it was read from.
        """
        self._take(atlas, Animals(tuple(specimens)), None if file is None else AtlasSource(file))

    # Inside

    def _take(self, atlas: Atlas, animals: Animals, source: AtlasSource | None) -> None:
        self._cancel("atlas trial")
        self._atlas, self._atlas_specimens = atlas, animals.specimens
        self.animals = animals if animals.specimens else None
        self.atlas_source, self.trial = source, None
        self.atlas_file = None if source is None else source.file
        self.atlas_problem = ""
        self._expect_by(atlas)
        self.atlas_changed.emit()
        self._hold_against()

    def _begin_with_published(self) -> None:
        def take(atlas: Atlas) -> None:
            if self._atlas is None:  # else another one came first
                self.use_atlas(atlas)

        self.jobs.submit(LoadAtlas(), take, key="first atlas")

    def _take_recalled(self, source: AtlasSource, recalled: Recalled) -> None:
        if self._atlas is not None:
            return
        if recalled.problem:
            self.use_atlas(recalled.fitted.atlas)
            self.atlas_problem = f"The atlas of {source.text} cannot be had any more: {recalled.problem}"
            self.atlas_details_changed.emit()
            self.message.emit(printable(f"{self.atlas_problem} The published one is in use."), "warning")
        elif source.file is not None:
            self._take_read(recalled.fitted.atlas, source.file)
        else:
            self._take_fitted(recalled.fitted, source)

    def _on_cancelled(self, task: Task[Any]) -> None:
        if isinstance(task.job, RecallAtlas) and self._atlas is None:
            self._begin_with_published()

    def _remember_source(self, source: AtlasSource | None) -> None:
        if self.atlas_memory is not None:
            self.atlas_memory.remember(source)

    def _take_read(self, atlas: Atlas, file: Path) -> None:
        self.use_atlas(atlas, file=file)
        self.message.emit(printable(f"The atlas of {file.name} is in use"), "info")

    def _take_fitted(self, fitted: FittedAtlas, source: AtlasSource) -> None:
        self._take(fitted.atlas, fitted.animals, source)
        n = len(fitted.animals.skipped)
        text = f"The atlas was fitted to {fitted.animals.text}" + (f"; {n} skipped" if n else "")
        doubted = list(dict.fromkeys(finding.specimen for finding in fitted.animals.doubts))
        if doubted:
            many = "animal" if len(doubted) == 1 else "animals"
            text += f"; {len(doubted)} {many} in doubt: {', '.join(doubted)}"
        self.message.emit(printable(text), "warning" if n or doubted else "info")

    def _take_trial(self, trial: Trial) -> None:
        self.trial = trial
        self.atlas_details_changed.emit()

    def _hold_against(self, *_: object) -> None:
        """Judge the labels of the open specimen, by an atlas that does not know them."""
        self._cancel("atlas without")
        name = self.session.state.specimen
        others = tuple(animal for animal in self._atlas_specimens if animal.name != name)
        if self.is_held_out and sum(len(animal.sides) for animal in others) >= FEWEST_ANIMALS:
            confirmed = frozenset() if self.animals is None else self.animals.confirmed
            job = RefitAtlas(others, keep_doubtful=self.keeps_doubtful, confirmed=confirmed)
            self.jobs.submit(job, self._hold_out, key="atlas without")
        else:
            self._judge(Side, after=0.0)

    def _hold_out(self, atlas: Atlas) -> None:
        self._expect_by(atlas)
        self._judge(Side, after=0.0)

    def _expect_by(self, atlas: Atlas) -> None:
        self.session.set_predict(*expecting(atlas))

    def _judge(self, sides: Iterable[Side], *, after: float = _DRAWN_FIRST_S) -> None:
        """Find the doubts of some sides in the background, by default once what was clicked is drawn."""
        for side in sides:
            job, key = self.session.judging(side), f"judging {side.value}"
            done = partial(self._take_judged, bool(self.session.near_doubts(side)))
            self.jobs.submit(job, done, key=key, after=after)

    def _take_judged(self, showed_doubts: bool, found: SideCheck) -> None:
        self.judged.emit()
        if showed_doubts or found.doubts:
            self.doubts_changed.emit()  # else all points look as they did

    def _cancel(self, key: str) -> None:
        for task in self.jobs.running:
            if task.key == key:
                task.cancel()


def expecting(atlas: Atlas) -> tuple[Predict, Check]:
    """Return what a session expects features and checks labels by."""
    return partial(predict, atlas), partial(check_side, atlas=atlas)


def is_atlas_file(path: str | PathLike[str]) -> bool:
    """Whether a file says of itself that it is an atlas; it may be damaged."""
    file = Path(path)
    if file.suffix.lower() != ".json" or not file.is_file():
        return False
    try:
        with file.open("rb") as stream:
            return json.dumps("gpAtlas").encode() in stream.read(_HEAD)
    except OSError:
        return False
