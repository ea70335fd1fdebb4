"""Asking which 3D canvas to use, and measuring both; what is chosen holds from the next start."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gp_labeler.views.canvas_choice import SETTINGS, VARIABLE, CanvasTiming, choose_canvas, wanted_canvas
from gp_labeler.views.canvas_timing import MeasureCanvases
from gp_labeler.views.opengl import renderer_name
from gp_labeler.views.prompts import Prompts

if TYPE_CHECKING:
    from gp_labeler.views.main_window import MainWindow

__all__ = ["ask_canvas", "offer_measurement"]

_TITLE = "3D canvas"
_MEASURE = "Measure"


def ask_canvas(window: MainWindow, prompts: Prompts) -> None:
    """Ask for the setting, and say which canvas is in use and why."""
    used, setting = choose_canvas(window.memory), wanted_canvas(window.memory)
    answer = prompts.choose(
        _TITLE,
        f"The 3D view uses the {used.kind} canvas: {used.reason}. The setting is {setting}.",
        [*(name.capitalize() for name in SETTINGS), _MEASURE],
        detail=(
            "Painted works everywhere. Native draws with the graphics card. Automatic uses the one that was "
            "measured to be faster on this computer. A new setting takes effect at the next start; "
            f"the variable {VARIABLE} overrides it."
        ),
    )
    if answer == _MEASURE:
        measure(window)
    elif answer:
        window.memory.set(canvas=answer.lower())
        window.memory.save()
        window.workspace.say(f"3D canvas: {answer.lower()} from the next start")


def offer_measurement(window: MainWindow, prompts: Prompts) -> None:
    """Offer once to measure, where only a measurement can tell which canvas is faster."""
    if not choose_canvas(window.memory).to_measure or window.memory.get("canvas_offered", bool, False):
        return
    window.memory.set(canvas_offered=True)
    window.memory.save()
    answer = prompts.choose(
        _TITLE,
        f"This computer has a graphics card ({renderer_name()}). Measure whether it speeds up the 3D view?",
        [_MEASURE, "Not now"],
        detail="It takes about half a minute and shows two windows. View > 3D canvas does it later, too.",
    )
    if answer == _MEASURE:
        measure(window)


def measure(window: MainWindow) -> None:
    """Measure both canvases in the background, and remember the figures."""
    name = renderer_name()
    if name is None:
        window.workspace.say("There is no OpenGL on this display: the 3D view is painted", "warning")
        return
    window.workspace.jobs.submit(
        MeasureCanvases(name), lambda timing: _take(window, timing), key="measure canvas"
    )


def _take(window: MainWindow, timing: CanvasTiming) -> None:
    window.memory.set(canvas_timing=vars(timing))
    window.memory.save()
    faster = "native" if timing.native_ms < timing.painted_ms else "painted"
    window.workspace.say(
        f"3D canvas: painted {timing.painted_ms:.0f} ms, native {timing.native_ms:.0f} ms per frame; "
        f"automatic uses {faster} from the next start"
    )
