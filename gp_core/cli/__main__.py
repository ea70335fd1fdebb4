"""``python -m gp_core.cli`` is ``gp-core``."""

import sys

from gp_core.cli import main

if __name__ == "__main__":
    sys.exit(main())
