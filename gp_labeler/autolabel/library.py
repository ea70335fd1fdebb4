"""A lab's labelled scans as templates, prepared once and kept; and each of them predicted from the others."""

from __future__ import annotations

import json
import logging
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from gp_core.disk import read_json, write_text
from gp_core.errors import FileFormatError, GpError
from gp_labeler.autolabel.confidence import GuessConfidence, HeldOut
from gp_labeler.autolabel.detours import detours_of
from gp_labeler.autolabel.labelled_scan import LabelledScan
from gp_labeler.autolabel.prediction import Carried, HeadNotFoundError, Prediction, predict
from gp_labeler.autolabel.registration import Registration
from gp_labeler.autolabel.scan_checksums import ScanChecksums
from gp_labeler.autolabel.settings import Settings
from gp_labeler.autolabel.template import Template
from gp_labeler.imaging.progress import Report

__all__ = ["TemplateLibrary"]

_log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class TemplateLibrary:
    """Labelled scans, and where what is prepared of them is kept.

    Parameters
    ----------
    scans : sequence of LabelledScan
        With different names.
    folder : Path, optional
        Templates, and what each carried onto the others, are kept here, and used again for as long as scan,
        landmarks and settings stay the same. None: in memory only.
    settings : Settings, optional
    most : int
        Templates to predict a head from, at most.

    Raises
    ------
    GpError
        There is no scan, or two have one name.
    """

    scans: Sequence[LabelledScan]
    folder: Path | None = None
    settings: Settings = field(default_factory=Settings)
    most: int = 5

    def __post_init__(self) -> None:
        names = [scan.name for scan in self.scans]
        if not names:
            raise GpError("no labelled scan was given")
        twice = next((name for name in names if names.count(name) > 1), None)
        if twice is not None:
            raise GpError("was given twice", specimen=twice, remedy="Leave one of them out.")
        if self.most < 1:
            raise GpError(f"the number of templates must be 1 or more, got {self.most}")

    @cached_property
    def _templates(self) -> dict[str, Template]:
        return {}

    @cached_property
    def _held_out(self) -> dict[str, Prediction | None]:
        return {}

    @cached_property
    def _read_checksums(self) -> dict[str, str]:
        return {}

    @cached_property
    def _carried(self) -> dict[tuple[str, str, str], Carried]:
        return {}

    @property
    def checksums(self) -> ScanChecksums:
        """Notes of the checksums of scans, kept in the folder."""
        return ScanChecksums(self.folder)

    def templates(self, report: Report | None = None, *, without: Sequence[str] = ()) -> list[Template]:
        """Return the templates, which are prepared where they are not yet.

        Parameters
        ----------
        report : Report, optional
        without : sequence of str
            Names of specimens that are left out.

        Raises
        ------
        GpError
            A scan cannot be read, or has no bone.
        Cancelled
            The report said so.
        """
        report = report or Report()
        wanted = [scan for scan in self.scans if scan.name not in without]
        for n, scan in enumerate(wanted):
            report(n / max(len(wanted), 1))
            self.template_of(scan, report)
        return [self._templates[scan.name] for scan in wanted]

    def template_of(self, scan: LabelledScan, report: Report | None = None) -> Template:
        """Return the template of one labelled scan, prepared where it is not yet; see `templates`."""
        if scan.name not in self._templates:
            self._templates[scan.name] = self._template(scan, report or Report())
        return self._templates[scan.name]

    def checksum_of(self, scan: LabelledScan) -> str:
        """Return the checksum of one labelled scan, which is read where that is not known yet.

        Raises
        ------
        GpError
            The scan cannot be read.
        """
        known = self._known_checksum(scan)
        return known or self._keep_checksum(replace(scan, volume=scan.load()))

    def key_of(self, scan: LabelledScan) -> str:
        """Return what the template of one labelled scan is known by; see `checksum_of`."""
        return Template.key_of(scan, self.settings, self.checksum_of(scan))

    def confidence(
        self, registration: Registration, report: Report | None = None, *, without: Sequence[str] = ()
    ) -> GuessConfidence:
        """Predict every labelled scan from the others, and return what that says of guesses.

        Parameters
        ----------
        registration : Registration
        report : Report, optional
        without : sequence of str
            Names of specimens whose labels do not count.

        Raises
        ------
        GpError, Cancelled
            As `templates`.
        """
        held_out = self.held_out(registration, report)
        counted = [scan for scan in self.scans if scan.name in held_out and scan.name not in without]
        return GuessConfidence([self._errors(scan, held_out[scan.name].without(without)) for scan in counted])

    def detours(self, prediction: Prediction) -> dict[str, float]:
        """Return how far landmarks of a scan lie from where they come by way of another labelled scan, mm.

        Nothing before the labelled scans were predicted from each other; see `held_out`, and
        `gp_labeler.autolabel.detours.detours_of`.
        """
        labels = {scan.name: scan.points for scan in self.scans}
        between = {name: found.carried for name, found in self._held_out.items() if found is not None}
        return detours_of(prediction.carried, labels, between)

    def held_out(self, registration: Registration, report: Report | None = None) -> dict[str, Prediction]:
        """Return for each labelled scan where the others expect its landmarks.

        A scan in which the head is not found is left out, and so is one without another to predict it from.
        """
        report = report or Report()
        prepare, work = report.part(0.0, 0.1), report.part(0.1, 1.0)
        self.templates(prepare)
        for n, scan in enumerate(self.scans):
            work(n / len(self.scans))
            self.held_out_of(scan, registration, work.part(n / len(self.scans), (n + 1) / len(self.scans)))
        return {name: found for name, found in self._held_out.items() if found is not None}

    def held_out_of(
        self, scan: LabelledScan, registration: Registration, report: Report | None = None
    ) -> Prediction | None:
        """Return where the others expect the landmarks of one labelled scan; None where none can say."""
        if scan.name not in self._held_out and len(self.scans) > 1:
            try:
                self._held_out[scan.name] = self._prediction(scan, registration, report or Report())
            except HeadNotFoundError as error:
                self._held_out[scan.name] = None
                _log.warning("%s: %s", scan.name, error.problem)
        return self._held_out.get(scan.name)

    def __getstate__(self) -> dict[str, Any]:
        """Let pickle leave behind what is in memory: other processes find it in the folder."""
        return {name: value for name, value in self.__dict__.items() if not name.startswith("_")}

    def _prediction(self, scan: LabelledScan, registration: Registration, report: Report) -> Prediction:
        others = self.templates(without=[scan.name])
        earlier = {other.name: self._kept(scan, other, registration) for other in others}
        kept = {name: carried for name, carried in earlier.items() if carried is not None}
        if len(kept) == len(others) <= self.most:
            return Prediction(kept, None)  # no scan is read again

        def known(template: Template) -> Carried | None:
            return self._kept(scan, template, registration)

        def keep(template: Template, carried: Carried) -> None:
            self._keep(scan, template, registration, carried)

        return predict(  # without its labels, of which one may be wrong
            scan.load(report),
            others,
            registration,
            self.settings,
            most=self.most,
            known=known,
            keep=keep,
            report=report,
        )

    def _template(self, scan: LabelledScan, report: Report) -> Template:
        checksum, loaded = self._known_checksum(scan), scan
        if checksum is None:
            loaded = replace(scan, volume=scan.load(report))
            checksum = self._keep_checksum(loaded)
        if self.folder is None:
            return Template.of(loaded, self.settings, report)
        path = self.folder / "templates" / f"{Template.key_of(scan, self.settings, checksum)}.npz"
        if path.exists():
            try:
                return replace(Template.load(path), name=scan.name)  # the file may be of a copy of the scan
            except FileFormatError:  # half written, or of an earlier version: it is made again
                pass
        template = Template.of(loaded, self.settings, report)
        try:
            template.save(path)
        except OSError as error:
            raise GpError(f"the templates cannot be kept ({error})", file=path.parent) from None
        return template

    def _known_checksum(self, scan: LabelledScan) -> str | None:
        if scan.volume is not None:
            return scan.volume.checksum
        assert scan.path is not None
        if self.folder is None:
            return self._read_checksums.get(scan.name)
        return self.checksums.known(scan.path, scan.options)

    def _keep_checksum(self, loaded: LabelledScan) -> str:
        assert loaded.volume is not None
        checksum = loaded.volume.checksum
        self._read_checksums[loaded.name] = checksum
        if loaded.path is not None:
            self.checksums.keep(loaded.path, loaded.options, checksum)
        return checksum

    def _path(self, scan: LabelledScan, template: Template, registration: Registration) -> Path | None:
        if self.folder is None:
            return None
        key = self.key_of(scan)
        return self.folder / "carried" / key / f"{template.key}-{registration.name}.json"

    def _kept(self, scan: LabelledScan, template: Template, registration: Registration) -> Carried | None:
        found = self._carried.get((scan.name, template.name, registration.name))
        path = self._path(scan, template, registration)
        if found is not None or path is None or not path.exists():
            return found
        try:
            return {str(name): np.array(xyz, dtype=np.float64) for name, xyz in read_json(path).items()}
        except (GpError, AttributeError, ValueError, OverflowError):
            return None

    def _keep(
        self, scan: LabelledScan, template: Template, registration: Registration, carried: Carried
    ) -> None:
        self._carried[scan.name, template.name, registration.name] = carried
        path = self._path(scan, template, registration)
        if path is not None:
            path.parent.mkdir(parents=True, exist_ok=True)
            write_text(path, json.dumps({name: xyz.tolist() for name, xyz in carried.items()}) + "\n")

    def _errors(self, scan: LabelledScan, prediction: Prediction) -> HeldOut:
        """Return how far a prediction of a labelled scan lies from its labels."""
        known = [name for name in prediction.names if name in scan.points]
        errors = {n: float(np.linalg.norm(prediction.centres[n] - scan.points[n])) for n in known}
        spreads = {name: prediction.spreads[name] for name in known}
        return HeldOut(scan.name, errors, spreads, self.detours(prediction))
