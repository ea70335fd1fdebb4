"""The atlas behind ghosts, problems and poses: which is in use, where it came from, how good it is."""

from __future__ import annotations

import json
from collections.abc import Iterable
from functools import partial
from os import PathLike
from pathlib import Path
from typing import Any

from gp_core.atlas.atlas import Atlas
from gp_core.atlas.label_check import check_side
from gp_core.atlas.labelling_error import LabellingError
from gp_core.atlas.prediction import predict
from gp_core.errors import GpError
from gp_core.landmarks.sets import Specimen
from gp_labeler.document.animals import Animals
from gp_labeler.document.atlas_memory import AtlasMemory, AtlasSource
from gp_labeler.document.labelling_error_memory import LabellingErrorMemory
from gp_labeler.document.signals import Signal
from gp_labeler.document.specimen_document import SpecimenDocument
from gp_labeler.jobs.atlas import (
    FEWEST_ANIMALS,
    AtlasTrial,
    FitAtlas,
    FittedAtlas,
    LoadAtlas,
    ReadAtlas,
    RecallAtlas,
    Recalled,
    RefitAtlas,
    TryAtlas,
)
from gp_labeler.jobs.runner import Jobs, Task
from gp_labeler.models.ghosts import Predict
from gp_labeler.models.label_checks import Check
from gp_labeler.models.messages import Messages

__all__ = ["AtlasModel", "is_atlas_file"]

_HEAD = 4096

_TRIAL = "atlas trial"


class AtlasModel:
    """Keeps the atlas in use; a specimen that is one of its animals is compared with the others alone.

    Parameters
    ----------
    document : SpecimenDocument
        Its name says whether it is one of the animals.
    jobs : Jobs
        Where atlases are read and fitted.
    messages : Messages
        What the user is told by.
    memory : AtlasMemory, optional
        Remembers which one was chosen last.
    atlas : Atlas, optional
        To begin with; by default none, until `load` or `use`.
    errors : LabellingErrorMemory, optional
        Remembers the measured error of labels.
    """

    changed = Signal()
    """Another atlas is in use: `current`, `specimens`."""
    details_changed = Signal()
    """What is known of the atlas in use changed: `file`, `problem`, `trial`."""
    labelling_error_changed = Signal(object)
    """The `LabellingError` that checks and regions allow for from now on, or None."""
    expectations_changed = Signal()
    """Features are expected, and labels checked, by another atlas: `predict`, `check`."""

    def __init__(
        self,
        document: SpecimenDocument,
        jobs: Jobs,
        messages: Messages,
        memory: AtlasMemory | None = None,
        atlas: Atlas | None = None,
        errors: LabellingErrorMemory | None = None,
    ) -> None:
        self._errors = errors
        self.labelling_error = None if errors is None else errors.recall()
        """The measured error of labels that checks and regions use; None for the one of the atlas."""
        self._document, self._jobs, self._messages, self._memory = document, jobs, messages, memory
        self._atlas = self._expected_by = atlas
        self._specimens: tuple[Specimen, ...] = ()
        self.file: Path | None = None
        self.source: AtlasSource | None = None
        self.problem = ""  # why the one chosen last is not in use
        self.animals: Animals | None = None
        self.keep_doubtful = False  # in the fits to come
        self.weigh_certainty = False  # likewise
        self.trial: AtlasTrial | None = None
        self.is_refitting = False
        """Whether an atlas without the open specimen is being fitted, by which it will be checked."""
        document.reset.connect(self._on_reset)
        document.labelling_changed.connect(self._on_reset)
        jobs.cancelled.connect(self._on_cancelled)

    @property
    def current(self) -> Atlas | None:
        """The atlas in use; None while it is being loaded."""
        return self._atlas

    @property
    def expected_by(self) -> Atlas | None:
        """The atlas in use, or one that lacks the open specimen; None while it is being loaded."""
        return self._expected_by

    @property
    def specimens(self) -> tuple[Specimen, ...]:
        """The animals that the atlas was fitted to here; none for the published one and those of files."""
        return self._specimens

    @property
    def predict(self) -> Predict | None:
        """Where features are expected, given some: by the atlas, or by one that lacks the open specimen."""
        return None if self._expected_by is None else partial(predict, self.allowing(self._expected_by))

    @property
    def check(self) -> Check | None:
        """What checks labels: by the same atlas as `predict`."""
        expected_by = self._expected_by
        return None if expected_by is None else partial(check_side, atlas=self.allowing(expected_by))

    def allowing(self, atlas: Atlas) -> Atlas:
        """Return an atlas that allows for the measured error of labels, if that is in use."""
        error = self.labelling_error
        return atlas if error is None else atlas.with_labelling_error(error)

    @property
    def labelling_error_in_use(self) -> LabellingError:
        """The error of labels that checks and regions allow for: the measured one, else that of the atlas."""
        if self.labelling_error is not None:
            return self.labelling_error
        return LabellingError() if self._atlas is None else self._atlas.labelling_error

    @property
    def labelling_error_text(self) -> str:
        """The same in words."""
        return self.labelling_error_in_use.text

    def set_labelling_error(self, error: LabellingError | None) -> None:
        """Let checks and regions allow for a measured error of labels, or again for the one of the atlas."""
        if error == self.labelling_error:
            return
        self.labelling_error = error
        if self._errors is not None:
            self._errors.remember(error)
        self.labelling_error_changed.emit(error)
        self.details_changed.emit()
        self.expectations_changed.emit()

    @property
    def is_published(self) -> bool:
        """Whether the atlas in use is the one that the program comes with."""
        return self._atlas is not None and self._atlas is Atlas.published()

    @property
    def keeps_doubtful(self) -> bool:
        """Whether the atlas in use was fitted to doubtful labels as well."""
        return self.source is not None and self.source.keep_doubtful

    @property
    def text(self) -> str:
        """Which atlas ghosts and problems come from, where it is not the published one."""
        if self._atlas is None or self.is_published:
            return ""
        without = f" without {self._document.state.specimen}" if self.is_held_out else ""
        return f"the atlas of {self._atlas.name}{without}"

    @property
    def can_try(self) -> bool:
        """Whether there are animals enough for leave-one-out."""
        return len(self._specimens) >= FEWEST_ANIMALS

    @property
    def is_trying(self) -> bool:
        """Whether leave-one-out is at work."""
        return self._jobs.is_running(_TRIAL)

    @property
    def is_held_out(self) -> bool:
        """Whether the open specimen is one of the animals, so that it is compared with the others alone."""
        return any(animal.name == self._document.state.specimen for animal in self._specimens)

    # Which atlas

    def load(self) -> None:
        """Get an atlas ready in the background, where there is none; ghosts appear when it is.

        That is the one chosen last; where it is gone or damaged, the published one, with a warning.
        """
        if self._atlas is not None:
            return
        source = None if self._memory is None else self._memory.recall()
        self.keep_doubtful = source is not None and source.keep_doubtful
        self.weigh_certainty = source is not None and source.weigh_certainty
        if source is None:
            self._begin_with_published()
        else:
            self._jobs.submit(RecallAtlas(source), partial(self._take_recalled, source), key="first atlas")

    def use_published(self) -> None:
        """Take the published atlas, in the background."""

        def take(atlas: Atlas) -> None:
            self.use(atlas)
            self._remember_source(None)

        self._jobs.submit(LoadAtlas(), take, key="atlas")

    def open(self, path: str | PathLike[str]) -> None:
        """Read an atlas file in the background, and take it."""
        file = Path(path)

        def take(atlas: Atlas) -> None:
            self._take_read(atlas, file)
            self._remember_source(AtlasSource(file))

        self._jobs.submit(ReadAtlas(file), take, key="atlas")

    def set_keep_doubtful(self, keep: bool) -> None:
        """Believe doubtful labels in the fits to come, or leave them out; a fit in use is made again."""
        if keep == self.keep_doubtful:
            return
        self.keep_doubtful = keep
        source = self.source
        if source is not None and source.animals and source.keep_doubtful != keep:
            self.fit(source.animals)
        self.details_changed.emit()

    def set_weigh_certainty(self, weigh: bool) -> None:
        """Weigh labels by their certainty in the fits to come, or not; a fit in use is made again."""
        if weigh == self.weigh_certainty:
            return
        self.weigh_certainty = weigh
        source = self.source
        if source is not None and source.animals and source.weigh_certainty != weigh:
            self.fit(source.animals)
        self.details_changed.emit()

    def fit(
        self,
        paths: Iterable[str | PathLike[str]],
        *,
        keep_doubtful: bool | None = None,
        weigh_certainty: bool | None = None,
    ) -> None:
        """Read labelled animals in the background, fit an atlas to them, and take it.

        Parameters
        ----------
        paths : iterable of path
            Files and folders.
        keep_doubtful : bool, optional
            Believe labels that `screening.screen_labels` would leave out; by default as set by
            `set_keep_doubtful`.
        weigh_certainty : bool, optional
            Weigh labels by their certainty; by default as set by `set_weigh_certainty`.
        """
        animals = tuple(map(Path, paths))
        if keep_doubtful is not None:
            self.keep_doubtful = keep_doubtful
        if weigh_certainty is not None:
            self.weigh_certainty = weigh_certainty
        keep, weigh = self.keep_doubtful, self.weigh_certainty

        def take(fitted: FittedAtlas) -> None:
            source = AtlasSource(None, animals, keep, weigh)
            self._take_fitted(fitted, source)
            self._remember_source(source)

        self._jobs.submit(FitAtlas(animals, keep, weigh), take, key="atlas")

    def save(self, path: str | PathLike[str]) -> None:
        """Write the atlas in use; raises `GpError` where there is none, or it cannot be written."""
        if self._atlas is None:
            raise GpError("there is no atlas yet", remedy="Wait until it is loaded.")
        file = Path(path)
        try:
            self._atlas.save(file)
        except OSError as error:
            raise GpError(f"cannot be written ({error.strerror})", file=file) from None
        self.file = None if self.is_published else file
        if self.file is not None and self.animals is None:  # else it is fitted to them again
            self._remember_source(AtlasSource(file))
        self.details_changed.emit()
        self._messages.wrote.emit("atlas", file)

    def try_out(self) -> None:
        """Do leave-one-out on the animals that the atlas was fitted to, in the background."""
        if not self.can_try:
            raise GpError(
                f"leave-one-out needs at least {FEWEST_ANIMALS} animals, got {len(self._specimens)}",
                remedy="Fit an atlas from labelled animals first.",
            )
        self._jobs.submit(TryAtlas(self._specimens), self._take_trial, key=_TRIAL)

    def use(self, atlas: Atlas, specimens: Iterable[Specimen] = (), *, file: Path | None = None) -> None:
        """Take another atlas for ghosts, problems and poses.

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
        self._jobs.cancel(_TRIAL)
        self._atlas, self._specimens = atlas, animals.specimens
        self.animals = animals if animals.specimens else None
        self.source, self.trial = source, None
        self.file = None if source is None else source.file
        self.problem = ""
        self._expect_by(atlas)
        self.changed.emit()

    def _begin_with_published(self) -> None:
        def take(atlas: Atlas) -> None:
            if self._atlas is None:  # else another one came first
                self.use(atlas)

        self._jobs.submit(LoadAtlas(), take, key="first atlas")

    def _take_recalled(self, source: AtlasSource, recalled: Recalled) -> None:
        if self._atlas is not None:
            return
        if recalled.problem:
            self.use(recalled.fitted.atlas)
            self.problem = f"The atlas of {source.text} is no longer available: {recalled.problem}"
            self.details_changed.emit()
            self._messages.say(f"{self.problem} The published atlas is used.", "warning")
        elif source.file is not None:
            self._take_read(recalled.fitted.atlas, source.file)
        else:
            self._take_fitted(recalled.fitted, source)

    def _on_cancelled(self, task: Task[Any]) -> None:
        if isinstance(task.job, RecallAtlas) and self._atlas is None:
            self._begin_with_published()

    def _remember_source(self, source: AtlasSource | None) -> None:
        if self._memory is not None:
            self._memory.remember(source)

    def _take_read(self, atlas: Atlas, file: Path) -> None:
        self.use(atlas, file=file)
        self._messages.say(f"The atlas of {file.name} is in use", "info")

    def _take_fitted(self, fitted: FittedAtlas, source: AtlasSource) -> None:
        self._take(fitted.atlas, fitted.animals, source)
        n = len(fitted.animals.skipped)
        text = f"The atlas was fitted to {fitted.animals.text}" + (f"; {n} skipped" if n else "")
        doubtful = list(dict.fromkeys(finding.specimen for finding in fitted.animals.problems))
        if doubtful:
            many = "animal" if len(doubtful) == 1 else "animals"
            text += f"; {len(doubtful)} {many} with problems: {', '.join(doubtful)}"
        self._messages.say(text, "warning" if n or doubtful else "info")

    def _take_trial(self, trial: AtlasTrial) -> None:
        self.trial = trial
        self.details_changed.emit()

    # Held out

    def _on_reset(self) -> None:
        self._expect_by(self._atlas)

    def _expect_by(self, atlas: Atlas | None) -> None:
        """Expect and check by an atlas, and as soon as it is fitted by one that lacks the open specimen."""
        self._jobs.cancel("atlas without")
        name, before = self._document.state.specimen, self._expected_by
        others = tuple(animal for animal in self._specimens if animal.name != name)
        enough = sum(len(animal.sides) for animal in others) >= FEWEST_ANIMALS
        self.is_refitting = self.is_held_out and enough
        self._expected_by = self._without_earlier_labels(atlas)
        if self.is_refitting:
            confirmed = frozenset() if self.animals is None else self.animals.confirmed
            weighs = self.source is not None and self.source.weigh_certainty
            job = RefitAtlas(others, self.keeps_doubtful, confirmed, weighs)
            self._jobs.submit(job, self._hold_out, key="atlas without")
        if before is not self._expected_by:
            self.expectations_changed.emit()

    def _without_earlier_labels(self, atlas: Atlas | None) -> Atlas | None:
        """Return the published atlas for one that knows labels that a blind labelling shall not follow."""
        state = self._document.state
        knows = atlas is not None and (state.specimen in atlas.specimens or self.is_held_out)
        return Atlas.published() if state.blind and knows else atlas

    def _hold_out(self, atlas: Atlas) -> None:
        self.is_refitting, self._expected_by = False, atlas
        self.expectations_changed.emit()


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
