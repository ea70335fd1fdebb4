"""What installed packages add: the same doors that what is built in uses (Python's entry points).

A package names a group and an object in its metadata; `Extensions` finds it by name. One that cannot be
imported, or that has the name of something built in, is named once as a warning and left out.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator, Mapping
from functools import cached_property
from importlib.metadata import EntryPoint, entry_points
from typing import Generic, TypeVar

from gp_core.errors import GpError

__all__ = ["Extensions", "added_names"]

_log = logging.getLogger(__name__)

Thing = TypeVar("Thing")


def added_names(group: str) -> tuple[str, ...]:
    """Return the names that installed packages add to a group, without importing them.

    Parameters
    ----------
    group : str
        Group of entry points.

    Returns
    -------
    tuple of str
        Names.
    """
    return tuple(entry.name for entry in entry_points(group=group))


class Extensions(Generic[Thing]):
    """Things of one kind by name: those that are built in, and those of installed packages.

    Parameters
    ----------
    group : str
        Group of entry points, such as ``"gp_labeler.estimators"``.
    builtin : mapping of str to object
        What is built in.
    """

    def __init__(self, group: str, builtin: Mapping[str, Thing]) -> None:
        self._group = group
        self.left_out: list[str] = []
        """What was left out of `added`, and why, once that was looked at."""
        self.builtin: Mapping[str, Thing] = builtin

    def names(self) -> tuple[str, ...]:
        """Return all names, those built in first.

        Returns
        -------
        tuple of str
            Names that `get` knows.
        """
        return (*self.builtin, *self.added)

    def get(self, name: str) -> Thing:
        """Return a thing by its name.

        Parameters
        ----------
        name : str
            One of `names`.

        Returns
        -------
        object
            What is built in, without a look at installed packages; or what a package adds.
        """
        return self.builtin[name] if name in self.builtin else self.added[name]

    def is_added(self, name: str) -> bool:
        """Return whether a name is one that an installed package adds.

        Parameters
        ----------
        name : str
            Any name.

        Returns
        -------
        bool
            False for what is built in.
        """
        return name not in self.builtin and name in self.added

    @cached_property
    def added(self) -> Mapping[str, Thing]:
        """What installed packages add, by name; they are imported at the first look."""
        return dict(self._loaded())

    def _loaded(self) -> Iterator[tuple[str, Thing]]:
        for entry in sorted(entry_points(group=self._group), key=lambda entry: entry.name):
            if entry.name in self.builtin:
                self._leave_out(entry, f"{entry.name} is built in")
                continue
            try:
                yield entry.name, entry.load()
            except Exception as error:  # whatever a package does when it is imported
                self._leave_out(entry, f"{type(error).__name__}: {error}")

    def _leave_out(self, entry: EntryPoint, reason: str) -> None:
        text = f"{self.described(entry.name, entry)} is left out: {reason}"
        self.left_out.append(text)
        _log.warning("%s", text)

    def described(self, name: str, entry: EntryPoint | None = None) -> str:
        """Return an extension in words, with the package that it is of.

        Parameters
        ----------
        name : str
            Its name.
        entry : EntryPoint, optional
            Where it is known already.

        Returns
        -------
        str
            Such as ``"the estimator 'mean' of the package gp-labeler-example"``.
        """
        found = entry or next((e for e in entry_points(group=self._group) if e.name == name), None)
        package = found.dist.name if found is not None and found.dist is not None else "unknown"
        kind = self._group.rpartition(".")[2].rstrip("s").replace("_", " ")
        return f"the {kind} {name!r} of the package {package}"

    def failure(self, name: str, error: Exception) -> GpError:
        """Return the error for an extension that failed while it ran.

        Parameters
        ----------
        name : str
            Its name.
        error : Exception
            What it raised.

        Returns
        -------
        GpError
            The extension's own error where it raised one, or one that names the extension.
        """
        if isinstance(error, GpError):
            return error
        return GpError(
            f"{self.described(name)} failed ({type(error).__name__}: {error})",
            remedy="Report this to its authors, or uninstall it.",
        )
