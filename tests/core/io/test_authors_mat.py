"""The authors' sets, real and made up."""

import struct

import numpy as np
import pytest
from landmark_makers import SHARED, needs_shared_data, same_landmarks

from gp_core.errors import FileFormatError, GpError
from gp_core.io import import_mat, load_specimens, read_authors_mat
from gp_core.io.mat5 import read_mat5
from gp_core.landmarks.features import CODES, named_set

LEFT, RIGHT = (
    SHARED / "usevitch2021" / f"combined_coords_method2_morepts_final_co_correct_{s}_CO.mat" for s in "LR"
)


def save(path, **variables):
    from scipy.io import savemat

    savemat(path, variables)
    return path


@pytest.fixture
def made_up(tmp_path):
    rng = np.random.default_rng(3)
    left, right = rng.normal(size=(2, 20, 3, 2))
    return save(tmp_path / "l.mat", cc_L=left), save(tmp_path / "r.mat", cc_R=right), left, right


def test_rows_go_by_the_authors_order(made_up):
    left_file, right_file, left, right = made_up
    specimens = read_authors_mat(left_file, right_file)
    assert [s.name for s in specimens] == ["GP01", "GP02"]
    for row, code in enumerate(named_set("authors_mat")):
        assert specimens[1].side("L")[code].tolist() == left[row, :, 1].tolist()
        assert specimens[0].side("R")[code].tolist() == right[row, :, 0].tolist()


@needs_shared_data
def test_the_real_sets_in_their_cochlea_frames():
    specimens = read_authors_mat(LEFT, RIGHT)
    assert [s.name for s in specimens] == [f"GP{i:02d}" for i in range(1, 12)]
    for specimen in specimens:
        for side, sign in (("L", 1), ("R", -1)):
            landmarks = specimen.side(side)
            assert landmarks.placed == CODES
            assert landmarks.frame == "cochlea"
            assert np.abs(landmarks["CO"]).max() < 1e-12
            assert sign * landmarks["CA"][0] > 3
            assert landmarks["DTL"][2] > 0


@needs_shared_data
def test_import_writes_files_that_read_back_bit_for_bit(tmp_path):
    written = import_mat(LEFT, RIGHT, tmp_path / "new" / "sets")
    assert [file.name for file in written[:3]] == ["GP01_L.mrk.json", "GP01_R.mrk.json", "GP02_L.mrk.json"]
    back = load_specimens(tmp_path / "new" / "sets")
    for specimen, original in zip(back, read_authors_mat(LEFT, RIGHT), strict=True):
        assert specimen.name == original.name
        assert all(same_landmarks(specimen.side(side), original.side(side)) for side in "LR")


def test_files_in_the_wrong_order_are_named(made_up):
    left_file, right_file, *_ = made_up
    with pytest.raises(FileFormatError, match=r"r\.mat: has no variable cc_L.*cc_R.*left side's file first"):
        read_authors_mat(right_file, left_file)


@pytest.mark.parametrize(
    ("value", "message"),
    [
        (np.zeros((19, 3, 2)), r"numbers in \(20, 3, animals\), got \(19, 3, 2\)"),
        (np.zeros((20, 3)), r"got \(20, 3\)"),
        (np.full((20, 3, 2), np.inf), "infinite"),
        (np.zeros((20, 3, 2), dtype=complex), "must be numbers"),
        ("text", "must be numbers"),
        (np.zeros((20, 3, 5)), "holds 5 animals, the left side's file 2"),
    ],
)
def test_wrong_variables_are_named(made_up, tmp_path, value, message):
    with pytest.raises(FileFormatError, match=message):
        read_authors_mat(made_up[0], save(tmp_path / "wrong.mat", cc_R=value))


def test_a_missing_position_stays_missing(tmp_path):
    values = np.ones((20, 3, 1))
    values[0, :, 0] = np.nan
    file = save(tmp_path / "x.mat", cc_L=values, cc_R=values)
    (specimen,) = read_authors_mat(file, file)
    assert specimen.side("L").status(named_set("authors_mat")[0]).value == "undefined"


@pytest.mark.parametrize("compressed", [False, True])
@pytest.mark.parametrize("kind", ["f8", "f4", "i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8", ">f8"])
def test_arrays_are_what_scipy_reads(tmp_path, kind, compressed):
    from scipy.io import loadmat, savemat

    values = (np.random.default_rng(1).normal(size=(4, 3, 5)) * 50).clip(0, 100).astype(kind)
    others = {"a": np.arange(3.0), "text": "abc", "cell": np.array([1, "x"], dtype=object), "z": 1 + 2j}
    savemat(tmp_path / "x.mat", {"cc": values, **others}, do_compression=compressed)
    ours, theirs = read_mat5(tmp_path / "x.mat"), loadmat(tmp_path / "x.mat")
    assert np.array_equal(ours["cc"], theirs["cc"])
    assert ours["a"].tolist() == [[0, 1, 2]]
    assert [name for name, value in ours.items() if value is None] == ["text", "cell", "z"]


@needs_shared_data
def test_the_real_arrays_are_what_scipy_reads():
    from scipy.io import loadmat

    for file, name in ((LEFT, "cc_L"), (RIGHT, "cc_R")):
        assert read_mat5(file)[name].tobytes() == loadmat(file)[name].tobytes()


def test_big_endian_numbers(tmp_path):
    def element(kind, data):
        return struct.pack(">II", kind, len(data)) + data + b"\0" * (-len(data) % 8)

    body = element(6, struct.pack(">II", 6, 0)) + element(5, struct.pack(">ii", 1, 2)) + element(1, b"cc")
    body += element(9, struct.pack(">dd", 1.5, -2.5))
    (tmp_path / "x.mat").write_bytes(b" " * 124 + b"\1\0MI" + element(14, body))
    assert read_mat5(tmp_path / "x.mat")["cc"].tolist() == [[1.5, -2.5]]


@pytest.mark.parametrize("content", [b"", b"no mat file at all", bytes(range(256)) * 4])
def test_what_is_no_mat_file_is_named(tmp_path, content):
    (tmp_path / "x.mat").write_bytes(content)
    with pytest.raises(FileFormatError, match=r"x\.mat: is not a MATLAB file"):
        read_authors_mat(tmp_path / "x.mat", tmp_path / "x.mat")
    with pytest.raises(FileFormatError, match="does not exist"):
        read_authors_mat(tmp_path / "none.mat", tmp_path / "x.mat")


def test_a_folder_that_cannot_be_made_is_named(made_up, tmp_path):
    (tmp_path / "taken").write_text("a file")
    with pytest.raises(GpError, match="cannot be made a folder"):
        import_mat(made_up[0], made_up[1], tmp_path / "taken")


def test_labels_that_are_there_already_are_not_replaced_unasked(made_up, tmp_path):
    left, right, *_ = made_up
    first, *_ = written = import_mat(left, right, tmp_path)
    first.write_text("corrected by hand")
    written[-1].unlink()
    with pytest.raises(GpError, match=r"_L\.mrk\.json: already exists.*--replace"):
        import_mat(left, right, tmp_path)
    assert first.read_text() == "corrected by hand"
    assert not written[-1].exists()  # nothing was written before it was refused
    assert import_mat(left, right, tmp_path, overwrite=True) == written
    assert first.read_text() != "corrected by hand"
