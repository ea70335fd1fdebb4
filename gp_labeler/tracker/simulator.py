"""What ``gp-labeler simulate-tracker`` does: it serves a simulated tracker until it is told to quit."""

from __future__ import annotations

import argparse
import json
import logging
import math
import signal
import sys
import threading
from queue import SimpleQueue

import numpy as np

from gp_core.atlas.atlas import Atlas
from gp_core.atlas.sampling import draw_animal
from gp_core.disk import protected_inputs, read_bytes, write_text
from gp_core.errors import GpError
from gp_core.frames import RigidTransform
from gp_core.io import read_touches
from gp_core.landmarks.features import EXTERNAL, PROBE, Side
from gp_core.standard_streams import STANDARD
from gp_core.validation import FloatArray
from gp_labeler.tracker.address import check_device
from gp_labeler.tracker.rigid import rotation_of
from gp_labeler.tracker.simulated_probe import SimulatedProbe
from gp_labeler.tracker.simulated_tracker import Simulator

__all__ = ["serve", "simulate"]


def simulate(args: argparse.Namespace) -> int:
    """Serve until told to quit.

    Parameters
    ----------
    args : argparse.Namespace
        The options of ``gp-labeler simulate-tracker``.

    Returns
    -------
    int
        0.

    Raises
    ------
    GpError
        A file or an option is wrong.
    OSError
        The port is taken.
    """
    logging.getLogger("pyigtl").setLevel(logging.ERROR)
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGINT, signal.default_int_handler)  # it ends in good order
    points, truth = _points(args)
    simulator = _simulator(args, points)
    told = json.dumps({**truth, "port": simulator.port}, indent=2)
    if str(args.truth) == STANDARD:
        _say(told)
    elif args.truth is not None:
        with protected_inputs(file for file in (args.touches, args.script) if file is not None):
            write_text(args.truth, told)
    _say(f"listening on 127.0.0.1:{simulator.port}")
    return serve(simulator, args, list(points))


def serve(simulator: Simulator, args: argparse.Namespace, names: list[str]) -> int:
    """Serve until the end is asked for, and return the status of the program."""
    commands: SimpleQueue[str | None] = SimpleQueue()
    loop: list[str] = []
    if args.live:
        threading.Thread(target=_listen, args=(commands,), daemon=True).start()
    elif args.script is not None:
        loop = read_bytes(args.script, what="script").decode(errors="replace").splitlines()
    else:
        loop = [step for name in names for step in (f"go {name} 1.2", "wait 1.5", "lift 30 0.6")]
    try:
        simulator.run(commands, loop=loop)
    except KeyboardInterrupt:
        pass
    finally:
        simulator.close()
    return 0


def _listen(commands: SimpleQueue[str | None]) -> None:
    for line in sys.stdin:
        commands.put(line)
    commands.put(None)


def _say(line: str) -> None:
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


def _simulator(args: argparse.Namespace, points: dict[str, FloatArray]) -> Simulator:
    names = {"probe": args.probe, "button": args.button}
    if args.reference is not None:
        names["reference"] = args.reference
    for what, name in names.items():
        check_device(name, f"the {what}")
    if len(set(names.values())) != len(names):
        raise GpError("probe, reference and button must have different names")
    if not 1 <= args.rate <= 1000:
        raise GpError(f"--rate must be from 1 to 1000, got {args.rate:g}")
    if not 0 <= args.port <= 65535:
        raise GpError(f"--port must be from 0 to 65535, got {args.port}")
    for name in ("noise", "noise_deg", "sway"):
        if not 0 <= getattr(args, name) < math.inf:
            raise GpError(f"--{name.replace('_', '-')} must be 0 or more, got {getattr(args, name):g}")
    probe = SimulatedProbe(
        points,
        args.tip,
        noise_mm=args.noise,
        noise_deg=args.noise_deg,
        sway_mm=args.sway,
        reference=args.reference is not None,
        rng=np.random.default_rng([args.seed, 1]),
    )
    return Simulator(
        probe,
        port=args.port,
        names=names,
        rate_hz=args.rate,
        hidden=args.hidden,
        kind=args.messages,
        say=_say,
    )


def _points(args: argparse.Namespace) -> tuple[dict[str, FloatArray], dict[str, object]]:
    """Return the points to touch, in the frame that touches are measured in, and what is true there."""
    if args.touches is not None:
        touches = read_touches(args.touches, args.side)
        given = {code: touches[code] for code in touches.placed}
        given.update({name: np.asarray(place) for name, place in touches.extra.items()})
        return given, {"points": _listed(given)}
    side = Side.parse(args.side)
    rng = np.random.default_rng(args.seed)
    animal = draw_animal(Atlas.published(), rng=rng, name=f"drawn {args.seed}")
    turn = rotation_of(rng.uniform(-1.5, 1.5, 3))
    placed = RigidTransform.from_parts(turn, rng.uniform(-60, 60, 3), dst="tracker", src="scan")
    landmarks = animal.side(side)
    codes = [*PROBE, *(code for code in EXTERNAL if code not in PROBE)]
    points = {code: placed.apply(landmarks[code][None])[0] for code in codes}
    inner = {code: placed.apply(landmarks[code][None])[0] for code in ("CO", "CA", "CB")}
    return points, {
        "side": side.value,
        "points": _listed(points),
        "cochlea": _listed(inner),
        "T_tracker_scan": placed.matrix.tolist(),
    }


def _listed(points: dict[str, FloatArray]) -> dict[str, list[float]]:
    return {name: [float(x) for x in place] for name, place in points.items()}
