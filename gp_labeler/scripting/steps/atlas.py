"""Steps that ask the atlas: fit one to labelled animals, check the labels."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import ClassVar

from gp_core import Atlas, Specimen, check_specimen, load_specimens
from gp_core.atlas.certainty_weights import checked_weights
from gp_core.atlas.fitting import fit_screened_atlas
from gp_core.atlas.plain_fit import fit_plain_atlas
from gp_core.atlas.screening import screen_labels
from gp_core.disk import write_text
from gp_core.errors import GpError
from gp_core.landmarks.features import Side
from gp_labeler.scripting.step import Step
from gp_labeler.scripting.window_driver import WindowDriver

__all__ = ["Check", "Fit", "Reliability", "UseAtlas"]


@dataclass(frozen=True)
class Fit(Step):
    """Fit an atlas to labelled animals.

    Parameters
    ----------
    specimens : text or texts
        Landmark files, or folders of them.
    path : str
        The atlas file.
    keep_doubtful : bool
        Use labels that the check finds doubtful, too; by default they are left out, and named.
    weigh_certainty : bool
        Let labels count by their certainty.
    """

    do: ClassVar[str] = "fit"
    specimens: tuple[str, ...]
    path: str = "atlas.json"
    keep_doubtful: bool = False
    weigh_certainty: bool = False

    def run(self, driver: WindowDriver) -> str:  # noqa: D102
        weights = checked_weights(self.weigh_certainty)
        specimens = load_specimens([driver.to_read(each) for each in self.specimens])
        screened, file = screen_labels(specimens), driver.to_write(self.path)
        if self.keep_doubtful:
            atlas = fit_plain_atlas(specimens, by_certainty=weights)
        else:
            atlas = fit_screened_atlas(screened, by_certainty=weights)
        atlas.save(file)
        kept = "believed" if self.keep_doubtful else "left out"
        left_out = [f"{f.specimen} {f.side.word}: {f.text}, {kept}" for f in screened.left_out]
        return ". ".join((f"{driver.wrote(file)}, {len(specimens)} animals", *left_out))


@dataclass(frozen=True)
class UseAtlas(Step):
    """Take another atlas: for where features are expected, for problems and for poses.

    Parameters
    ----------
    path : str, optional
        An atlas file, or ``published``.
    specimens : text or texts
        Instead: labelled animals, files or folders of them, to fit one to.
    keep_doubtful : bool
        Fit it to labels that the check finds doubtful, too.
    weigh_certainty : bool
        Let labels count by their certainty.
    """

    do: ClassVar[str] = "atlas"
    path: str | None = None
    specimens: tuple[str, ...] = ()
    keep_doubtful: bool = False
    weigh_certainty: bool = False

    def run(self, driver: WindowDriver) -> str:  # noqa: D102
        workspace = driver.workspace
        if (self.path is None) == (not self.specimens):
            raise GpError("atlas needs path or specimens, one of them")
        if self.specimens:
            workspace.atlas.fit(
                [driver.to_read(each) for each in self.specimens],
                keep_doubtful=self.keep_doubtful,
                weigh_certainty=self.weigh_certainty,
            )
        elif self.path == "published":
            workspace.atlas.use_published()
        else:
            workspace.atlas.open(driver.to_read(self.path or ""))
        driver.wait_until_idle()
        return f"{len(workspace.atlas.specimens)} animals" if workspace.atlas.specimens else self.path or ""


@dataclass(frozen=True)
class Reliability(Step):
    """Measure how repeatable labels are, of animals that were labelled more than once.

    Parameters
    ----------
    specimens : text or texts
        Landmark files, specimen files, or folders of them; by default the open specimen, as it is saved.
    path : text or texts
        Where to write what was found: ``.json``, ``.csv``, or a picture.
    use : bool, optional
        Whether checks and regions shall use the measured error from now on; by default that stays as it is.
    """

    do: ClassVar[str] = "reliability"
    specimens: tuple[str, ...] = ()
    path: tuple[str, ...] = ()
    use: bool | None = None

    def run(self, driver: WindowDriver) -> str:  # noqa: D102
        model = driver.workspace.reliability
        if self.use is False and not self.specimens and not self.path:
            model.use_error(False)
            driver.wait_until_idle()
            return "the error of labels is no longer taken from a report"
        places = [driver.to_read(each) for each in self.specimens] or [driver.saved_specimen()]
        model.measure(places)
        driver.wait_until_idle()
        report = model.report
        if report is None:
            return ""  # the job's problem is told as every step's is
        for name in self.path:
            file = driver.to_write(name)
            model.save(file)
            driver.wrote(file)
        if self.use is not None:
            model.use_error(self.use)
            driver.wait_until_idle()
        kinds = {"within": report.overall.intra, "between": report.overall.inter}
        told = [f"{kind} observers {found.mean_mm:.2f} mm" for kind, found in kinds.items() if found]
        return f"{report.n_labellings} labellings of {report.n_sides} sides: {', '.join(told)}"


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

    def run(self, driver: WindowDriver) -> str:  # noqa: D102
        state = driver.workspace.document.state
        sides = {side: state.side(side) for side in Side if state.side(side).placed}
        measure = driver.workspace.scan.evidence
        scan = None if measure is None else {side: measure(landmarks) for side, landmarks in sides.items()}
        atlas = driver.workspace.atlas.allowing(driver.workspace.atlas.current or Atlas.published())
        findings = check_specimen(Specimen(state.specimen, sides), atlas, scan=scan)
        doubtful = [finding for finding in findings if finding.is_problem]
        if self.path is not None:
            file, rows = driver.to_write(self.path), [finding.as_dict() for finding in findings]
            write_text(file, json.dumps(rows, indent=1) + "\n")
            driver.wrote(file)
        text = " ".join(f"{finding.side.word}: {finding.text}." for finding in doubtful)
        if doubtful and self.strict:
            raise GpError(text)
        return text or f"{len(findings)} not placed, none doubtful"
