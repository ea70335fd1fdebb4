"""Recorded poses, as PLUS, 3D Slicer and NDI write them, and what is made of them."""

from __future__ import annotations

import gzip
import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gp_core import read_touches
from gp_core.cli import main
from gp_core.errors import FileFormatError, GeometryError, GpError
from gp_core.io.tracker_recordings import Recording, is_sequence, read_recording
from gp_core.pose.recorded_touches import recorded_touches, resting_places
from gp_core.registration.pivot import calibrate_pivot

_TIP, _PIVOT = np.array([1.5, -2.0, 160.0]), np.array([10.0, 20.0, -900.0])


def _turning(n: int = 80) -> np.ndarray:
    rng = np.random.default_rng(3)
    poses = np.tile(np.eye(4), (n, 1, 1))
    poses[:, :3, :3] = Rotation.from_euler("zyx", rng.uniform(-40, 40, (n, 3)), degrees=True).as_matrix()
    poses[:, :3, 3] = _PIVOT - poses[:, :3, :3] @ _TIP + rng.normal(0, 0.02, (n, 3))
    return poses


def _fields(poses: np.ndarray, mark: str, *, invalid: int = 0, reference: np.ndarray | None = None) -> str:
    lines = []
    for k, pose in enumerate(poses):
        hidden = bool(invalid) and k % invalid == 0
        flat = " ".join(f"{x:.9f}" for x in (np.eye(4) if hidden else pose).ravel())
        lines += [f"Seq_Frame{k:04d}_StylusToTrackerTransform{mark}{flat}"]
        lines += [f"Seq_Frame{k:04d}_StylusToTrackerTransformStatus{mark}{'INVALID' if hidden else 'OK'}"]
        lines += [f"Seq_Frame{k:04d}_Timestamp{mark}{k / 20:.3f}"]
        if reference is not None:
            flat = " ".join(f"{x:.9f}" for x in reference[k].ravel())
            lines += [f"Seq_Frame{k:04d}_ReferenceToTrackerTransform{mark}{flat}"]
            lines += [f"Seq_Frame{k:04d}_ReferenceToTrackerTransformStatus{mark}OK"]
    return "\n".join(lines) + "\n"


def _mha(path, poses: np.ndarray, **how: object):
    head = f"ObjectType = Image\nNDims = 3\nDimSize = 4 4 {len(poses)}\nElementType = MET_UCHAR\n"
    head += _fields(poses, " = ", **how) + "ElementDataFile = LOCAL\n"
    path.write_bytes(head.encode() + bytes(range(256)) * (len(poses) // 16 + 1))
    return path


def _nrrd(path, poses: np.ndarray):
    head = f"NRRD0004\ntype: unsigned char\ndimension: 3\nsizes: 4 4 {len(poses)}\nencoding: raw\n"
    path.write_bytes((head + _fields(poses, ":=") + "\n").encode() + bytes(16 * len(poses)))
    return path


def _table(path, header: str, rows: list[list[object]]):
    path.write_text("\n".join([header, *(",".join(map(str, row)) for row in rows)]) + "\n", encoding="utf-8")
    return path


def _quaternion(pose: np.ndarray) -> list[float]:
    x, y, z, w = Rotation.from_matrix(pose[:3, :3]).as_quat()
    return [w, x, y, z]


_WRITERS = {
    "mha": lambda folder, poses: _mha(folder / "a.igs.mha", poses),
    "mha, some unseen": lambda folder, poses: _mha(folder / "a.mha", poses, invalid=9),
    "header alone": lambda folder, poses: _text(folder / "a.txt", _fields(poses, " = ")),
    "nrrd": lambda folder, poses: _nrrd(folder / "a.igs.nrrd", poses),
    "quaternions": lambda folder, poses: _table(
        folder / "a.csv", "t,qw,qx,qy,qz,tx,ty,tz", [[0, *_quaternion(p), *p[:3, 3]] for p in poses]
    ),
    "NDI quaternions": lambda folder, poses: _table(
        folder / "a.csv",
        "Tools,Port 1,Frame,Face,State,Q0,Qx,Qy,Qz,Tx,Ty,Tz,Error",
        [[1, k, k, 0, "OK", *_quaternion(p), *p[:3, 3], 0.1] for k, p in enumerate(poses)]
        + [[1, 0, 0, 0, "MISSING", *[""] * 8]],
    ),
    "NDI angles": lambda folder, poses: _table(
        folder / "a.csv",
        "Frame,State,Rz,Ry,Rx,Tx,Ty,Tz",
        [
            [k, "OK", *Rotation.from_matrix(p[:3, :3]).as_euler("ZYX", degrees=True), *p[:3, 3]]
            for k, p in enumerate(poses)
        ],
    ),
    "column by column, in four rows": lambda folder, poses: _table(
        folder / "a.csv", "", [row for p in poses for row in p.T]
    ),
    "column by column": lambda folder, poses: _table(folder / "a.csv", "", [[*p.T.ravel()] for p in poses]),
    "brackets": lambda folder, poses: _text(
        folder / "a.csv", "\n".join(str(p.ravel().tolist()) for p in poses) + "\n"
    ),
}


def _named(path, header: str, order: str, poses: np.ndarray):
    parts = {"q": lambda p: _quaternion(p), "x": lambda p: _quaternion(p)[1:] + _quaternion(p)[:1]}
    parts |= {"t": lambda p: p[:3, 3].tolist(), "1": lambda _: [1.0]}
    return _table(path, header, [[x for part in order for x in parts[part](p)] for p in poses])


_COLUMNS = {
    "w last": ("qx,qy,qz,qw,tx,ty,tz", "xt"),
    "position first": ("X,Y,Z,QX,QY,QZ,QW", "tx"),
    "underscores": ("t_x,t_y,t_z,q_w,q_x,q_y,q_z", "tq"),
    "points": ("pos.x,pos.y,pos.z,quat.x,quat.y,quat.z,quat.w", "tx"),
    "units": ("Position X [mm],Position Y [mm],Position Z [mm],Rot_W,Rot_X,Rot_Y,Rot_Z", "tq"),
    "state is a number": ("qw,qx,qy,qz,tx,ty,tz,state", "qt1"),
    "row names of R": ("qw,qx,qy,qz,tx,ty,tz", "1qt"),
}


@pytest.mark.parametrize("kind", _COLUMNS)
def test_columns_of_quaternions_are_found_by_their_names(tmp_path, kind) -> None:
    poses = _turning(12)
    found = read_recording(_named(tmp_path / "a.csv", *_COLUMNS[kind], poses)).poses
    assert found == pytest.approx(poses)


@pytest.mark.parametrize("order", ["tq", "tx", "1tq"])
def test_quaternions_without_names_of_columns_are_refused(tmp_path, order) -> None:
    file = _named(tmp_path / "a.csv", "", order, _turning(12))
    with pytest.raises(FileFormatError, match=r"quaternions under a header"):
        read_recording(file)


@pytest.mark.parametrize("write", [_mha, _nrrd])
def test_a_sequence_that_is_gzipped_as_a_whole_is_read(tmp_path, write) -> None:
    poses = _turning(12)
    plain = write(tmp_path / "a.igs", poses)
    packed = tmp_path / f"{plain.name}.gz"
    packed.write_bytes(gzip.compress(plain.read_bytes()))
    assert is_sequence(packed)
    assert read_recording(packed).poses == pytest.approx(poses, abs=1e-6)


@pytest.mark.parametrize("name", ["TrackerToStylus", "TrackerToMarker", "ReferenceToProbe"])
def test_a_transform_whose_name_says_the_opposite_is_inverted(name: str, tmp_path) -> None:
    poses = _turning(12)
    text = _fields(np.linalg.inv(poses), " = ").replace("StylusToTracker", name)
    found = read_recording(_text(tmp_path / "a.txt", text))
    assert found.transform == name
    assert found.poses == pytest.approx(poses, abs=1e-5)


def _text(path, text: str):
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize("kind", _WRITERS)
def test_the_tip_is_the_same_whatever_wrote_the_poses(tmp_path, kind) -> None:
    recording = read_recording(_WRITERS[kind](tmp_path, _turning()))
    found = calibrate_pivot(recording.poses)
    assert found.tip_offset == pytest.approx(_TIP, abs=0.05)
    assert found.pivot == pytest.approx(_PIVOT, abs=0.05)


def test_frames_whose_status_is_not_ok_are_not_seen(tmp_path) -> None:
    recording = read_recording(_mha(tmp_path / "a.mha", _turning(40), invalid=10))
    assert np.flatnonzero(np.isnan(recording.poses[:, 0, 0])).tolist() == [0, 10, 20, 30]
    assert recording.times == pytest.approx(np.arange(40) / 20)
    assert recording.transform == "StylusToTracker"


def test_poses_in_the_frame_of_a_reference_do_not_move_with_the_head(tmp_path) -> None:
    rng, poses = np.random.default_rng(1), _turning()
    head = np.tile(np.eye(4), (len(poses), 1, 1))
    head[:, :3, :3] = Rotation.from_rotvec(rng.normal(0, 0.1, (len(poses), 3))).as_matrix()
    head[:, :3, 3] = rng.normal(0, 20, (len(poses), 3))
    file = _mha(tmp_path / "a.mha", head @ poses, reference=head)
    for name in ("ReferenceToTracker", "ReferenceToTrackerTransform"):
        found = read_recording(file, reference=name)
        assert found.poses == pytest.approx(poses, abs=1e-5)
    with pytest.raises(GpError, match=r"no transform 'RefToTracker'.*ReferenceToTracker, StylusToTracker"):
        read_recording(file, reference="RefToTracker")


def test_of_several_transforms_one_must_be_named(tmp_path) -> None:
    text = _fields(_turning(20), " = ").replace("StylusToTracker", "AToTracker")
    file = _text(tmp_path / "a.txt", text + text.replace("AToTracker", "BToTracker"))
    with pytest.raises(GpError, match=r"several transforms.*--transform: AToTracker, BToTracker"):
        read_recording(file)
    assert read_recording(file, transform="BToTracker").transform == "BToTracker"


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (np.linalg.inv, "seem to be those of the tracker in the marker's frame"),
        (
            lambda p: np.concatenate([p[:, :, :3], p[:, :, 3:] * [[1e-3], [1e-3], [1e-3], [1]]], axis=2),
            "metres",
        ),
        (lambda p: p * [[1.2, 1, 1, 1]], "none of the 80 poses is a rigid motion"),
    ],
)
def test_poses_that_cannot_be_meant_are_refused_in_words(spoil, said) -> None:
    with pytest.raises(GeometryError, match=said):
        calibrate_pivot(spoil(_turning()))


def test_a_pose_that_is_damaged_is_named(tmp_path) -> None:
    file = _text(tmp_path / "a.txt", _fields(_turning(20), " = ").replace(" 1.000000000\n", "\n", 1))
    with pytest.raises(FileFormatError, match="StylusToTrackerTransform of frame 0 must be 16 numbers"):
        read_recording(file)


@pytest.mark.parametrize("text", ["x,y\n1,2\n", "qw,qx,qy,qz,tx,ty,tz\n1,0,0,0,a,2,3\n", "1 2 3\n4 5 6\n"])
def test_what_is_no_recording_is_refused(tmp_path, text) -> None:
    file = _text(tmp_path / "a.csv", text)
    assert not is_sequence(file)
    with pytest.raises(FileFormatError, match="quaternions under a header"):
        read_recording(file)


def test_the_columns_of_two_tools_are_not_taken_for_one(tmp_path) -> None:
    one = "Port 1,Frame,State,Q0,Qx,Qy,Qz,Tx,Ty,Tz"
    rows = [[1, k, "OK", *_quaternion(p), *p[:3, 3]] for k, p in enumerate(_turning(12))]
    both = [[*row, 2, k, "OK", 1, 0, 0, 0, 5, 6, 7] for k, row in enumerate(rows)]
    assert len(read_recording(_table(tmp_path / "one.csv", one, rows)).poses) == 12
    with pytest.raises(FileFormatError, match=r"poses of several tools: its columns q0 .* are there 2 times"):
        read_recording(_table(tmp_path / "two.csv", f"{one},{one.replace('1', '2')}", both))


def test_angles_that_may_be_radians_are_refused(tmp_path) -> None:
    poses = _turning(12)
    for name, turns in (
        ("Rz,Ry,Rx", Rotation.from_matrix(poses[:, :3, :3]).as_euler("ZYX")),
        ("rx,ry,rz", Rotation.from_matrix(poses[:, :3, :3]).as_rotvec()),
    ):
        rows = [[*turn, *pose[:3, 3]] for turn, pose in zip(turns, poses, strict=True)]
        file = _table(tmp_path / "a.csv", f"{name},Tx,Ty,Tz", rows)
        with pytest.raises(FileFormatError, match=r"seem to be radians.*Export degrees"):
            read_recording(file)


def _touching(places: np.ndarray, *, hertz: float = 30.0) -> Recording:
    """The tip goes from place to place, and rests a second at each."""
    rng = np.random.default_rng(0)
    way: list[np.ndarray] = []
    for place in places:
        if way:
            way += list(np.linspace(way[-1], place, int(hertz)))
        way += [place] * int(hertz)
    tips = np.array(way) + rng.normal(0, 0.05, (len(way), 3))
    poses = np.tile(np.eye(4), (len(tips), 1, 1))
    poses[:, :3, :3] = Rotation.from_rotvec(rng.normal(0, 0.2, (len(tips), 3))).as_matrix()
    poses[:, :3, 3] = tips - poses[:, :3, :3] @ _TIP
    return Recording(poses, np.arange(len(tips)) / hertz)


_PLACES = np.array([[0.0, 0, 0], [10, 0, 0], [10, 12, 0], [-5, 3, 9.0], [0, 0, 1]])


@pytest.mark.parametrize("timed", [True, False])
def test_the_places_where_the_tip_rested_are_found_in_their_order(timed) -> None:
    recording = _touching(_PLACES)
    if not timed:
        recording = Recording(recording.poses)
    assert resting_places(recording, _TIP) == pytest.approx(_PLACES, abs=0.1 if timed else 0.3)
    named = recorded_touches(recording, _TIP, ["CL", "MN", "OS", "RWA", "RWP"])
    assert named["OS"] == pytest.approx(_PLACES[2], abs=0.1 if timed else 0.3)


def test_a_feature_may_be_touched_several_times(tmp_path) -> None:
    recording = _touching(_PLACES)
    named = recorded_touches(recording, _TIP, ["CL", "MN", "OS", "RWA", "CL"])
    assert named["CL"] == pytest.approx(_PLACES[[0, 4]], abs=0.1)
    assert named["MN"].shape == (3,)
    file, csv = _mha(tmp_path / "a.mha", recording.poses), tmp_path / "t.csv"
    tip = ",".join(map(str, _TIP))
    assert main(["touches", str(file), "--order", "CL,MN,OS,RWA,CL", "--tip", tip, "-o", str(csv)]) == 0
    assert len(read_touches(csv, "L").repeats["CL"].points) == 2


def test_more_or_fewer_rests_than_names_are_said() -> None:
    with pytest.raises(
        GeometryError, match=r"rested 5 times \(.*10\.0 12\.\d .*mm\), but 6 touches are named"
    ):
        recorded_touches(_touching(_PLACES), _TIP, list("ABCDEF"))


def test_poses_the_wrong_way_round_are_named_by_how_the_tip_rests() -> None:
    """A hand tilts the probe by some degrees while its tip rests a metre from the tracker."""
    recording = _touching(_PLACES + np.array([30.0, -20.0, -1000.0]))
    tilts = 0.05 * np.sin(np.arange(len(recording.poses))[:, None] / [17.0, 11.0, 7.0])
    tips = recording.poses[:, :3, :3] @ _TIP + recording.poses[:, :3, 3]
    recording.poses[:, :3, :3] = Rotation.from_rotvec(tilts).as_matrix()
    recording.poses[:, :3, 3] = tips - recording.poses[:, :3, :3] @ _TIP
    names = ["CL", "MN", "OS", "RWA", "RWP"]
    assert len(recorded_touches(recording, _TIP, names)) == 5
    inverted = Recording(np.linalg.inv(recording.poses), recording.times)
    with pytest.raises(GeometryError, match=r"only if every pose is inverted.*invert each matrix"):
        recorded_touches(inverted, _TIP, names)


def test_two_features_that_lie_close_are_two_touches_where_the_tip_was_away_between() -> None:
    away = np.array([0.0, 0.0, 30.0])
    places = np.array([[0.0, 0, 0], [1.4, 0, 0], [1.4, 0.5, 0]])
    way = [places[0], places[0] + away, places[1], places[1] + away, places[2]]
    found = resting_places(_touching(np.array(way)), _TIP)
    assert found[::2] == pytest.approx(places, abs=0.1)
    assert len(found) == 5


def test_a_tip_that_slips_a_little_is_one_touch() -> None:
    assert len(resting_places(_touching(np.array([[0.0, 0, 0], [1.5, 0, 0]])), _TIP)) == 1


@pytest.mark.parametrize(
    ("order", "tip", "said"),
    [
        ("RWA,CA", "0,0,0", "CA: is inside the bone"),
        ("RWA,FOO", "0,0,0", "FOO: is no feature"),
        ("RWA,CL", "0.001,0,0.16", "only 0.16 mm from its marker. Give it in mm"),
        ("RWA,CL", "1,2", "three finite numbers in mm, got [1.0, 2.0]"),
    ],
)
def test_what_is_named_wrongly_is_said_before_anything_is_written(tmp_path, capsys, order, tip, said) -> None:
    file, csv = _mha(tmp_path / "a.mha", _touching(_PLACES).poses), tmp_path / "t.csv"
    assert main(["touches", str(file), "--order", order, "--tip", tip, "-o", str(csv)]) == 2
    assert said in capsys.readouterr().err
    assert not csv.exists()


@pytest.mark.parametrize("tip", [[10**400, 0, 100], [0, 0], "far", None])
def test_a_tip_that_no_pivot_wrote_is_refused(tmp_path, capsys, tip) -> None:
    file, csv = _mha(tmp_path / "a.mha", _touching(_PLACES).poses), tmp_path / "t.csv"
    calibration = _text(tmp_path / "tip.json", json.dumps({"tip_offset_mm": tip}))
    assert main(["touches", str(file), "--tip", str(calibration), "-o", str(csv)]) == 2
    assert "tip" in capsys.readouterr().err
    assert not csv.exists()


def test_from_the_shell_a_pivot_and_touches_of_sequences(tmp_path, capsys) -> None:
    pivot, touched = tmp_path / "pivot.igs.mha", tmp_path / "stylus.igs.mha"
    _mha(pivot, _turning())
    _mha(touched, _touching(_PLACES, hertz=20).poses)
    tip, csv = tmp_path / "tip.json", tmp_path / "touches.csv"
    assert main(["pivot", str(pivot), "--json", str(tip)]) == 0
    assert json.loads(tip.read_text())["tip_offset_mm"] == pytest.approx(_TIP, abs=0.05)
    order = ["--order", "CL,MN,OS,RWA,RWP"]
    assert main(["touches", str(touched), "--tip", str(tip), *order, "-o", str(csv)]) == 0
    rows = [line.split(",") for line in csv.read_text().splitlines()[1:]]
    assert [row[0] for row in rows] == ["CL", "MN", "OS", "RWA", "RWP"]
    assert np.array([[float(x) for x in row[1:]] for row in rows]) == pytest.approx(_PLACES, abs=0.15)
    capsys.readouterr()
    assert main(["estimate", str(touched), "--side", "L"]) == 2
    assert "gp-core touches" in capsys.readouterr().err
