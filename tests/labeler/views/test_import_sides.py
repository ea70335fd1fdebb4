"""What the import dialogs say of left and right, and the preview that lies straight along the head."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import tifffile
from document_cases import head_frame
from panel_cases import deliver, place

from gp_core.errors import GpError
from gp_core.frames import RigidTransform
from gp_core.landmarks.features import Side
from gp_labeler import head_pose
from gp_labeler.document.head_edits import SetHeadFrame
from gp_labeler.document.landmark_export import export_landmarks
from gp_labeler.head_pose import HeadPose
from gp_labeler.imaging.preview import straight_preview_planes
from gp_labeler.imaging.readers import inspect_volume
from gp_labeler.imaging.volume import Volume
from gp_labeler.views.panels.label.landmark_import_dialog import LandmarkImportDialog
from gp_labeler.views.panels.parts import Notice
from gp_labeler.views.panels.scan.import_dialog import ImportDialog
from gp_labeler.views.panels.scan.import_wording import facts_of

TILTED = head_frame((20.0, -35.0, 50.0), (2.0, -3.0, 1.0)).T_head_scan


@pytest.fixture
def stack(tmp_path) -> Path:
    """Slices whose files say nothing of sides; brighter at one side and at one end."""
    for k in range(20):
        plane = np.full((30, 50), 20, np.uint8)
        plane[10:20, 5:15] = 120 + 3 * k
        tifffile.imwrite(tmp_path / f"GP-014_{k:04d}.tif", plane)
    return tmp_path


def head_with_a_mark(in_head: np.ndarray) -> Volume:
    """A dim ball, and one bright spot at a place of the tilted head."""
    n, step = 48, 0.5
    index = np.indices((n, n, n)).reshape(3, -1)[::-1].T
    middle = TILTED.inverse().translation
    start = middle - step * (n - 1) / 2
    points = TILTED.apply(start + step * index)
    values = np.where(np.linalg.norm(points, axis=1) < 10, 40, 0)
    values[np.linalg.norm(points - in_head, axis=1) < 1.5] = 255
    return Volume.from_parts(values.reshape(n, n, n).astype(np.uint8), (step,) * 3, start)


def test_a_straightened_preview_shows_left_at_the_right_and_superior_at_the_top() -> None:
    axial, _ = straight_preview_planes(head_with_a_mark(np.array([7.0, -4.0, 0.0])), TILTED)
    rows, columns = np.nonzero(axial.grey > 200)
    assert axial.letters == "RLPA"
    assert columns.mean() > 0.75 * axial.grey.shape[1]
    assert rows.mean() < 0.4 * axial.grey.shape[0]
    _, coronal = straight_preview_planes(head_with_a_mark(np.array([7.0, 0.0, 4.0])), TILTED)
    rows, columns = np.nonzero(coronal.grey > 200)
    assert coronal.letters == "RLIS"
    assert columns.mean() > 0.75 * coronal.grey.shape[1]
    assert rows.mean() < 0.4 * coronal.grey.shape[0]


def test_the_preview_is_straightened_where_bone_tells_how(workspace, stack, parent, monkeypatch) -> None:
    pose = HeadPose(TILTED, "symmetry", None, "", "")
    monkeypatch.setattr(head_pose, "straighten", lambda volume, **_: pose)
    dialog = ImportDialog(workspace, inspect_volume(stack), parent=parent)
    deliver(workspace)
    assert dialog.straight.text().startswith("The head is shown straightened")
    assert "nothing in the scan can prove" in dialog.straight.text()
    assert all(picture.plane.aspect == 1.0 for picture in dialog.pictures)
    dialog.reject()


def test_the_preview_stays_as_stored_where_the_head_is_refused(workspace, stack, parent, monkeypatch) -> None:
    def refuse(volume: Volume, **_: object) -> HeadPose:
        raise GpError("there is almost no bone")

    monkeypatch.setattr(head_pose, "straighten", refuse)
    dialog = ImportDialog(workspace, inspect_volume(stack), parent=parent)
    deliver(workspace)
    assert dialog.straight.text().startswith("As stored")
    assert dialog.pictures[0].plane.grey.shape == (30, 50)
    dialog.reject()


@pytest.mark.parametrize(
    ("direction", "where"),
    [
        (np.eye(3), "later columns"),
        (np.diag([-1.0, 1.0, 1.0]), "earlier columns"),
        (np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]]), "later slices"),
    ],
)
def test_where_the_file_says_left_is(tmp_path, direction, where) -> None:
    import SimpleITK as sitk  # noqa: N813

    image = sitk.GetImageFromArray(np.zeros((8, 9, 10), np.int16))
    image.SetDirection(direction.ravel().tolist())
    image.SetSpacing((0.1, 0.1, 0.1))
    sitk.WriteImage(image, str(tmp_path / "head.nrrd"))
    left = facts_of(inspect_volume(tmp_path / "head.nrrd"))["Left"]
    assert left == f"towards {where}, as the file says; nothing in the scan can prove it"


def test_points_to_import_on_the_other_side_of_the_head_are_said_first(workspace, tmp_path, parent) -> None:
    place(workspace, "CA", "CB")
    export_landmarks(workspace.document.state, tmp_path)
    for code in ("CA", "CB"):
        workspace.labels.clear(side=Side.LEFT, code=code)
    file = tmp_path / "unnamed_L.mrk.json"

    def said() -> list[tuple[str, str]]:
        dialog = LandmarkImportDialog(workspace, [file], parent=parent)
        found = [(notice.level, notice.words) for notice in dialog.findChildren(Notice)]
        dialog.reject()
        return found

    assert [level for level, _ in said()] == ["info"]  # not straightened: nothing can be said
    workspace.document.do(SetHeadFrame(head_frame((0, 0, 0), (0, 0, 0))))
    assert [level for level, _ in said()] == ["info"]
    turned = RigidTransform.from_parts(np.diag([-1.0, -1.0, 1.0]), np.zeros(3), dst="head", src="scan")
    workspace.document.do(SetHeadFrame(type(workspace.head.frame).of(turned)))
    _, (level, warning) = said()
    assert level == "warning"
    assert "on the right of the mid-plane, and 1 more" in warning
    assert "nothing in the scan can prove it" in warning
    assert not workspace.document.landmarks(Side.LEFT).placed
