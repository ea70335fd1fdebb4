"""The distributions: what the wheel holds, and that it works alone; the tests' settings do what they say."""

from __future__ import annotations

import ast
import os
import re
import shutil
import subprocess
import sys
import tarfile
import zipfile
from email.parser import Parser
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import gp_core

_ROOT = Path(__file__).resolve().parents[1]
_NO_NETWORK = ("No matching distribution found", "Could not find a version")


def _run(*command: str | Path, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    environment = {key: value for key, value in os.environ.items() if key != "QT_API"}
    return subprocess.run(
        [str(w) for w in command], capture_output=True, text=True, check=False, cwd=cwd, env=environment
    )


@pytest.fixture(scope="module")
def distributions(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of the sdist, and of the wheel that is built from it."""
    folder = tmp_path_factory.mktemp("dist")
    done = _run(sys.executable, "-m", "build", "--outdir", folder, _ROOT)
    if any(words in done.stdout + done.stderr for words in _NO_NETWORK):
        pytest.skip("no network to fetch the build backend")
    assert done.returncode == 0, done.stdout + done.stderr
    return folder


@pytest.fixture(scope="module")
def wheel(distributions: Path) -> Path:
    """The wheel."""
    return next(distributions.glob("*.whl"))


@pytest.fixture(scope="module")
def alone(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The programs of an empty environment, outside the tree, in which the wheel was installed."""
    folder = tmp_path_factory.mktemp("alone")
    _run(sys.executable, "-m", "venv", "--without-pip", folder)
    programs = folder / ("Scripts" if os.name == "nt" else "bin")
    done = _run(sys.executable, "-m", "pip", "--python", programs / "python", "install", "--quiet", wheel)
    if any(words in done.stderr for words in _NO_NETWORK):
        pytest.skip("no network to fetch NumPy and SciPy")
    assert done.returncode == 0, done.stderr
    return programs


@pytest.mark.slow
def test_the_wheel_carries_the_resources(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
    assert {"gp_core/resources/features.json", "gp_core/py.typed", "gp_labeler/py.typed"} <= set(names)
    assert not any(name.startswith(("tests/", "docs/")) for name in names)


@pytest.mark.slow
def test_the_metadata_are_complete(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        (name,) = [n for n in archive.namelist() if n.endswith("METADATA")]
        told = Parser().parsestr(archive.read(name).decode())
    assert (told["Version"], told["License-Expression"]) == (gp_core.__version__, "MIT")
    assert told["Author"]
    assert len(told.get_all("Classifier", [])) > 10
    urls = [line.partition(", ")[2] for line in told.get_all("Project-URL", [])]
    assert len(urls) >= 5
    assert all(url.startswith("https://") for url in urls)
    needed = [line for line in told.get_all("Requires-Dist", []) if "extra ==" not in line]
    assert sorted(re.split(r"\W", line)[0] for line in needed) == ["numpy", "scipy"]
    extras = set(told.get_all("Provides-Extra", []))
    assert {"jrmpc", "figures", "app", "cluster", "all"} <= extras
    links = re.findall(r"\]\(([^)]+)\)", told.get_payload())  # type: ignore[arg-type]
    assert len(links) > 10
    assert [link for link in links if not link.startswith(("https://", "#"))] == []


@pytest.mark.slow
def test_the_checkers_of_distributions_find_nothing(distributions: Path, wheel: Path) -> None:
    files = sorted(distributions.iterdir())
    done = _run(sys.executable, "-m", "twine", "check", "--strict", *files)
    assert done.returncode == 0, done.stdout
    done = _run(sys.executable, "-m", "check_wheel_contents", wheel, cwd=_ROOT)
    assert done.returncode == 0, done.stdout


@pytest.mark.slow
def test_the_sdist_holds_what_both_commands_of_the_readme_need(distributions: Path) -> None:
    (sdist,) = distributions.glob("*.tar.gz")
    with tarfile.open(sdist) as archive:
        held = {name.partition("/")[2] for name in archive.getnames()}
    listed = _run("git", "ls-files", cwd=_ROOT)
    if listed.returncode != 0:
        pytest.skip("not a git checkout")
    rooms = (
        "gp_core",
        "gp_labeler",
        "resources",
        "tests",
        "docs",
        "tools",
        "benchmarks",
        "README.md",
        "LICENSE",
    )
    wanted = {
        name for name in listed.stdout.split("\n") if name.startswith(rooms) and (_ROOT / name).exists()
    }
    assert wanted - held == set()


@pytest.mark.slow
@pytest.mark.machine
def test_the_wheel_alone_needs_numpy_and_scipy_only(alone: Path) -> None:
    done = _run(sys.executable, "-m", "pip", "--python", alone / "python", "list", "--format=freeze")
    assert sorted(line.partition("==")[0] for line in done.stdout.split()) == ["gp-labeler", "numpy", "scipy"]


_COMMANDS = {
    "estimate": "estimate touches.csv --side L --json pose.json --tfm pose.tfm",
    "estimate jrmpc": "estimate touches.csv --side L --atlas labelled --method jrmpc",
    "fit": "fit labelled -o atlas.json",
    "check": "check labelled",
    "register": "register labelled/A_L.mrk.json labelled/A_L.mrk.json --side L",
    "pivot": "pivot poses.csv",
    "distances": "distances labelled --csv distances.csv",
    "leave-one-out": "leave-one-out labelled --method jrmpc",
}


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with touches, six animals drawn from the published atlas, and poses of a pivoting probe."""
    folder, rng, atlas = tmp_path_factory.mktemp("files"), np.random.default_rng(0), gp_core.Atlas.published()
    shutil.copy(_ROOT / "docs" / "example" / "touches.csv", folder)
    (folder / "labelled").mkdir()
    for name in "ABCDEF":
        points = rng.multivariate_normal(atlas.mean.ravel(), atlas.covariance).reshape(-1, 3)
        named = dict(zip(atlas.codes, points, strict=True))
        landmarks = gp_core.LandmarkSet.from_mapping(named, "L", frame="scan")
        gp_core.write_markups(folder / "labelled" / f"{name}_L.mrk.json", landmarks, specimen=name)
    rotations = Rotation.from_rotvec(rng.normal(scale=0.3, size=(30, 3))).as_matrix()
    poses = [np.vstack([np.column_stack([r, r @ [0, 0, -150.0]]), [0, 0, 0, 1]]) for r in rotations]
    (folder / "poses.csv").write_text("".join(",".join(map(str, pose.ravel())) + "\n" for pose in poses))
    return folder


@pytest.mark.slow
@pytest.mark.parametrize("command", _COMMANDS)
def test_the_wheel_alone_runs(alone: Path, files: Path, command: str) -> None:
    done = _run(alone / "gp-core", *_COMMANDS[command].split(), cwd=files)
    assert done.returncode in ((0, 1) if command == "check" else (0,)), done.stderr
    assert done.stdout


@pytest.mark.slow
@pytest.mark.parametrize(
    ("command", "extra"),
    [
        ("gp-core distances labelled --figure figure.png", "figures"),
        ("gp-core search labelled --scheduler tcp://127.0.0.1:9", "cluster"),
        ("gp-labeler", "app"),
        ("gp-labeler mesh head.nrrd -o head.ply", "app"),
        ("gp-labeler --offscreen demo --output out", "app"),
    ],
)
def test_a_missing_extra_is_one_line_that_names_it(
    alone: Path, files: Path, command: str, extra: str
) -> None:
    program, *words = command.split()
    done = _run(alone / program, *words, cwd=files)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert f'Run pip install "gp-labeler[{extra}]"' in done.stderr


@pytest.mark.slow
def test_the_doctor_of_the_wheel_alone_says_what_to_install(alone: Path, files: Path) -> None:
    done = _run(alone / "gp-labeler", "doctor", cwd=files)
    assert (done.returncode, done.stderr) == (2, "")
    missing = [line.split()[0] for line in done.stdout.splitlines() if line.endswith(" missing")]
    assert {"vtk", "qtpy", "simpleitk"} <= set(missing)
    assert 'are not installed. Run pip install "gp-labeler[app]"' in done.stdout


@pytest.mark.parametrize(("module", "passes"), [("gp_core.anything", False), ("numpy.linalg", True)])
def test_a_warning_is_an_error_in_our_modules_only(tmp_path: Path, module: str, passes: bool) -> None:
    warn = f"warnings.warn_explicit('old', DeprecationWarning, 'a.py', 1, module={module!r})"
    file = tmp_path / "test_warning.py"
    file.write_text(f"import warnings\n\ndef test_it():\n    {warn}\n")
    config = ["-c", str(_ROOT / "pyproject.toml"), "--rootdir", str(tmp_path), "-p", "no:cacheprovider"]
    command = [sys.executable, "-m", "pytest", "-q", *config, str(file)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=tmp_path)
    assert done.returncode == (0 if passes else 1), done.stdout


ORDERED = {
    "numpy": ("numpy", "gp_core"),
    "scipy": ("scipy", "gp_core"),
    "pyvista": ("pyvista", "gp_labeler/imaging"),
    "pyvistaqt": ("pyvistaqt", "gp_labeler/views"),
    "qtpy": ("qtpy", "gp_labeler/views"),
    "scikit-image": ("skimage", "gp_labeler/imaging"),
    "SimpleITK": ("SimpleITK", "gp_labeler/imaging"),
}
"""The packages that were ordered, with the module that is imported and the room where it serves first of all.

PySide6, the eighth, comes by qtpy.
"""


def _requirements() -> str:
    text = (_ROOT / "pyproject.toml").read_text(encoding="utf-8")
    return text.partition("\ndependencies = [")[2].partition("\nscanco = ")[0]


def _imported(folder: Path) -> set[str]:
    found: set[str] = set()
    for path in folder.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                found |= {alias.name.split(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
                found.add(node.module.split(".")[0])
    return found


@pytest.mark.parametrize("package", ORDERED)
def test_an_ordered_package_is_required_and_serves(package: str) -> None:
    module, room = ORDERED[package]
    assert re.search(rf'^    "{package}>=[\d.]+"', _requirements(), re.MULTILINE)
    assert module in _imported(_ROOT / room)


@pytest.mark.skipif(not find_spec("PySide6"), reason="PySide6 is not installed")
def test_pyside6_is_the_qt_that_qtpy_takes() -> None:
    assert re.search(r'^    "PySide6-Essentials>=[\d.]+', _requirements(), re.MULTILINE)
    code = "import sys, gp_labeler.views.theme, qtpy; print(qtpy.API_NAME, 'PySide6.QtCore' in sys.modules)"
    environment = {key: value for key, value in os.environ.items() if key != "QT_API"}
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, env=environment, cwd=_ROOT
    )
    assert done.stdout.split() == ["PySide6", "True"]


def test_qt_is_imported_through_qtpy_alone() -> None:
    assert {"PySide6", "PyQt6", "PyQt5", "PySide2"} & _imported(_ROOT / "gp_labeler" / "views") == set()
