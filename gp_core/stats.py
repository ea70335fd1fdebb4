"""Quantiles of the chi-squared distribution, without importing SciPy, which would delay short commands."""

from __future__ import annotations

__all__ = ["NORMAL_95", "chi_square_share"]

NORMAL_95 = 1.6448536269514722
"""Quantile of the standard normal distribution that 95 % are below."""


def chi_square_share(freedom: float, normal: float) -> float:
    """Return a quantile of the chi-squared distribution, divided by its degrees of freedom.

    Parameters
    ----------
    freedom : float
        Degrees of freedom.
    normal : float
        The same quantile of the standard normal distribution.

    Returns
    -------
    float
        The Wilson-Hilferty approximation.

    References
    ----------
    Wilson and Hilferty, "The distribution of chi-square", PNAS 17(12), 1931.
    https://doi.org/10.1073/pnas.17.12.684
    """
    spread = 2 / (9 * freedom)
    return float((1 - spread + normal * spread**0.5) ** 3)
