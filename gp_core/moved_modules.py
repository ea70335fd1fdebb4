"""Modules that have moved: their earlier names are still imported, with a `DeprecationWarning`."""

from __future__ import annotations

import importlib
import sys
import warnings
from collections.abc import Mapping, Sequence
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from types import ModuleType

__all__ = ["keep_importable"]


def keep_importable(moved: Mapping[str, str]) -> None:
    """Let modules be imported by the names that they had in earlier versions.

    Parameters
    ----------
    moved : mapping of str to str
        The new name of each module, by its earlier one; both dotted, from the package on.
    """
    sys.meta_path.append(_MovedModules(moved))


class _MovedModules(MetaPathFinder, Loader):
    """Finds what nobody else does, and is in the table."""

    def __init__(self, moved: Mapping[str, str]) -> None:
        self._moved = dict(moved)

    def find_spec(
        self, fullname: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Return how a moved module is loaded; None for any other."""
        return ModuleSpec(fullname, self, is_package=True) if fullname in self._moved else None

    def exec_module(self, module: ModuleType) -> None:
        """Fill a module with what its successor holds."""
        name = module.__name__
        warnings.warn(f"{name} is {self._moved[name]} now", DeprecationWarning, stacklevel=2)
        successor = importlib.import_module(self._moved[name])
        module.__dict__.update({key: value for key, value in vars(successor).items() if key[:2] != "__"})
        module.__doc__ = successor.__doc__
