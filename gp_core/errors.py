"""What a user can cause, said in one line: what is wrong, in which file and landmark, and what to do."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from os import PathLike, fspath

from gp_core.terminal import printable

__all__ = ["FeatureError", "FileFormatError", "FrameError", "GeometryError", "GpError", "blaming"]


class GpError(Exception):
    """Base of every error that a user can cause and mend.

    Parameters
    ----------
    problem : str
        What is wrong, with what was got and what is allowed.
    file : path, optional
        The file it is in.
    specimen, landmark : str, optional
        Whose and which.
    remedy : str, optional
        What to do about it.
    """

    def __init__(
        self,
        problem: str,
        *,
        file: str | PathLike[str] | None = None,
        specimen: str | None = None,
        landmark: str | None = None,
        remedy: str | None = None,
    ) -> None:
        self.problem = problem
        self.file = None if file is None else fspath(file)
        self.specimen = specimen
        self.landmark = landmark
        self.remedy = remedy
        super().__init__(self._one_line())

    def _one_line(self) -> str:
        specimen = self.specimen and f"specimen {self.specimen}"
        landmark = self.landmark and f"landmark {self.landmark}"
        where = ", ".join(part for part in (self.file, specimen, landmark) if part)
        text = f"{where}: {self.problem}" if where else self.problem
        if self.remedy:
            text = f"{text.rstrip('.')}. {self.remedy}"
        return printable(" ".join(text.split()))


class FileFormatError(GpError):
    """A file cannot be read as what it should be."""


class FeatureError(GpError):
    """A feature code is unknown, duplicated, missing, or unsuitable for its use."""


class GeometryError(GpError):
    """Points do not determine the requested result (too few, collinear, not finite, implausible size)."""


class AlreadyExistsError(GpError):
    """A file would be replaced, which was not asked for."""


class FrameError(GpError):
    """Coordinates of different frames are combined."""


@contextmanager
def blaming(file: str | PathLike[str]) -> Iterator[None]:
    """Add a file to errors that name neither a file nor a specimen.

    Parameters
    ----------
    file : path-like
        The file that is being processed.

    Yields
    ------
    None
        While the file is processed.

    Raises
    ------
    GpError
        The same error, with the file.
    """
    try:
        yield
    except GpError as error:
        if error.file or error.specimen:
            raise
        raise type(error)(error.problem, file=file, landmark=error.landmark, remedy=error.remedy) from None
