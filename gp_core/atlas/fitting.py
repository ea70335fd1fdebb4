"""Fit an atlas to labelled specimens, without the labels that are known to be wrong."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from gp_core.argument_types import checks_arguments
from gp_core.atlas.atlas import Atlas
from gp_core.atlas.certainty_weights import checked_weights
from gp_core.atlas.plain_fit import fit_plain_atlas, fit_weighted_atlas
from gp_core.atlas.screening import Screened, screen_labels
from gp_core.landmarks.sets import Specimen

__all__ = ["fit_atlas", "fit_screened_atlas"]


@checks_arguments
def fit_atlas(
    specimens: Sequence[Specimen],
    *,
    features: Iterable[str] | None = None,
    name: str | None = None,
    keep_doubtful: bool = False,
    certainty_weights: Mapping[str, float] | bool | None = None,
) -> Atlas:
    """Fit an atlas to labelled specimens; both sides are pooled by mirroring.

    Labels that `gp_core.atlas.screening.screen_labels` rejects are left out, and their animals get little
    weight. Where no label is rejected, the result equals `fit_plain_atlas` to the last bit.

    Parameters
    ----------
    specimens : sequence of Specimen
        One or both sides of each; some features may be missing.
    features : iterable of str, optional
        What the atlas holds; by default every placed feature that at least two sides have.
    name : str, optional
        By default tells the number of specimens.
    keep_doubtful : bool
        Use all labels: `fit_plain_atlas`.
    certainty_weights : mapping of str to float, or bool, optional
        Weight of a label by its certainty, such as ``{"guess": 0.1}``; True for
        `gp_core.atlas.certainty_weights.CERTAINTY_WEIGHTS`. By default all labels count alike.

    Returns
    -------
    Atlas
        The fitted atlas.

    Raises
    ------
    GpError
        As for `fit_plain_atlas`, applied to the remaining labels.
    """
    by_certainty = checked_weights(certainty_weights)
    if keep_doubtful:
        return fit_plain_atlas(specimens, features=features, name=name, by_certainty=by_certainty)
    screened = screen_labels(specimens)
    return fit_screened_atlas(screened, features=features, name=name, by_certainty=by_certainty)


def fit_screened_atlas(
    screened: Screened,
    *,
    features: Iterable[str] | None = None,
    name: str | None = None,
    by_certainty: Mapping[str, float] | None = None,
) -> Atlas:
    """Fit an atlas to screened labels, each animal with its weight; see `fit_atlas`.

    Parameters
    ----------
    screened : Screened
        What `gp_core.atlas.screening.screen_labels` returned.
    features : iterable of str, optional
        As for `fit_atlas`.
    name : str, optional
        As for `fit_atlas`.
    by_certainty : mapping of str to float, optional
        Weight of a label by its certainty.

    Returns
    -------
    Atlas
        The fitted atlas.
    """
    return fit_weighted_atlas(screened.specimens, screened.weights, features, name, by_certainty)
