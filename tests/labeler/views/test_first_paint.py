"""What takes long to import does not keep the window from showing."""

from __future__ import annotations

import json
import os
import subprocess
import sys

LATE = ("pyvista", "pyvistaqt", "skimage", "SimpleITK", "matplotlib", "numba", "llvmlite", "pandas")

_CODE = """
import json, sys
from gp_labeler.views.application import make_window
window = make_window()
window.show()
window.grab()
window.grid.scene_view.grab()
late = [name for name in {late!r} if name in sys.modules]
print(json.dumps(late))
window.workspace.document.abandon()
"""


def test_nothing_heavy_is_imported_before_the_window_is_painted() -> None:
    environment = {**os.environ, "QT_QPA_PLATFORM": "offscreen"}
    code = _CODE.format(late=LATE)
    done = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        env=environment,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout.splitlines()[-1]) == []
