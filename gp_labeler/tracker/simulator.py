"""The command that serves a simulated tracker, in a process of its own: for tests, the demo and training.

``python -m gp_labeler.tracker.simulator --help`` says how it is used.
"""

from __future__ import annotations

import argparse
import json
import logging
import math
import signal
import sys
import threading
from collections.abc import Sequence
from pathlib import Path
from queue import SimpleQueue

import numpy as np

from gp_core.atlas.atlas import Atlas
from gp_core.atlas.sampling import draw_animal
from gp_core.command_line import CommandParser
from gp_core.disk import protected_inputs, read_bytes, write_text
from gp_core.errors import GpError
from gp_core.frames import RigidTransform
from gp_core.io import read_touches
from gp_core.landmarks.features import EXTERNAL, PROBE, Side
from gp_core.standard_streams import STANDARD, standard_streams
from gp_core.validation import FloatArray
from gp_labeler.tracker.address import DEFAULT_PORT, check_device
from gp_labeler.tracker.pose_bodies import POSE_KINDS
from gp_labeler.tracker.rigid import rotation_of
from gp_labeler.tracker.simulated_probe import SimulatedProbe
from gp_labeler.tracker.simulated_tracker import HIDDEN_BY, Simulator

__all__ = ["main", "make_parser"]

_PROG = "python -m gp_labeler.tracker.simulator"

_COMMANDS = """commands, one per line, in a script or typed with --live:
  go NAME [SECONDS]            send the tip to a point, or home
  lift [MM] [SECONDS]          lift it off
  wait SECONDS
  turn [SECONDS]               tilt the probe about its tip, for a pivot calibration
  still                        end a turn that was given no time
  hide [probe|reference]       cover a marker
  show                         uncover both
  jump MM [SECONDS]            report the probe at a wrong place; without SECONDS in one message
  late SECONDS                 hold messages back for so long; 0 ends that
  bad KIND                     one bad message: nan, scale, mirror, repeat, back
  stale [SECONDS]              repeat the last position, as if it were new
  press                        press the button (a STRING message, 1 and then 0)
  cut [SECONDS]                close the connection, and come back
  quit
"""


def main(arguments: Sequence[str] | None = None, *, prog: str = _PROG) -> int:
    """Serve until told to quit.

    Parameters
    ----------
    arguments : sequence of str, optional
        Of the command line; by default this process's.
    prog : str
        What the command is called.

    Returns
    -------
    int
        0; 2 where the input is wrong, said in one line.
    """
    parser = make_parser(prog)
    args = parser.parse_args(arguments)
    if args.seed < 0:
        parser.error(f"--seed must be 0 or more, got {args.seed}")
    logging.getLogger("pyigtl").setLevel(logging.ERROR)
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGINT, signal.default_int_handler)  # it ends in good order
    try:
        with standard_streams(args, {}, ("touches", "script")):
            return _simulate(args)
    except GpError as error:
        sys.stderr.write(f"simulator: {error}\n")
    except OSError as error:
        why = error.strerror or error
        sys.stderr.write(
            f"simulator: cannot listen at port {args.port} ({why}). Choose another with --port.\n"
        )
    return 2


def _simulate(args: argparse.Namespace) -> int:
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


def make_parser(prog: str = _PROG) -> argparse.ArgumentParser:
    """Return the parser of the simulator's command line."""
    parser = CommandParser(
        prog=prog,
        description="Serve a simulated tracked probe over OpenIGTLink, on this computer only.",
        epilog=_COMMANDS,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "--port", type=int, default=DEFAULT_PORT, help="port; default: %(default)s; 0: any free port"
    )
    head = parser.add_argument_group("the head")
    head.add_argument(
        "--touches", type=Path, metavar="FILE", help="points to touch; default: those of a simulated animal"
    )
    head.add_argument("--side", default="L", metavar="L|R", help="side of the head; default: L")
    head.add_argument("--seed", type=int, default=0, help="seed of the simulated animal and of the noise")
    head.add_argument("--truth", type=Path, metavar="JSON", help="write the true positions to this file")
    _add_devices(parser)
    parser.add_argument("--script", type=Path, metavar="FILE", help="file with commands, repeated in a loop")
    parser.add_argument("--live", action="store_true", help="read commands from standard input")
    return parser


def _add_devices(parser: argparse.ArgumentParser) -> None:
    devices = parser.add_argument_group("the devices")
    devices.add_argument(
        "--probe", default="ProbeToTracker", metavar="NAME", help="name of the probe; default: %(default)s"
    )
    devices.add_argument(
        "--reference", metavar="NAME", help="marker on the head; without it, the head does not move"
    )
    devices.add_argument(
        "--button", default="Button", metavar="NAME", help="name of the foot switch; default: %(default)s"
    )
    devices.add_argument(
        "--tip",
        type=float,
        nargs=3,
        default=(0.0, 0.0, -120.0),
        metavar=("X", "Y", "Z"),
        help="tip in the frame of the probe's marker, mm; default: 0 0 -120",
    )
    devices.add_argument(
        "--noise",
        type=float,
        default=0.1,
        metavar="MM",
        help="SD of each coordinate of a marker; default: %(default)s",
    )
    devices.add_argument(
        "--noise-deg",
        type=float,
        default=0.02,
        metavar="DEG",
        help="SD of its rotation about each axis; default: %(default)s",
    )
    devices.add_argument(
        "--sway", type=float, default=0.0, metavar="MM", help="amplitude of head motion; default: 0"
    )
    devices.add_argument(
        "--rate", type=float, default=60.0, metavar="HZ", help="messages per second; default: %(default)s"
    )
    devices.add_argument(
        "--hidden",
        choices=HIDDEN_BY,
        default="status",
        help="how a hidden marker is reported; default: %(default)s",
    )
    devices.add_argument(
        "--messages",
        choices=POSE_KINDS,
        default="TRANSFORM",
        metavar="TYPE",
        help=f"type of the messages, of {', '.join(POSE_KINDS)}; default: TRANSFORM",
    )


if __name__ == "__main__":
    sys.exit(main())
