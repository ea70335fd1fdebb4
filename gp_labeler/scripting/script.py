"""Scripts: TOML or JSON files with a list of steps, checked as a whole before the first is done."""

from __future__ import annotations

import importlib
import json
import re
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

from gp_core.disk import read_bytes
from gp_core.errors import GpError
from gp_core.extensions import Extensions
from gp_labeler.scripting.step import Step, make_step
from gp_labeler.scripting.steps import STEPS
from gp_labeler.scripting.steps.edits import EDIT_STEPS

__all__ = ["Script", "StepError", "make_script", "read_script"]

_SLOT = re.compile(r"\{specimen\}")


class StepError(GpError):
    """A step that is not one, or could not be done.

    Parameters
    ----------
    number : int
        Which, from 1.
    problem : str
        What is wrong, or what went wrong.
    """

    def __init__(
        self, number: int, problem: str, *, file: Path | None = None, remedy: str | None = None
    ) -> None:
        self.number = number
        super().__init__(f"step {number}: {problem}", file=file, remedy=remedy)


@dataclass(frozen=True)
class Script:
    """Steps to do one after the other.

    Parameters
    ----------
    name : str
        What the report calls it.
    steps : tuple of Step
        The steps.
    folder : Path
        What paths of files to read are relative to.
    tables : tuple of mapping
        The steps as they were written.
    specimens : tuple of str
        For a batch: what to put in the place of ``{specimen}``, one run each.
    file : Path, optional
        Where it was read from.
    """

    name: str
    steps: tuple[Step, ...]
    folder: Path
    tables: tuple[Mapping[str, Any], ...] = ()
    specimens: tuple[str, ...] = ()
    file: Path | None = None

    @property
    def has_slots(self) -> bool:
        """Whether ``{specimen}`` stands in it somewhere."""
        return bool(_SLOT.search(json.dumps(self.tables)))

    def for_specimen(self, name: str) -> Script:
        """Return the script with a specimen's name in every place of ``{specimen}``."""
        return make_script(_replaced(self.tables, name), name=self.name, folder=self.folder, file=self.file)


def read_script(path: str | PathLike[str], *, shown_as: str | None = None) -> Script:
    """Read a script, ``.toml`` (``[[step]]`` tables) or ``.json`` (a list, or ``{"step": [...]}``).

    Parameters
    ----------
    path : path-like
        The file.
    shown_as : str, optional
        What messages call it; by default its path.

    Raises
    ------
    GpError
        It cannot be read.
    StepError
        One of its steps is not one.
    """
    file = Path(path if shown_as is None else shown_as)
    try:
        text = read_bytes(path, what="script").decode()
    except UnicodeDecodeError:
        raise GpError("is not a text file", file=file, remedy="Scripts are TOML or JSON.") from None
    content = _parsed(text, Path(path), file)
    if isinstance(content, list):
        content = {"step": content}
    if not isinstance(content, dict) or not isinstance(content.get("step"), list):
        raise GpError(
            "holds no steps", file=file, remedy='Begin each with [[step]], in JSON use {"step": [...]}.'
        )
    for key in content.keys() - {"step", "specimens"}:
        raise GpError(f"unknown key {key!r}", file=file, remedy="There are step and specimens.")
    names = content.get("specimens", [])
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        raise GpError(f"specimens must be a list of texts, got {names!r:.60}", file=file)
    return make_script(
        content["step"], name=file.stem, folder=Path(path).absolute().parent, specimens=names, file=file
    )


def make_script(
    tables: Sequence[Any],
    *,
    name: str = "script",
    folder: Path | None = None,
    specimens: Sequence[str] = (),
    file: Path | None = None,
) -> Script:
    """Make a script of tables, such as ``{"do": "open", "phantom": 0}``.

    Raises
    ------
    StepError
        One of them is not a step.
    """
    steps = []
    for number, table in enumerate(tables, start=1):
        try:
            steps.append(make_step(_kinds(table), table))
        except GpError as error:
            raise StepError(number, error.problem, file=file, remedy=error.remedy) from None
    return Script(name, tuple(steps), folder or Path.cwd(), tuple(tables), tuple(specimens), file)


_ADDED: Extensions[type[Step]] = Extensions("gp_labeler.steps", {**STEPS, **EDIT_STEPS})


def _kinds(table: Any) -> Mapping[str, type[Step]]:
    """Return the steps that are built in; where a table asks for another, those of installed packages too."""
    does = table.get("do") if isinstance(table, Mapping) else None
    if not isinstance(does, str) or does in _ADDED.builtin:
        return _ADDED.builtin
    added = {name: kind for name, kind in _ADDED.added.items() if _is_step(kind)}
    return {**_ADDED.builtin, **added}


def _is_step(kind: object) -> bool:
    return isinstance(kind, type) and issubclass(kind, Step)


def _parsed(text: str, path: Path, file: Path) -> Any:
    try:
        if path.suffix.lower() == ".json":
            return json.loads(text)
        toml = importlib.import_module("tomllib" if sys.version_info >= (3, 11) else "tomli")
        return toml.loads(text)
    except ImportError:
        raise GpError("TOML needs tomli on Python 3.10", file=file, remedy="Run pip install tomli.") from None
    except (ValueError, RecursionError) as error:
        kind = "JSON" if path.suffix.lower() == ".json" else "TOML"
        raise GpError(f"is not {kind}: {error}", file=file) from None


def _replaced(value: Any, name: str) -> Any:
    if isinstance(value, str):
        return _SLOT.sub(lambda _: name, value)
    if isinstance(value, Mapping):
        return {key: _replaced(each, name) for key, each in value.items()}
    if isinstance(value, (list, tuple)):
        return [_replaced(each, name) for each in value]
    return value
