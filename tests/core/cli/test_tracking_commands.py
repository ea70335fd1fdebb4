"""The commands ``register`` and ``pivot``, and what ``estimate`` writes for robots and surgeons."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import gp_core
from gp_core.cli import main
from gp_core.frames import RigidTransform
from gp_core.pose.insertion_path import carry_path
from gp_core.validation import FloatArray

_ROTATION = Rotation.from_rotvec([0.3, -1.0, 0.6]).as_matrix()
T_tracker_scan = RigidTransform.from_parts(_ROTATION, [30, -70, 200], dst="tracker", src="scan")


def _table(path: Path, points: dict[str, FloatArray]) -> Path:
    rows = [f"{name},{','.join(repr(float(v)) for v in point)}" for name, point in points.items()]
    path.write_text("name,x,y,z\n" + "\n".join(rows) + "\n")
    return path


def _animal(*, skull: bool = True) -> dict[str, FloatArray]:
    """Features of the mean animal in the scan, and eight skull features, mm."""
    atlas = gp_core.Atlas.published()
    points = {code: atlas[code] + 40 for code in atlas.codes}
    if skull:
        spread = np.random.default_rng(0).uniform(-1, 1, (8, 3)) * (15, 25, 10)
        points |= {f"S{i + 1}": point for i, point in enumerate(spread)}
    return points


def _touched(codes: tuple[str, ...], noise: float = 0.0) -> dict[str, FloatArray]:
    rng, animal = np.random.default_rng(1), _animal()
    return {code: T_tracker_scan.apply(animal[code][None])[0] + noise * rng.normal(size=3) for code in codes}


_SKULL = tuple(f"S{i}" for i in range(1, 9))


def _path(folder: Path, units: float = 1.0) -> Path:
    angle = np.linspace(0, -8, 30)
    points = np.column_stack([0.2 * -angle, 1.5 * np.cos(angle), 1.5 * np.sin(angle)])
    np.savetxt(folder / "path.csv", points / units, delimiter=",", header="x,y,z", comments="")
    return folder / "path.csv"


def test_estimate_writes_for_robot_and_slicer(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    touches = _table(tmp_path / "touches.csv", _touched(gp_core.PROBE))
    files = {name: tmp_path / name for name in ("pose.json", "pose.csv", "pose.mrk.json", "out.csv")}
    words = [
        "estimate", str(touches), "--side", "L", "--json", str(files["pose.json"]),
        "--csv", str(files["pose.csv"]), "--landmarks", str(files["pose.mrk.json"]),
        "--path", str(_path(tmp_path, 1000.0)), "--path-units", "m", "--path-side", "L",
        "--path-out", str(files["out.csv"]),
    ]  # fmt: skip
    assert main(words) == 0
    pose = gp_core.read_pose(files["pose.json"])
    np.testing.assert_array_equal(np.loadtxt(files["pose.csv"], delimiter=","), pose.transform)
    assert gp_core.read_landmarks(files["pose.mrk.json"])["CO"] == pytest.approx(pose.origin)
    path = gp_core.read_path(_path(tmp_path, 1000.0), units="m")
    np.testing.assert_array_equal(
        np.loadtxt(files["out.csv"], delimiter=","), carry_path(path, pose, path_side="L")
    )
    text = capsys.readouterr().out
    assert text.count("as well would help most: 95 % within about") == 1


def test_estimate_says_when_nothing_is_left_to_gain(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    touches = _table(tmp_path / "touches.csv", _touched(tuple(c for c in gp_core.EXTERNAL if c != "RWL")))
    assert main(["estimate", str(touches), "--side", "L"]) == 0
    assert "no other touch would reduce the region much" in capsys.readouterr().out
    touches = _table(tmp_path / "touches.csv", _touched(gp_core.EXTERNAL))
    assert main(["estimate", str(touches), "--side", "L"]) == 0
    assert "gain" not in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--path", "PATH"], "needs --path-units m|cm|mm|um and --path-side L|R and --path-out FILE too"),
        (["--path", "PATH", "--path-units", "mm", "--path-side", "L"], "needs --path-out FILE too"),
        (["--path-side", "L"], "needs a path. Give --path CSV."),
        (
            ["--path", "PATH", "--path-units", "m", "--path-side", "L", "--path-out", "o.csv"],
            "Its numbers look like mm",
        ),
        (
            ["--path", "PATH", "--path-units", "mm", "--path-side", "R", "--path-out", "o.csv"],
            "path.csv: the path is declared as that of a right ear, but winds as in a left ear",
        ),
    ],
)
def test_a_path_needs_its_units_and_its_side(
    words: list[str], message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    touches = _table(tmp_path / "touches.csv", _touched(gp_core.PROBE))
    words = [str(_path(tmp_path)) if word == "PATH" else word for word in words]
    assert main(["estimate", str(touches), "--side", "L", *words]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1


def test_register_finds_the_scan(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    touches = _table(tmp_path / "touches.csv", _touched((*_SKULL, "RWA", "OS"), noise=0.1))
    ct = _table(tmp_path / "ct_L.csv", _animal())
    out, tfm = tmp_path / "out.json", tmp_path / "out.tfm"
    words = ["register", str(touches), str(ct), "--side", "L", "--json", str(out), "--tfm", str(tfm)]
    assert main(words) == 0
    content = json.loads(out.read_text())
    np.testing.assert_allclose(content["transform"], T_tracker_scan.inverse().matrix, atol=2.0)
    assert set(content["residuals_mm"]) == {*_SKULL, "RWA", "OS"}
    assert 0.02 < content["tre_at_cochlea_mm"] < content["tre_95_at_cochlea_mm"] < 0.3
    (numbers,) = (line.split()[1:] for line in tfm.read_text().splitlines() if line.startswith("Parameters"))
    way_back = np.array(numbers, dtype=float)
    np.testing.assert_allclose(way_back[9:], np.linalg.inv(content["transform"])[:3, 3], atol=1e-9)
    text = capsys.readouterr().out
    assert "Tracker to scan by 10 points" in text
    assert "expected error at the cochlea (TRE)" in text


def test_register_without_a_labelled_cochlea(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    ct = _table(tmp_path / "ct.csv", {name: _animal()[name] for name in _SKULL[:4]})
    touches = _table(tmp_path / "touches.csv", _touched(_SKULL[:3]))
    out = tmp_path / "out.json"
    assert main(["register", str(touches), str(ct), "--side", "L", "--json", str(out)]) == 0
    assert json.loads(out.read_text())["tre_at_cochlea_mm"] is None
    text = capsys.readouterr().out
    assert "no error at the cochlea" in text
    assert "! only 3 points" in text


def test_register_names_what_is_missing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    ct = _table(tmp_path / "ct.csv", {name: _animal()[name] for name in _SKULL[:2]})
    touches = _table(tmp_path / "touches.csv", _touched(_SKULL))
    assert main(["register", str(touches), str(ct), "--side", "L"]) == 2
    error = capsys.readouterr().err
    assert "touches.csv and " in error
    assert "got 2 (tracker: S1 S2 S3 S4 S5 S6 S7 S8; scan: S1 S2)" in error


def _poses(folder: Path, n: int = 60) -> Path:
    rng = np.random.default_rng(2)
    rotations = Rotation.from_rotvec(rng.normal(scale=0.4, size=(n, 3))).as_matrix()
    poses = np.tile(np.eye(4), (n, 1, 1))
    poses[:, :3, :3] = rotations
    poses[:, :3, 3] = [5, 6, 700] - rotations @ [1, 2, 150] + 0.1 * rng.normal(size=(n, 3))
    poses[7, :3, 3] += 30
    np.savetxt(folder / "poses.csv", poses.reshape(n, 16), delimiter=",")
    return folder / "poses.csv"


def test_pivot_finds_the_tip(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "tip.json"
    assert main(["pivot", str(_poses(tmp_path)), "--json", str(out)]) == 0
    content = json.loads(out.read_text())
    np.testing.assert_allclose(content["tip_offset_mm"], [1, 2, 150], atol=0.3)
    assert content["left_out"] == [7]
    text = capsys.readouterr().out
    assert "59 of 60 frames" in text
    assert "! 1 of 60 frames" in text


def test_pivot_of_too_little_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["pivot", str(_poses(tmp_path, 9))]) == 2
    error = capsys.readouterr().err
    assert "poses.csv: a pivot calibration needs at least 10 frames, got 9" in error
    assert error.count("\n") == 1


def test_the_commands_explain_themselves(capsys: pytest.CaptureFixture[str]) -> None:
    for command in ("register", "pivot"):
        with pytest.raises(SystemExit):
            main([command, "--help"])
        assert f"example:\n  gp-core {command}" in capsys.readouterr().out


_NUMBERS = st.one_of(st.floats(width=32), st.integers(-300, 300), st.sampled_from(["", "NaN", "x", "1,5"]))
_TABLES = st.integers(2, 17).flatmap(
    lambda width: st.lists(st.lists(_NUMBERS, min_size=width, max_size=width), max_size=14)
)
_FILES = st.one_of(
    st.binary(max_size=200),
    st.tuples(_TABLES, st.sampled_from([",", ";", " ", "\t"])).map(
        lambda given: "\n".join(given[1].join(map(str, row)) for row in given[0]).encode()
    ),
)


@settings(
    max_examples=60,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@given(content=_FILES)
def test_no_file_makes_a_traceback(content: bytes, tmp_path: Path) -> None:
    fuzzed, touches = tmp_path / "fuzz.csv", tmp_path / "touches.csv"
    fuzzed.write_bytes(content)
    if not touches.exists():
        _table(touches, _touched(gp_core.PROBE))
    estimate = ["estimate", str(touches), "--side", "L", "--path", str(fuzzed), "--path-units", "mm"]
    for words in (
        ["pivot", str(fuzzed)],
        ["register", str(touches), str(fuzzed), "--side", "L"],
        ["register", str(fuzzed), str(touches), "--side", "L"],
        [*estimate, "--path-side", "L", "--path-out", str(tmp_path / "out.csv")],
    ):
        assert main(words) in (0, 2)
