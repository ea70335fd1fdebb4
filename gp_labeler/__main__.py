"""``python -m gp_labeler``: the command ``gp-labeler``."""

from __future__ import annotations

import sys

from gp_labeler.cli.entry import main

if __name__ == "__main__":
    sys.exit(main())
