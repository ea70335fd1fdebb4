"""Insertion paths: units are asked, mirrored animals get mirrored paths, and the authors' path is one."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from atlas_cases import draw_side, random_pose

from gp_core import PROBE, Atlas, CochleaPose, LandmarkSet, Side, estimate_pose
from gp_core.errors import FileFormatError, GpError
from gp_core.frames import mirror_x
from gp_core.landmarks.anatomy import cochlea_frame
from gp_core.pose.insertion_path import UNITS, carry_path, read_path, winding_side, write_path
from gp_core.validation import FloatArray


def _spiral(side: Side = Side.LEFT, turns: float = 1.5) -> FloatArray:
    """From the round window towards the apex, mm, cochlea frame."""
    t = np.linspace(0, 1, 40)
    angle = 2 * np.pi * turns * t * (-1 if side is Side.LEFT else 1)
    radius = 2.0 - t
    return np.column_stack([2 * t, radius * np.cos(angle), radius * np.sin(angle)])


def _write(path: Path, points: FloatArray, *, header: str = "") -> Path:
    path.write_text(header + "".join(",".join(repr(float(v)) for v in p) + "\n" for p in points))
    return path


def _poses(seed: int = 0) -> tuple[CochleaPose, CochleaPose, LandmarkSet]:
    """Poses of a left animal and of its mirror image, and the left animal."""
    animal = draw_side(Atlas.published(), np.random.default_rng(seed)).moved(
        random_pose(np.random.default_rng(seed))
    )
    touches = animal.as_mapping(PROBE)
    left = estimate_pose(touches, "L")
    right = estimate_pose({code: mirror_x(p[None])[0] for code, p in touches.items()}, "R")
    return left, right, animal


def test_a_path_of_the_same_ear_is_only_moved() -> None:
    left, right, _ = _poses()
    for pose, side in ((left, Side.LEFT), (right, Side.RIGHT)):
        path = _spiral(side)
        np.testing.assert_allclose(
            carry_path(path, pose, path_side=side), pose.transform_to_touches.apply(path)
        )


@pytest.mark.parametrize("side", Side)
def test_in_mirrored_animals_one_path_gives_mirror_images(side: Side) -> None:
    left, right, _ = _poses()
    path = _spiral(side)
    in_left, in_right = (carry_path(path, pose, path_side=side) for pose in (left, right))
    np.testing.assert_allclose(in_right, mirror_x(in_left), atol=1e-9)


def test_a_path_drawn_in_an_animal_lies_where_its_mirror_image_has_it() -> None:
    """The law without the estimator: frames of the labelled animals themselves."""
    left, right, animal = _poses()
    T_tracker_cochlea = cochlea_frame(animal)  # of a left animal: x towards the apex
    drawn = T_tracker_cochlea.apply(_spiral())
    path = T_tracker_cochlea.inverse().apply(drawn)
    off = np.linalg.norm(carry_path(path, right, path_side="L") - mirror_x(drawn), axis=1)
    np.testing.assert_allclose(
        off, np.linalg.norm(carry_path(path, left, path_side="L") - drawn, axis=1), atol=1e-9
    )
    assert off.max() < 1.5  # the error of the estimate


def test_which_ear_a_path_winds_in() -> None:
    for side in Side:
        assert winding_side(_spiral(side)) is side
    assert winding_side(_spiral(turns=0.4)) is None
    assert winding_side(np.outer(np.linspace(-3, 3, 20), [0.1, 1, 0.01])) is None
    left, right, _ = _poses()
    for pose in (left, right):
        with pytest.raises(GpError, match="declared as that of a right ear, but winds as in a left ear"):
            carry_path(_spiral(), pose, path_side="R")


def test_the_cochlea_of_the_atlas_winds_that_way() -> None:
    """From the round window away from the oval one, by the bulge of the basal turn: clockwise, towards -z."""
    atlas = Atlas.published()
    window = (atlas["RWA"] + atlas["RWP"]) / 2
    oval = (atlas["FPA"] + atlas["FPP"]) / 2
    angles = [np.arctan2(point[2], point[1]) for point in (oval, window, atlas["CL"])]
    assert angles[0] > angles[1] > angles[2]


def test_blanks_may_align_the_columns(tmp_path: Path) -> None:
    file = tmp_path / "path.txt"
    file.write_text("".join("".join(f"{v:>12.6f}" for v in point) + "\n" for point in _spiral()))
    np.testing.assert_allclose(read_path(file, units="mm"), _spiral(), atol=1e-6)


@pytest.mark.parametrize("units", UNITS)
@pytest.mark.parametrize("header", ["", "X,Y,Z\n"])
def test_a_path_is_read_in_its_units(units: str, header: str, tmp_path: Path) -> None:
    file = _write(tmp_path / "path.csv", _spiral() / UNITS[units], header=header)
    np.testing.assert_allclose(read_path(file, units=units), _spiral(), rtol=1e-14, atol=1e-14)


@pytest.mark.parametrize(
    ("made", "said", "likely"),
    [("m", "mm", "m"), ("mm", "m", "mm"), ("um", "mm", "um"), ("mm", "um", "mm"), ("mm", "cm", "mm")],
)
def test_a_wrong_unit_is_refused_and_the_likely_one_named(
    made: str, said: str, likely: str, tmp_path: Path
) -> None:
    file = _write(tmp_path / "path.csv", (_spiral() + 1.5) / UNITS[made])
    with pytest.raises(GpError, match=rf"path\.csv: in {said} this path.*look like.*\b{likely}\b"):
        read_path(file, units=said)


def test_units_must_be_said(tmp_path: Path) -> None:
    file = _write(tmp_path / "path.csv", _spiral())
    with pytest.raises(TypeError):
        read_path(file)  # type: ignore[call-arg]
    with pytest.raises(GpError, match="units of the path must be one of m, cm, mm, um, got 'inch'"):
        read_path(file, units="inch")


def test_axes_are_rotated_but_never_mirrored(tmp_path: Path) -> None:
    path = _spiral()
    theirs = np.column_stack([path[:, 2], -path[:, 1], path[:, 0]])
    file = _write(tmp_path / "path.csv", theirs)
    np.testing.assert_array_equal(read_path(file, units="mm", axes="z,-y,x"), path)
    with pytest.raises(GpError, match="winds about another axis than x"):
        read_path(file, units="mm")
    for axes in ("z,y,x", "x,y", "x,x,z", "", "a,b,c", "-x,-y,-z"):
        with pytest.raises(GpError, match="axes must name x, y and z once each, right-handed"):
            read_path(file, units="mm", axes=axes)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "is empty"),
        ("x,y,z\n", "two rows or more, got 0"),
        ("1,2,3\n", "two rows or more, got 1"),
        ("1,2,3\n1,2\n", "line 2 must be three numbers"),
        ("1,2,3\n1,2,nan\n", "row 2: position must be three finite numbers"),
        ("1,2,3\n,,\n", "line 2 must be three numbers"),
        ("1,2,3\nx,y,z\n", "row 2: position must be"),
        ("1,2,3,4\n1,2,3,4\n", "line 1 must be three numbers"),
        ("1,2,3\n1,2,3\n", "would lie"),
    ],
)
def test_what_is_no_path_is_refused(text: str, message: str, tmp_path: Path) -> None:
    file = tmp_path / "path.csv"
    file.write_text(text)
    with pytest.raises(GpError, match=rf"path\.csv.*{message}"):
        read_path(file, units="mm")


@pytest.mark.parametrize("rows", [-3, 0, 1, 41])
def test_rows_that_are_not_there_are_refused(rows: int, tmp_path: Path) -> None:
    file = _write(tmp_path / "path.csv", _spiral())
    with pytest.raises(GpError, match=f"must be 2 to 40, got {rows}"):
        read_path(file, units="mm", rows=rows)
    assert len(read_path(file, units="mm", rows=40)) == 40


def test_a_missing_file_is_named() -> None:
    with pytest.raises(FileFormatError, match="does not exist"):
        read_path("none.csv", units="mm")


def test_what_is_written_is_read_back(tmp_path: Path) -> None:
    write_path(tmp_path / "out.csv", _spiral())
    np.testing.assert_array_equal(read_path(tmp_path / "out.csv", units="mm"), _spiral())


def test_the_authors_path_is_of_a_left_ear_about_its_z_axis(shared_data: Path) -> None:
    file = shared_data / "usevitch2021" / "Curve_Points.csv"
    for units in ("mm", "cm", "um"):
        with pytest.raises(GpError, match=r"look like .*\bm\b"):
            read_path(file, units=units)
    for rows in (20, None):
        with pytest.raises(GpError, match="winds about another axis than x"):
            read_path(file, units="m", rows=rows)
    path = read_path(file, units="m", axes="z,-y,x", rows=20)
    assert len(path) == 20
    assert winding_side(path) is Side.LEFT
    atlas = Atlas.published()
    window = (atlas["RWA"] + atlas["RWP"]) / 2
    assert np.linalg.norm(path[0] - window) < 0.8
    assert (np.linalg.norm(path, axis=1) < 2.5).all()
    left, right, _ = _poses()
    for pose in (left, right):
        carried = carry_path(path, pose, path_side="L")
        assert np.linalg.norm(carried - pose.origin, axis=1).max() < 2.5
