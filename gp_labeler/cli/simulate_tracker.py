"""The command ``gp-labeler simulate-tracker``: a simulated probe over OpenIGTLink, to practise with."""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from gp_labeler.tracker.simulator import main, make_parser

__all__ = ["make_simulator_parser", "run_simulator"]

_PROG = "gp-labeler simulate-tracker"


def make_simulator_parser() -> argparse.ArgumentParser:
    """Return the parser of ``gp-labeler simulate-tracker``."""
    return make_parser(_PROG)


def run_simulator(arguments: Sequence[str]) -> int:
    """Serve until told to quit; see `gp_labeler.tracker.simulator.main`."""
    return main(arguments, prog=_PROG)
