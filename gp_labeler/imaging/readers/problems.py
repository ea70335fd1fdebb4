"""What can be wrong with a scan on disk, said so that a person can mend it."""

from __future__ import annotations

import logging
import warnings
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Literal

from gp_core.errors import GpError
from gp_labeler.imaging.progress import Cancelled

__all__ = ["Problem", "VolumeError", "failing_as_volume_error", "names", "quiet", "warning"]

Resolution = Literal["spacing", "series", "accept"]


@dataclass(frozen=True)
class Problem:
    """One thing found while looking into a file.

    Parameters
    ----------
    code : str
        Short name, e.g. ``"spacing-missing"``; what `accept` takes.
    text : str
        What is wrong, naming files and numbers.
    severity : str
        ``"error"`` must be resolved before anything loads, ``"warning"`` is shown.
    remedy : str
        What to do about it.
    resolved_by : tuple of str
        Which import options can resolve it: ``"spacing"``, ``"series"``, ``"accept"``; empty: none can.
    """

    code: str
    text: str
    severity: Literal["error", "warning"] = "error"
    remedy: str = ""
    resolved_by: tuple[Resolution, ...] = ()


def warning(code: str, text: str) -> Problem:
    """Make a problem that is shown and stops nothing."""
    return Problem(code, text, "warning")


class VolumeError(GpError):
    """A scan cannot be read as it stands.

    Parameters
    ----------
    problem : str
        What is wrong.
    problems : iterable of Problem
        The findings that stand against it, if it was looked into.
    **where
        See `GpError`.
    """

    def __init__(self, problem: str, *, problems: Iterable[Problem] = (), **where: str | Path | None) -> None:
        super().__init__(problem, **where)  # type: ignore[arg-type]
        self.problems = tuple(problems)

    @classmethod
    def of(cls, problems: Sequence[Problem], file: str | PathLike[str]) -> VolumeError:
        """Make one error of several problems, each before its remedy; a remedy of several comes once."""
        told: dict[str, list[str]] = {}
        for problem in problems:
            own = problem.text.rstrip(".").removeprefix(f"{Path(file).name} ")  # the error names it already
            told.setdefault(problem.remedy, []).append(own)
        texts = ["; ".join(each) for each in told.values()]
        texts[1:] = [text[:1].upper() + text[1:] for text in texts[1:]]
        *earlier, (last, remedy) = zip(texts, told, strict=True)
        said = " ".join([*(f"{text}. {way}".strip() for text, way in earlier), last])
        return cls(said, problems=problems, file=Path(file), remedy=remedy or None)


def names(files: Iterable[Path | str], most: int = 4) -> str:
    """Return ``"a.tif, b.tif, c.tif, d.tif and 12 more"``."""
    shown = [file if isinstance(file, str) else file.name for file in files]
    more = f" and {len(shown) - most} more" if len(shown) > most else ""
    return ", ".join(shown[:most]) + more


@contextmanager
def failing_as_volume_error(path: Path) -> Iterator[None]:
    """Turn whatever a library raises on a broken file into `VolumeError`."""
    try:
        yield
    except Cancelled:
        raise
    except GpError as problem:
        if problem.file is not None:
            raise
        raise VolumeError(problem.problem, file=path, remedy=problem.remedy) from None
    except MemoryError:
        raise VolumeError(
            "there is not enough memory to load it",
            file=path,
            remedy="Load every second voxel, or a region.",
        ) from None
    except (
        Exception
    ) as problem:  # parsers of broken files raise anything: struct.error, SyntaxError, KeyError
        broken = isinstance(problem, LookupError)  # its text is a mere number or name
        text = ["its structure is broken"] if broken else str(problem).strip().splitlines()
        raise VolumeError(
            f"it cannot be read: {text[-1] if text else type(problem).__name__}",
            file=path,
            remedy="It may be damaged: copy it again, or open it in the program that wrote it.",
        ) from problem


@contextmanager
def quiet() -> Iterator[None]:
    """Keep the reading libraries from writing to stderr: what matters comes out as a problem or a note."""
    handler = logging.NullHandler()
    loggers = [logging.getLogger(name) for name in ("tifffile", "pydicom", "PIL")]
    for logger in loggers:
        logger.addHandler(handler)  # else their words reach stderr where nobody set logging up
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        for logger in loggers:
            logger.removeHandler(handler)
