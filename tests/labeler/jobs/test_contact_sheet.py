"""Contact sheets: close-up pictures of a place in a scan, the pages, the command."""

from __future__ import annotations

import numpy as np
import pytest
from repeated_cases import write_repeated
from window_cases import write_ball

from gp_core.landmarks.features import CODES, Side
from gp_labeler.cli.entry import main
from gp_labeler.document.edits import AnnotatePoint, MarkUnseen
from gp_labeler.document.labelling_edits import BeginLabelling
from gp_labeler.document.specimen_file import read_specimen, write_specimen
from gp_labeler.document.volume_reference import VolumeReference
from gp_labeler.imaging.close_up import PICTURE_AXES, CloseUp, PictureAxes
from gp_labeler.imaging.volume import Volume
from gp_labeler.jobs.contact_page import contact_page, feature_pictures
from gp_labeler.jobs.contact_sheet import MakeContactSheets
from gp_labeler.jobs.runner import Progress


def ball(*, direction=None) -> Volume:
    """A ball of radius 4 mm at (2, -3, 5), brighter towards the left, in soft tissue."""
    spacing, size = np.array([0.25, 0.3, 0.4]), (60, 60, 60)
    volume = Volume.from_parts(np.zeros(size, np.float32), spacing, (-6, -12, -7), direction)
    k, j, i = np.indices(size)
    points = volume.voxel_to_scan(np.stack([i, j, k], axis=-1).reshape(-1, 3))
    inside = np.linalg.norm(points - [2, -3, 5], axis=1) < 4
    grey = np.where(inside, 200 + 10 * points[:, 0], 20).reshape(size).astype(np.float32)
    return Volume.from_parts(grey, spacing, (-6, -12, -7), direction)


def test_a_slice_shows_the_plane_through_the_place():
    near = CloseUp(ball(), (2, -3, 5), 12.0, 61)
    axial = near.slice(PICTURE_AXES["axial"])
    assert axial[30, 30] == pytest.approx(220, abs=2)
    assert axial[30, 40] - axial[30, 20] == pytest.approx(10 * 20 * 12 / 61, rel=0.05)  # left is on the right
    assert axial[30, 55] == pytest.approx(20, abs=1)
    assert near.slice(PICTURE_AXES["coronal"])[55, 30] == pytest.approx(20, abs=1)


@pytest.mark.parametrize("name", ["L", "R"])
def test_bone_is_round_bright_in_the_middle_and_none_around(name):
    side = 1 if name == "L" else -1
    near = CloseUp(ball(), (2 + 4 * side, -3, 5), 12.0, 60)  # a place on the surface
    picture = near.bone(PICTURE_AXES[name], 120)
    radius = np.hypot(*np.meshgrid(*[(np.arange(60) - 29.5) * 0.2] * 2))
    assert (picture[radius < 3.5] > 0).all()
    assert (picture[radius > 4.6] == 0).all()
    middle, edge = picture[radius < 1].mean(), picture[(radius > 3) & (radius < 3.7)].mean()
    assert middle > 0.85
    assert edge < 0.85 * middle


def test_bone_before_a_place_is_cut_away():
    inside = CloseUp(ball(), (2, -3, 5), 12.0, 60).bone(PICTURE_AXES["L"], 120)
    deeper = CloseUp(ball(), (0, -3, 5), 12.0, 60).bone(PICTURE_AXES["L"], 120)
    assert inside[30, 30] == pytest.approx(1.0, abs=0.02)  # the flat cut
    assert (inside > 0).sum() > (deeper > 0).sum()  # a smaller circle of the ball


def test_an_oblique_scan_looks_the_same():
    angle = 0.5
    turned = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    volume = ball()
    centre = turned @ (np.array([2.0, -3.0, 5.0]) - [-6, -12, -7]) + [-6, -12, -7]
    rotated = Volume.from_parts(volume.array, volume.spacing, (-6, -12, -7), turned)
    right, down = (
        tuple(turned @ np.array(v)) for v in (PICTURE_AXES["axial"].right, PICTURE_AXES["axial"].down)
    )
    pictures = [
        CloseUp(volume, (2, -3, 5), 12.0, 40).slice(PICTURE_AXES["axial"]),
        CloseUp(rotated, centre, 12.0, 40).slice(PictureAxes("turned", right, down)),
    ]
    assert np.allclose(*pictures, atol=0.01, equal_nan=True)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Three specimens: one on a coarse phantom, one without a scan, one whose scan is lost."""
    folder = tmp_path_factory.mktemp("sheets")
    files = write_repeated(folder, 3, sittings=[("AB", 1)])
    state = read_specimen(files[0])
    for edit in (
        AnnotatePoint(Side.LEFT, "CA", "guess", "broken bulla"),
        MarkUnseen(Side.LEFT, "MH"),
    ):
        state = edit.apply(state)
    write_specimen(files[0], state.on_volume(VolumeReference("phantom-0", (9, 9, 9), (0.5, 0.5, 0.5)), {}))
    lost = VolumeReference("lost", (9, 9, 9), (1.0, 1.0, 1.0), path="/nowhere/lost.nrrd")
    write_specimen(files[2], read_specimen(files[2]).on_volume(lost, {}))
    return folder


def n_pages(pdf) -> int:
    return pdf.read_bytes().count(b"/Type /Page ")


def test_all_in_one_file_or_a_file_each(folder, tmp_path, capsys):
    assert main(["contact-sheet", str(folder), "-o", str(tmp_path / "all.pdf")]) == 1
    told = capsys.readouterr()
    assert "Contact sheets of 1 specimen: all.pdf" in told.out
    assert "GP1: it has no scan." in told.err
    assert "GP2: its scan is not at /nowhere/lost.nrrd." in told.err
    assert n_pages(tmp_path / "all.pdf") == 2
    made = MakeContactSheets(tuple(sorted(folder.glob("*.json")))[:2], tmp_path / "each").run(
        Progress(lambda fraction, text: None)
    )
    assert [file.name for file in made.files] == ["GP0_contact.pdf"]
    assert [file.name for file in (tmp_path / "each").iterdir()] == ["GP0_contact.pdf"]


def test_every_labelling_has_its_pages_where_asked_but_not_while_one_is_made_blind(tmp_path):
    (file,) = write_repeated(tmp_path, 1, codes=("CA",), sittings=[("AB", 1), ("CD", 1)])
    scan = VolumeReference("ball", (9, 9, 9), (1.0, 1.0, 1.0), path=str(write_ball(tmp_path / "ball.nrrd")))
    state = read_specimen(file).on_volume(scan, {})
    write_specimen(file, state)
    words = ["contact-sheet", str(file), "-o"]
    assert main([*words, str(tmp_path / "every.pdf"), "--all-labellings"]) == 0
    assert n_pages(tmp_path / "every.pdf") == 4
    write_specimen(file, BeginLabelling("EF").apply(state))  # which has nothing placed yet
    assert main([*words, str(tmp_path / "blind.pdf"), "--all-labellings"]) == 2
    assert not (tmp_path / "blind.pdf").exists()


def test_nothing_is_left_where_no_scan_can_be_opened(folder, tmp_path, capsys):
    file = str(folder / "GP1.gpspecimen.json")
    assert main(["contact-sheet", file, "-o", str(tmp_path / "x.pdf")]) == 2
    assert "no contact sheet could be made. GP1: it has no scan." in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_a_page_tells_what_is_known_of_each_label(folder):
    state = read_specimen(folder / "GP0.gpspecimen.json")
    told = []
    features = list(feature_pictures(state, Side.LEFT, ball(), 120.0, told.append))
    assert [each.code for each in features] == list(CODES)
    about = {each.code: each for each in features}
    assert about["CA"].note == "GUESS · broken bulla"
    assert (about["MH"].note, about["MH"].pictures) == ("not seen", None)
    assert about["CB"].pictures.shape == (150, 300, 3)
    assert about["CB"].pictures.min() >= 0
    assert about["CB"].pictures.max() <= 1
    figure = contact_page(state, Side.LEFT, features, "ball")
    words = {text.get_text() for axes in figure.axes for text in axes.texts} | {
        text.get_text() for text in figure.texts
    }
    assert {"CA  Cochlea apex", "GUESS · broken bulla", "GP0   left side"} <= words
    assert any("AB, round 1" in text for text in words)
    assert told == sorted(told)
