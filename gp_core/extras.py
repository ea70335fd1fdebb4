"""The optional packages of an installation, and the one line that names the extra that brings them."""

from __future__ import annotations

from importlib.util import find_spec

from gp_core.errors import GpError

__all__ = ["EXTRAS", "missing_package", "need_extra"]

EXTRAS = {"figures": "matplotlib", "jrmpc": "numba", "cluster": "distributed", "completion": "shtab"}
"""The package that each extra of the distribution brings to `gp_core`."""


def missing_package(package: str) -> GpError:
    """Return the error for a package that is not installed.

    Parameters
    ----------
    package : str
        Its name in imports, such as ``"matplotlib"``.

    Returns
    -------
    GpError
        It names the extra that brings the package.
    """
    extra = next((extra for extra, brought in EXTRAS.items() if brought == package), None)
    name = "gp-labeler" if extra is None else f"gp-labeler[{extra}]"
    return GpError(f"the package {package} is not installed", remedy=f'Run pip install "{name}"')


def need_extra(extra: str) -> None:
    """Make sure that the package of an extra is installed, without importing it.

    Parameters
    ----------
    extra : str
        A key of `EXTRAS`.

    Raises
    ------
    GpError
        It is not installed.
    """
    if find_spec(EXTRAS[extra]) is None:
        raise missing_package(EXTRAS[extra])
