"""Numbers are read, typed and written alike whatever the locale of the machine."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import SimpleITK

LOCALES = ["de_DE", "fr_FR", "tr_TR", "fa_IR"]
SPACING, ORIGIN = 0.50075, (1.25, -2.75, 3.5)

IN_THE_WINDOW = """
import ctypes, json, locale, multiprocessing, sys
from concurrent.futures import ProcessPoolExecutor
from qtpy.QtCore import QLocale
from qtpy.QtTest import QTest
from gp_labeler.imaging.readers import read_volume
from gp_labeler.views.application import make_application, make_window
from gp_labeler.views.panels.number_field import NumberField

app = make_application()
window = make_window(None, atlas=False)
window.show()
app.processEvents()
strtod = ctypes.CDLL(None).strtod
strtod.restype, strtod.argtypes = ctypes.c_double, [ctypes.c_char_p, ctypes.c_void_p]
field, chosen = NumberField("threshold"), []
field.value_chosen.connect(chosen.append)
for typed in ("0.5", "1,25", "-3e2"):
    field.clear()
    QTest.keyClicks(field, typed)
    field.editingFinished.emit() if field.hasAcceptableInput() else chosen.append(None)
with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as workers:
    in_worker = workers.submit(locale.format_string, "%.1f", 0.5).result()
said = {
    "worker": in_worker,
    "strtod": strtod(b"0.50075", None),
    "float": QLocale().toString(1234.5, "g", 6),
    "typed": chosen,
    "affines": [read_volume(path).T_scan_voxel.tolist() for path in sys.argv[1:]],
}
print(json.dumps(said))
"""


@pytest.fixture(scope="session")
def locale_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of compiled locales, for no machine has them all."""
    if not (shutil.which("localedef") and Path("/usr/share/i18n/locales/tr_TR").exists()):
        pytest.skip("localedef or its sources (Debian: locales) are not there")
    folder = tmp_path_factory.mktemp("locales")
    for name in LOCALES:
        subprocess.run(["localedef", "-i", name, "-f", "UTF-8", folder / f"{name}.UTF-8"], check=True)
    return folder


def in_locale(name: str, locale_path: Path) -> dict[str, str]:
    kept = {key: value for key, value in os.environ.items() if not key.startswith(("LC_", "LANG"))}
    return kept | {"LOCPATH": str(locale_path), "LC_ALL": f"{name}.UTF-8", "QT_QPA_PLATFORM": "offscreen"}


def ball(folder: Path) -> list[Path]:
    """Write a ball, whose size and place have decimals, as NRRD, MHA and VTK."""
    z, y, x = np.mgrid[-15:15, -15:15, -15:15]
    image = SimpleITK.GetImageFromArray((900 - np.hypot(np.hypot(x, y), z) * 50).astype(np.int16))
    image.SetSpacing((SPACING,) * 3)
    image.SetOrigin(ORIGIN)
    files = [folder / name for name in ("ball.nrrd", "ball.mha", "ball.vtk")]
    for file in files:
        SimpleITK.WriteImage(image, str(file))
    return files


@pytest.mark.parametrize("name", LOCALES)
def test_the_window_reads_and_takes_numbers_in_every_locale(
    name: str, locale_path: Path, tmp_path: Path
) -> None:
    done = subprocess.run(
        [sys.executable, "-c", IN_THE_WINDOW, *ball(tmp_path)],
        env=in_locale(name, locale_path),
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    said = json.loads(done.stdout)
    assert said["strtod"] == SPACING
    assert said["worker"] == "0.5"
    assert said["float"] == "1234.5"
    assert said["typed"] == [0.5, 1.25, -300]
    expected = np.diag([SPACING, SPACING, SPACING, 1])
    expected[:3, 3] = ORIGIN
    for affine in said["affines"]:
        np.testing.assert_allclose(affine, expected, atol=1e-6)


@pytest.mark.parametrize("name", ["de_DE", "tr_TR"])
def test_the_shell_writes_the_same_mesh_in_every_locale(name: str, locale_path: Path, tmp_path: Path) -> None:
    nrrd = ball(tmp_path)[0]
    meshes, words = [], []
    for locale in ("C", name):
        mesh = tmp_path / f"{locale}.vtp"
        command = [sys.executable, "-m", "gp_labeler", "mesh", nrrd, "-o", mesh, "--threshold", "250.5"]
        environment = in_locale(name, locale_path) | ({"LC_ALL": "C"} if locale == "C" else {})
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
        meshes.append(mesh.read_bytes())
        words.append(done.stdout.replace(str(mesh), ""))
    assert meshes[0] == meshes[1]
    assert words[0] == words[1]
    assert "0.50075" in words[0]
