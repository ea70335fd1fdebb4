"""Intermediate results of a long study in a small file, so that it can be stopped and resumed."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import asdict
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from gp_core.disk import read_json, write_text
from gp_core.errors import FileFormatError
from gp_core.landmarks.sets import Specimen
from gp_core.registration.jrmpc import JrmpcSettings

__all__ = ["Checkpoint", "fingerprint"]

_VERSION = 1
_DECIMALS = 6  # a nanometre: larger than rounding between files with the same points
_REMEDY = "Name another file, or delete this one to start over."


class Checkpoint:
    """Results by task, written to a file as they come in; with no file, kept in memory only.

    Parameters
    ----------
    path : path or None
        Read where it exists, and written after each new result.
    key : str
        Says what the results belong to; see `fingerprint`.

    Raises
    ------
    FileFormatError
        The file is something else, or belongs to other animals or settings.
    """

    def __init__(self, path: str | PathLike[str] | None, key: str) -> None:
        self._path, self._key = path, key
        self._results: dict[str, Any] = {}
        if path is not None and Path(path).exists():
            self._results = self._read(path)

    def _read(self, path: str | PathLike[str]) -> dict[str, Any]:
        content = read_json(path, what="checkpoint of a study", remedy=_REMEDY)
        try:
            version, key, results = content["gpCheckpoint"], content["key"], content["results"]
        except (KeyError, TypeError):
            raise FileFormatError("is not a checkpoint of a study", file=path, remedy=_REMEDY) from None
        if (version, key) != (_VERSION, self._key) or not isinstance(results, dict):
            raise FileFormatError(
                "is the checkpoint of a study of other animals, features or settings",
                file=path,
                remedy=_REMEDY,
            )
        return results

    def get(self, task: str) -> Any:
        """Return the result of a task.

        Parameters
        ----------
        task : str
            Name of the task.

        Returns
        -------
        object or None
            None where it is still to do.
        """
        return self._results.get(task)

    def put(self, task: str, result: Any) -> None:
        """Store the result of a task.

        Parameters
        ----------
        task : str
            Name of the task.
        result : object
            Plain values for JSON.
        """
        self._results[task] = result
        if self._path is not None:
            content = {"gpCheckpoint": _VERSION, "key": self._key, "results": self._results}
            write_text(self._path, json.dumps(content) + "\n")


def fingerprint(
    specimens: Sequence[Specimen], settings: JrmpcSettings | None, *choices: str | Sequence[str]
) -> str:
    """Return a short text that changes with animals, settings or choices of a study.

    Parameters
    ----------
    specimens : sequence of Specimen
        Labelled animals.
    settings : JrmpcSettings or None
        Of the registration.
    *choices : str or sequence of str
        Further choices.

    Returns
    -------
    str
        A digest.
    """
    digest = hashlib.sha256()
    numbers = None if settings is None else asdict(settings)
    digest.update(repr((numbers, [tuple(choice) for choice in choices])).encode())
    for specimen in specimens:
        for side, landmarks in sorted(specimen.sides.items()):
            digest.update(repr((specimen.name, side.value)).encode())
            rounded = np.nan_to_num(np.round(landmarks.points, _DECIMALS), nan=np.inf) + 0.0  # no -0.0
            digest.update(np.ascontiguousarray(rounded).tobytes())
    return digest.hexdigest()[:32]
