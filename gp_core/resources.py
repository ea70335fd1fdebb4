"""Where the shipped data files are: inside the installed wheel, or at the top of a checkout."""

from __future__ import annotations

from pathlib import Path

__all__ = ["resource_path"]

_PACKAGE = Path(__file__).resolve().parent


def resource_path(name: str) -> Path:
    """Return the path of a shipped data file.

    Parameters
    ----------
    name : str
        Such as ``"features.json"``.

    Returns
    -------
    pathlib.Path
        Where it is.

    Raises
    ------
    FileNotFoundError
        The installation lacks the file.
    """
    for root in (_PACKAGE / "resources", _PACKAGE.parent / "resources"):
        if (root / name).is_file():
            return root / name
    raise FileNotFoundError(f"resource {name!r} is missing from the installation; reinstall gp-labeler")
