"""The native canvas shows the same pixels as the painted one, answers alike, and lets go of everything.

On an X server, such as Xvfb, as .ci/run has it; what chooses the canvas is tested everywhere.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from gp_core.errors import GpError
from gp_labeler.views import canvas_question, canvas_timing
from gp_labeler.views.canvas_choice import VARIABLE, CanvasChoice, CanvasTiming, canvas_for, wanted_canvas
from gp_labeler.views.canvas_question import ask_canvas
from gp_labeler.views.opengl import is_software
from gp_labeler.views.window_state import WindowState

ROOT = Path(__file__).resolve().parents[3]
on_x = pytest.mark.skipif(
    os.environ.get("QT_QPA_PLATFORM") != "xcb", reason="needs an X display, as .ci/run has one"
)
HARDWARE = "Mesa Intel(R) UHD Graphics 620 (KBL GT2)"
RADEON = "AMD Radeon RX 6600 (radeonsi, navi23, LLVM 15.0.6, DRM 3.49)"


def _trial(*arguments: str, **environment: str) -> dict:
    path = os.pathsep.join((str(ROOT), str(ROOT / "tests" / "labeler")))
    scaled = {"PYTHONPATH": path, "QT_SCALE_FACTOR_ROUNDING_POLICY": "PassThrough"}
    done = subprocess.run(
        [sys.executable, str(ROOT / "tests" / "labeler" / "views" / "canvas_pair.py"), *arguments],
        env={**os.environ, **scaled, **environment},
        capture_output=True,
        text=True,
        timeout=240,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    return json.loads(done.stdout.splitlines()[-1])


@on_x
@pytest.mark.parametrize("ratio", ["1", "1.25", "1.5", "2"])
def test_both_canvases_show_the_same_pixels_and_answer_alike(ratio: str) -> None:
    found = _trial("same", QT_SCALE_FACTOR=ratio)
    assert found["ratio"] == float(ratio)
    assert (found["grab"], found["early_grab"]) == (0, 0)
    assert found["screen"] < 50
    assert found["screen_most"] <= 1  # of 255: translucent edges of names are rounded before and after
    assert found["control"] > 1000  # the same with the overlay beneath the canvas: the comparison sees it
    assert found["picks"] == 400
    assert found["hits"] > 100
    assert found["frames_for_a_ring"] == 0
    assert found["turned"] > 1.0
    assert max(found[f"camera_off{when}"] for when in ("_before", "", "_after_keys")) < 1e-9


@on_x
def test_opened_and_closed_again_and_again_nothing_stays() -> None:
    found = _trial("cycles")
    assert found["alive"] == [0, 0, 0]
    assert len(set(found["files"][1:])) == 1
    assert found["grown_mb"] < 25
    assert found["drawn"] > 20


@on_x
@pytest.mark.parametrize("sharing", [(), ("alone",)], ids=["shared", "alone"])
def test_in_another_window_it_shows_the_same(sharing: tuple[str, ...]) -> None:
    found = _trial("moves", *sharing)
    assert found["differing"] == [0, 0, 0, 0]
    assert (found["forgotten"] > 0) is bool(sharing)
    assert found["drawn"] > 20


@on_x
def test_on_software_opengl_the_window_is_painted_without_pyvistaqt() -> None:
    code = (
        "import sys; from gp_labeler.views.application import make_window, make_application;"
        "from gp_labeler.views.canvas_choice import choose_canvas;"
        "w = make_window(None, atlas=False); w.show(); w.grab(); c = choose_canvas(w.memory);"
        "print(c.kind, '|', c.reason, '|', 'pyvistaqt' in sys.modules)"
    )
    environment = {key: value for key, value in os.environ.items() if key != VARIABLE}
    environment["LIBGL_ALWAYS_SOFTWARE"] = "1"
    done = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, timeout=120, check=True
    )
    kind, reason, imported = done.stdout.strip().split(" | ")
    assert (kind, imported) == ("painted", "False")
    assert reason.startswith("software OpenGL (llvmpipe")


@pytest.mark.parametrize(
    ("setting", "renderer", "timing", "kind", "to_measure"),
    [
        ("automatic", None, None, "painted", False),
        ("automatic", "llvmpipe (LLVM 15.0.6, 256 bits)", (90.0, 9.0), "painted", False),
        ("automatic", HARDWARE, None, "painted", True),
        ("automatic", HARDWARE, (30.0, 12.0), "native", False),
        ("automatic", HARDWARE, (12.0, 30.0), "painted", False),
        ("automatic", RADEON, (30.0, 12.0), "painted", True),  # it was measured on another
        ("painted", HARDWARE, (30.0, 12.0), "painted", False),
        ("native", HARDWARE, (12.0, 30.0), "native", False),
        ("native", "llvmpipe", None, "native", False),
        ("native", None, None, "painted", False),
    ],
)
def test_the_canvas_is_chosen_by_setting_renderer_and_timing(
    setting, renderer, timing, kind, to_measure
) -> None:
    measured = None if timing is None else CanvasTiming(HARDWARE, *timing)
    choice = canvas_for(setting, lambda: renderer, measured)
    assert (choice.kind, choice.to_measure) == (kind, to_measure)
    assert choice.reason


def test_no_renderer_is_asked_for_where_the_setting_is_painted() -> None:
    canvas_for("painted", lambda: pytest.fail("OpenGL was asked"), None)


@pytest.mark.parametrize(
    ("name", "software"),
    [
        ("llvmpipe (LLVM 15.0.6, 256 bits)", True),
        ("softpipe", True),
        ("Software Rasterizer", True),
        ("Google SwiftShader", True),
        ("Microsoft Basic Render Driver", True),
        ("GDI Generic", True),
        (HARDWARE, False),
        (RADEON, False),
        ("NVIDIA GeForce RTX 3060/PCIe/SSE2", False),
        ("Apple M2", False),
    ],
)
def test_software_is_told_by_its_name(name: str, software: bool) -> None:
    assert is_software(name) is software


def test_the_variable_overrules_the_setting_and_damage_counts_as_automatic(monkeypatch) -> None:
    memory = WindowState()
    monkeypatch.delenv(VARIABLE, raising=False)
    assert wanted_canvas(memory) == "automatic"
    memory.set(canvas="native")
    assert wanted_canvas(memory) == "native"
    monkeypatch.setenv(VARIABLE, "painted")
    assert wanted_canvas(memory) == "painted"
    monkeypatch.setenv(VARIABLE, "vulkan")
    with pytest.raises(GpError, match=r"GP_LABELER_CANVAS.* must be one of automatic, painted, native"):
        wanted_canvas(memory)
    monkeypatch.delenv(VARIABLE)
    memory.set(canvas=3)
    assert wanted_canvas(memory) == "automatic"
    assert CanvasTiming.of({"renderer": HARDWARE}) is None


def test_the_menu_sets_what_the_next_start_takes(qtbot, one_window, monkeypatch) -> None:
    monkeypatch.delenv(VARIABLE, raising=False)
    told = []
    one_window.workspace.messages.said.connect(lambda text, kind: told.append(text))
    one_window.prompts.answers = ["Native"]
    assert one_window.commands.run("view.canvas")
    assert wanted_canvas(one_window.memory) == "native"
    assert told == ["3D canvas: native from the next start"]
    one_window.prompts.answers = [""]
    ask_canvas(one_window, one_window.prompts)
    assert wanted_canvas(one_window.memory) == "native"


def test_what_was_measured_is_remembered_and_what_failed_is_told(qtbot, one_window, monkeypatch) -> None:
    told = []
    one_window.workspace.messages.said.connect(lambda text, kind: told.append((kind, text)))
    monkeypatch.setattr(canvas_question, "renderer_name", lambda: HARDWARE)
    figures = {
        "painted": "noise\n" + json.dumps({"frame_ms": 31.0}),
        "native": json.dumps({"frame_ms": 12.0}),
    }
    monkeypatch.setattr(
        canvas_timing.subprocess,
        "run",
        lambda command, env, **_: subprocess.CompletedProcess(command, 0, figures[env[VARIABLE]], ""),
    )
    canvas_question.measure(one_window)
    qtbot.waitUntil(lambda: bool(told))
    assert told[-1][1].startswith("3D canvas: painted 31 ms, native 12 ms per frame; automatic uses native")
    timing = CanvasTiming.of(one_window.memory.fields("canvas_timing"))
    assert timing == CanvasTiming(HARDWARE, 31.0, 12.0)
    assert canvas_for("automatic", lambda: HARDWARE, timing).kind == "native"
    figures["native"] = "Segmentation fault"
    canvas_question.measure(one_window)
    qtbot.waitUntil(lambda: told[-1][0] == "error")
    assert "the native canvas cannot be measured" in told[-1][1]
    assert CanvasTiming.of(one_window.memory.fields("canvas_timing")) == timing


def test_a_measurement_is_offered_once(one_window, monkeypatch) -> None:
    choice = CanvasChoice("painted", "not measured yet", to_measure=True)
    monkeypatch.setattr(canvas_question, "choose_canvas", lambda _: choice)
    monkeypatch.setattr(canvas_question, "renderer_name", lambda: HARDWARE)
    one_window.prompts.asked.clear()
    one_window.prompts.answers = ["Not now"]
    for _ in range(2):
        canvas_question.offer_measurement(one_window, one_window.prompts)
    assert one_window.prompts.asked == ["3D canvas"]
