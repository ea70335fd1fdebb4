"""The command ``gp-labeler simulate-tracker``: a simulated probe over OpenIGTLink, to practise with."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from gp_core.command_line import CommandParser
from gp_core.errors import GpError
from gp_core.standard_streams import standard_streams
from gp_labeler.system.openigtlink import DEFAULT_PORT, POSE_KINDS

__all__ = ["make_simulator_parser", "run_simulator"]

_HIDDEN_BY = ("status", "identity", "stop")
"""How a covered marker is told: by metadata and identity, by an identity alone, or by no message."""

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


def run_simulator(arguments: Sequence[str]) -> int:
    """Serve until told to quit.

    Returns
    -------
    int
        0; 2 where the input is wrong, said in one line.
    """
    parser = make_simulator_parser()
    args = parser.parse_args(arguments)
    if args.seed < 0:
        parser.error(f"--seed must be 0 or more, got {args.seed}")
    from gp_labeler.tracker.simulator import simulate  # here: `--help` needs no extra

    try:
        with standard_streams(args, {}, ("touches", "script")):
            return simulate(args)
    except GpError as error:
        sys.stderr.write(f"simulator: {error}\n")
    except OSError as error:
        why = error.strerror or error
        sys.stderr.write(
            f"simulator: cannot listen at port {args.port} ({why}). Choose another with --port.\n"
        )
    return 2


def make_simulator_parser() -> argparse.ArgumentParser:
    """Return the parser of ``gp-labeler simulate-tracker``."""
    parser = CommandParser(
        prog="gp-labeler simulate-tracker",
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
        choices=_HIDDEN_BY,
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
