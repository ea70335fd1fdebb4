"""The command line ``gp-core``: each module adds its commands to the parser and runs them."""

from gp_core.cli.entry import main, make_parser

__all__ = ["main", "make_parser"]
