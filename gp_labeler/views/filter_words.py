"""That a slice view shows a slab, or less noise than the scan has: in words, the longest first."""

from __future__ import annotations

from gp_labeler.models.view import ViewState

__all__ = ["filter_hint", "filter_words"]

_SHORT = {"maximum": "max", "minimum": "min", "mean": "mean"}


def filter_words(state: ViewState, slab_mm: float) -> tuple[str, ...]:
    """Return what the header says, in fewer and fewer words; empty where single slices are shown as they are.

    Parameters
    ----------
    state : ViewState
        With slab and denoising.
    slab_mm : float
        How thick the slab really is, mm.
    """
    mode = "" if state.slab is None else _SHORT[state.slab.mode]
    ways = [
        [part for part in (slab, noise) if part]
        for slab, noise in (
            (mode and f"{mode} {slab_mm:.2f} mm", state.denoise),
            (mode and f"{mode} {slab_mm:.1f}", state.denoise),
            (mode, state.denoise),
        )
    ]
    return (*(" \N{MIDDLE DOT} ".join(parts) for parts in ways), "filtered", "!") if ways[0] else ()


def filter_hint(state: ViewState, slab_mm: float) -> str:
    """Return the sentences of the tool tip; empty where single slices are shown as they are."""
    said = []
    if state.slab is not None:
        said.append(f"Shows the {state.slab.mode} over {slab_mm:.2f} mm.")
    if state.denoise is not None:
        said.append(f"Denoised ({state.denoise}).")
    if said:
        said.append("Display only: values, bone edge and positions are those of the single slice.")
    return " ".join(said)
