"""One head of a folder run: read, guess, write; done once, wherever it runs."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from gp_core.disk import all_or_none, read_json, write_text
from gp_core.errors import GpError
from gp_core.validation import FloatArray
from gp_labeler.autolabel.library import TemplateLibrary
from gp_labeler.autolabel.proposal import Proposal
from gp_labeler.autolabel.propose import Stored, propose
from gp_labeler.autolabel.registration_process import HereRegistration
from gp_labeler.autolabel.suggestion_files import write_proposal
from gp_labeler.imaging.readers.formats import volume_stem
from gp_labeler.imaging.volume import Volume

__all__ = ["HeadResult", "HeadRun", "PrepareRun"]

_SCHEMA = "gp-labeler proposal"


@dataclass(frozen=True)
class HeadResult:
    """What became of one head.

    Parameters
    ----------
    path : Path
        The scan.
    files : tuple of Path
        What was written.
    proposal : dict
        As JSON values; empty where it failed.
    problem : str
        Why there are no suggestions; empty where there are.
    is_earlier : bool
        Whether an earlier run had done it.
    """

    path: Path
    files: tuple[Path, ...] = ()
    proposal: Mapping[str, Any] = field(default_factory=dict)
    problem: str = ""
    is_earlier: bool = False


@dataclass(frozen=True)
class PrepareRun:
    """Prepares one labelled scan, or predicts it from the others; can be pickled.

    Parameters
    ----------
    library : TemplateLibrary
        With a folder, which is how what is made gets back.
    engine : {"greedy", "demons"}
    held_out : bool
        Predict it from the others; else prepare its template.
    """

    library: TemplateLibrary
    engine: str
    held_out: bool

    def __call__(self, name: str) -> str:
        """Do it for the labelled scan of one name, and return the name."""
        scan = next(scan for scan in self.library.scans if scan.name == name)
        if self.held_out:
            self.library.held_out_of(scan, HereRegistration(self.engine))
        else:
            self.library.template_of(scan)
        return name


@dataclass(frozen=True)
class HeadRun:
    """Proposes the first labels of heads and writes them; can be pickled.

    Parameters
    ----------
    library : TemplateLibrary
    output : Path
        Folder for what is written.
    engine : {"greedy", "demons"}
    stored : {"as it is", "mirrored"}, optional
        See `propose`.
    placed : mapping of str to (3,) array, optional
        See `propose`.
    options : mapping
        How the scans are read.
    again : bool
        Do it again where an earlier run has done it.
    """

    library: TemplateLibrary
    output: Path
    engine: str
    stored: Stored | None = None
    placed: Mapping[str, FloatArray] = field(default_factory=dict)
    options: Mapping[str, Any] = field(default_factory=dict)
    again: bool = False

    def __call__(self, path: Path) -> HeadResult:
        """Propose the first labels of one scan; what goes wrong with it is in the result."""
        name = volume_stem(path)
        report = self.output / f"{name}.proposal.json"
        try:
            checksum, volume = self.library.checksums.known(path, self.options), None
            if checksum is None:
                volume = self._read(path)
                checksum = volume.checksum
            key = self._key(checksum)
            earlier = None if self.again else _earlier(report, key)
            if earlier is not None:
                return HeadResult(path, (report,), earlier, is_earlier=True)
            volume = volume or self._read(path)
            proposal = propose(
                volume,
                self.library,
                placed=self.placed,
                stored=self.stored,
                registration=HereRegistration(self.engine),
            )
            about = {
                "name": path.name,
                "size": list(volume.size),
                "spacing": list(volume.spacing),
                "checksum": volume.checksum,
            }
            content = self._content(name, key, proposal)
            with all_or_none():
                files = write_proposal(self.output, name, proposal, about)
                write_text(report, json.dumps(content, indent=1) + "\n")
        except GpError as error:
            return HeadResult(path, problem=str(error))
        return HeadResult(path, (*files, report), content)

    def _content(self, name: str, key: str, proposal: Proposal) -> dict[str, Any]:
        return {"schema": _SCHEMA, "version": 1, "specimen": name, "key": key, **proposal.as_json()}

    def _read(self, path: Path) -> Volume:
        from gp_labeler.imaging.readers import read_volume  # here: not all heads are read

        volume = read_volume(path, **self.options)
        self.library.checksums.keep(path, self.options, volume.checksum)
        return volume

    def _key(self, checksum: str) -> str:
        """Return what changes with all that the suggestions of a scan depend on."""
        labelled = [(each.name, self.library.key_of(each)) for each in self.library.scans]
        points = {name: np.round(xyz, 6).tolist() for name, xyz in self.placed.items()}
        told = (
            checksum,
            labelled,
            self.library.most,
            self.engine,
            self.stored,
            points,
        )
        return hashlib.blake2b(repr(told).encode(), digest_size=16).hexdigest()


def _earlier(report: Path, key: str) -> dict[str, Any] | None:
    """Return what an earlier run wrote of the same scan, labels and settings."""
    if not report.exists():
        return None
    try:
        content = read_json(report)
    except GpError:
        return None
    is_same = isinstance(content, dict) and (content.get("schema"), content.get("key")) == (_SCHEMA, key)
    return content if is_same else None
