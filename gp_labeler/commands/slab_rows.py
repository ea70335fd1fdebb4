"""The rows of the menu View about thick slabs and less noise: display only."""

from __future__ import annotations

from collections.abc import Iterator

from gp_labeler.commands.action import Action, Run, Test
from gp_labeler.commands.conditions import has_scan
from gp_labeler.imaging.slab import DENOISERS, SLAB_MODES, THICKEST_MM, THINNEST_MM, Slab
from gp_labeler.models.workspace import Workspace

__all__ = ["slab_rows"]

_FIRST_MM, _FACTOR = 0.5, 2.0**0.5
_WORDS = {"mean": "Mean", "maximum": "Maximum", "minimum": "Minimum"}
_DENOISE = {"median": "median", "gaussian": "Gaussian", "bilateral": "bilateral (keeps edges)"}
_KEYS = {"mean": "Shift+T", "median": "Shift+G"}


def _has_slab(workspace: Workspace) -> bool:
    return workspace.view.state.slab is not None


def _is_slab(mode: str) -> Test:
    return lambda workspace: _has_slab(workspace) and workspace.view.state.slab == Slab(mode, _mm(workspace))


def _mm(workspace: Workspace) -> float:
    slab = workspace.view.state.slab
    return _FIRST_MM if slab is None else slab.mm


def _toggle_slab(mode: str) -> Run:
    def change(workspace: Workspace) -> None:
        is_on = _is_slab(mode)(workspace)
        workspace.view.update(slab=None if is_on else Slab(mode, _mm(workspace)))

    return change


def _thicken(factor: float) -> Run:
    def change(workspace: Workspace) -> None:
        slab = workspace.view.state.slab
        if slab is not None:
            mm = min(max(slab.mm * factor, THINNEST_MM), THICKEST_MM)
            workspace.view.update(slab=Slab(slab.mode, round(mm, 2)))

    return change


def _is_denoised(kind: str) -> Test:
    return lambda workspace: workspace.view.state.denoise == kind


def _toggle_denoise(kind: str) -> Run:
    def change(workspace: Workspace) -> None:
        workspace.view.update(denoise=None if _is_denoised(kind)(workspace) else kind)

    return change


# fmt: off
def slab_rows() -> Iterator[Action]:
    """Return the commands that change what of the scan a slice view shows."""
    def row(id: str, title: str, keys: tuple[str, ...], run: Run | None, enabled: Test = has_scan, *,
            checked: Test | None = None, hint: str = "") -> Action:
        return Action(f"view.{id}", "View", title, keys, run, enabled, checked, hint, "slab")

    for mode in SLAB_MODES:
        keys = (_KEYS[mode],) if mode in _KEYS else ()
        yield row(f"slab_{mode}", f"Thick slab: {_WORDS[mode].lower()}", keys, _toggle_slab(mode),
                  checked=_is_slab(mode), hint=f"{_WORDS[mode]} of grey values across the slab; display only")
    yield row("slab_thicker", "Slab: thicker", ("Alt+]",), _thicken(_FACTOR), _has_slab)
    yield row("slab_thinner", "Slab: thinner", ("Alt+[",), _thicken(1 / _FACTOR), _has_slab)
    for kind in DENOISERS:
        keys = (_KEYS[kind],) if kind in _KEYS else ()
        yield row(f"denoise_{kind}", f"Denoise: {_DENOISE[kind]}", keys, _toggle_denoise(kind),
                  checked=_is_denoised(kind), hint="In the plane of the slice; display only")
# fmt: on
