"""``python -m gp_labeler``: the command ``gp-labeler``."""

from __future__ import annotations

import sys

if __name__ == "__main__":
    from gp_labeler.cli.start import labeler  # imports nothing before Ctrl-C is one line

    sys.exit(labeler())
else:
    from gp_labeler.cli.entry import main

    __all__ = ["main"]
