"""Jobs on atlases: reading one, fitting one to labelled animals, leave-one-out."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from gp_core.atlas.atlas import Atlas
from gp_core.atlas.certainty_weights import checked_weights
from gp_core.atlas.fitting import fit_screened_atlas
from gp_core.atlas.plain_fit import fit_plain_atlas
from gp_core.atlas.screening import screen_labels
from gp_core.errors import GpError
from gp_core.landmarks.features import PROBE, TRAINING, Side
from gp_core.landmarks.sets import Specimen
from gp_core.study.leave_one_out import LeaveOneOutReport, Row, leave_one_out
from gp_labeler.document.animals import Animals, Skipped, read_animals
from gp_labeler.document.atlas_memory import AtlasSource
from gp_labeler.jobs.loading import load_modules
from gp_labeler.jobs.runner import Progress

__all__ = [
    "FEWEST_ANIMALS",
    "AtlasTrial",
    "FitAtlas",
    "FittedAtlas",
    "LoadAtlas",
    "ReadAtlas",
    "RecallAtlas",
    "Recalled",
    "RefitAtlas",
    "TryAtlas",
]

FEWEST_ANIMALS = 3
"""Leave-one-out needs two to learn from."""

_NEEDED = tuple(dict.fromkeys(("CA", "CB", "RWA", "RWP", "LLI", *PROBE)))
_N_REASONS = 3


@dataclass(frozen=True)
class LoadAtlas:
    """Make the published atlas ready to say where features should be."""

    title = "Loading the atlas"

    def run(self, progress: Progress) -> Atlas:
        """Build it from the published table."""
        load_modules("gp_core.atlas.prediction", "gp_core.atlas.published")
        progress(0.0)
        return Atlas.published()


@dataclass(frozen=True)
class ReadAtlas:
    """Read an atlas file."""

    path: Path

    @property
    def title(self) -> str:
        """What the user reads."""
        return f"Reading {self.path.name}"

    def run(self, progress: Progress) -> Atlas:
        """Read it."""
        progress(0.0)
        return Atlas.load(self.path)


@dataclass(frozen=True)
class FittedAtlas:
    """An atlas, and the animals it was fitted to."""

    atlas: Atlas
    animals: Animals


@dataclass(frozen=True)
class FitAtlas:
    """Read labelled animals, and fit an atlas to them.

    Parameters
    ----------
    paths : tuple of Path
        Files and folders.
    keep_doubtful : bool
        Use the labels that the check finds doubtful, too.
    """

    paths: tuple[Path, ...]
    keep_doubtful: bool = False
    weigh_certainty: bool = False
    title = "Fitting the atlas"

    def run(self, progress: Progress) -> FittedAtlas:
        """Read and fit.

        Raises
        ------
        GpError
            Too little of it can be used; says what was skipped, and why.
        """
        load_modules("gp_core.atlas.fitting", "gp_core.atlas.prediction")
        animals = read_animals(self.paths, lambda fraction: progress(0.9 * fraction))
        progress(0.9)
        try:
            return FittedAtlas(_fitted(animals, self), animals)
        except GpError as error:
            raise _with_reasons(error, animals) from None


def _fitted(animals: Animals, how: FitAtlas) -> Atlas:
    weights = checked_weights(how.weigh_certainty)
    if how.keep_doubtful or animals.screened is None:
        return fit_plain_atlas(animals.specimens, name=animals.text, by_certainty=weights)
    return fit_screened_atlas(animals.screened, name=animals.text, by_certainty=weights)


@dataclass(frozen=True)
class Recalled:
    """The atlas to begin with.

    Parameters
    ----------
    fitted : FittedAtlas
        Without animals where it comes from a file.
    problem : str
        Why it is the published one and not the one that was chosen; empty where it is that.
    """

    fitted: FittedAtlas
    problem: str = ""


@dataclass(frozen=True)
class RecallAtlas:
    """Read the atlas that was chosen last, or fit it again; the published one where that cannot be."""

    source: AtlasSource
    title = "Loading the atlas"

    def run(self, progress: Progress) -> Recalled:
        """Read or fit."""
        file = self.source.file
        try:
            if file is None:
                source = self.source
                job = FitAtlas(source.animals, source.keep_doubtful, source.weigh_certainty)
                return Recalled(job.run(progress))
            return Recalled(FittedAtlas(ReadAtlas(file).run(progress), Animals(())))
        except (GpError, OSError) as error:
            problem = f"{str(error).rstrip('.')}."
            return Recalled(FittedAtlas(LoadAtlas().run(progress), Animals(())), problem)


@dataclass(frozen=True, eq=False)
class RefitAtlas:
    """Fit an atlas to animals that were read before."""

    specimens: tuple[Specimen, ...]
    keep_doubtful: bool = False
    confirmed: frozenset[tuple[str, Side, str]] = frozenset()
    weigh_certainty: bool = False
    title = "Fitting the atlas to the other animals"

    def run(self, progress: Progress) -> Atlas:
        """Fit."""
        progress(0.0)
        weights = checked_weights(self.weigh_certainty)
        if self.keep_doubtful:
            return fit_plain_atlas(self.specimens, by_certainty=weights)
        screened = screen_labels(self.specimens, confirmed=self.confirmed)
        return fit_screened_atlas(screened, by_certainty=weights)


@dataclass(frozen=True)
class AtlasTrial:
    """How well each animal's cochlea is estimated from the other animals.

    Parameters
    ----------
    reports : tuple of LeaveOneOutReport
        One for each method, on the same sides.
    n_animals : int
        That took part.
    skipped : tuple of Skipped
        Sides that did not.
    """

    reports: tuple[LeaveOneOutReport, ...]
    n_animals: int
    skipped: tuple[Skipped, ...] = ()

    @property
    def n_sides(self) -> int:
        """Sides that were held out."""
        return len(self.reports[0].rows)

    @property
    def figures(self) -> dict[str, tuple[float, float, float, float]]:
        """Mean and largest error of CO, mm, and mean and largest of the axis, degrees, by method."""
        return {
            report.method: (
                float(report.errors.e_co_mm.mean()),
                float(report.errors.e_co_mm.max()),
                float(report.errors.e_ma_deg.mean()),
                float(report.errors.e_ma_deg.max()),
            )
            for report in self.reports
        }


@dataclass(frozen=True, eq=False)
class TryAtlas:
    """Hold each animal out, and estimate its cochlea from the others."""

    specimens: tuple[Specimen, ...]
    title = "Leave-one-out"

    def run(self, progress: Progress) -> AtlasTrial:
        """Estimate by both methods.

        Raises
        ------
        GpError
            Fewer than three animals have the features that it takes.
        """
        load_modules("gp_core.registration.jrmpc_kernels", "gp_core.registration.rotation_compiled")
        animals, skipped = _complete(self.specimens)
        training = tuple(code for code in TRAINING if code == "CO" or _all_have(animals, code))
        robust: list[Row] = []
        for n, animal in enumerate(animals):
            progress(0.9 * n / len(animals), f"Leave-one-out: {animal.name}")
            report = leave_one_out(animals, method="robust", training=training, held_out=[animal.name])
            robust += report.rows
        progress(0.9, "Leave-one-out: JRMPC, compiled on its first use")
        jrmpc = leave_one_out(animals, method="jrmpc", training=training)
        reports = (LeaveOneOutReport("robust", training, PROBE, None, tuple(robust)), jrmpc)
        return AtlasTrial(reports, len(animals), skipped)


def _complete(specimens: tuple[Specimen, ...]) -> tuple[list[Specimen], tuple[Skipped, ...]]:
    """Leave out sides that lack a feature that it cannot do without, and sides of too few animals."""
    skipped, kept = [], {specimen.name: dict(specimen.sides) for specimen in specimens}
    for name, sides in kept.items():
        for side, landmarks in list(sides.items()):
            missing = [code for code in _NEEDED if code not in landmarks]
            if missing:
                del sides[side]
                skipped.append(Skipped(f"{name} {side.word}", f"lacks {' '.join(missing)}"))
    for side in Side:
        names = [name for name, sides in kept.items() if side in sides]
        if 0 < len(names) < FEWEST_ANIMALS:
            for name in names:
                del kept[name][side]
            why = f"{FEWEST_ANIMALS} animals with this side are needed"
            skipped += [Skipped(f"{name} {side.word}", why) for name in names]
    animals = [Specimen(name, sides) for name, sides in kept.items() if sides]
    if not animals:
        raise GpError(
            f"leave-one-out needs {FEWEST_ANIMALS} animals that have {' '.join(_NEEDED)} on the same side",
            remedy="Label more of them.",
        )
    return animals, tuple(skipped)


def _all_have(animals: list[Specimen], code: str) -> bool:
    return all(code in landmarks for animal in animals for landmarks in animal.sides.values())


def _with_reasons(error: GpError, animals: Animals) -> GpError:
    """Return the error with what was skipped, and why."""
    reasons = [f"Skipped {skipped.text}" for skipped in animals.skipped[:_N_REASONS]]
    if len(animals.skipped) > _N_REASONS:
        reasons.append(f"And {len(animals.skipped) - _N_REASONS} more were skipped.")
    remedy = " ".join([error.remedy or "Label more animals, or choose more files.", *reasons])
    return GpError(error.problem, specimen=error.specimen, landmark=error.landmark, remedy=remedy)
