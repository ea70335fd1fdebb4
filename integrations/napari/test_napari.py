"""The plugin in a real napari: its model of layers, found by its manifest, without a display."""

from pathlib import Path

import numpy as np
import pytest

import gp_core
from gp_core.study.drawn_labels import draw_labels

npe2 = pytest.importorskip("npe2")
components = pytest.importorskip("napari.components")


@pytest.fixture
def viewer():
    """Return napari's viewer without its window; it finds plugins as it does when it starts."""
    npe2.PluginManager.instance().discover()
    return components.ViewerModel()


@pytest.mark.parametrize("ending", [".mrk.json", ".fcsv"])
def test_what_is_read_is_written_again(viewer, tmp_path: Path, ending: str) -> None:
    (left, _) = draw_labels(tmp_path, 1)
    landmarks = gp_core.read_landmarks(left)
    (layer,) = viewer.open(left, plugin="gp-labeler-napari")
    assert list(layer.features["label"]) == list(landmarks.placed)
    np.testing.assert_allclose(layer.data[0][::-1], landmarks["CA"])
    written = tmp_path / f"again_L{ending}"
    assert layer.save(str(written), plugin="gp-labeler-napari") == [str(written)]
    again = gp_core.read_landmarks(written)
    for code in landmarks.placed:
        np.testing.assert_allclose(again[code], landmarks[code], atol=1e-6)


def test_a_specimen_becomes_a_layer_for_each_side(viewer, tmp_path: Path) -> None:
    from gp_labeler.document.specimen_json import state_of

    file = tmp_path / "GP1.gpspecimen.json"
    points = {"L": {"CA": {"position": [1.0, 2.0, 3.0]}}, "R": {"CB": {"position": [4.0, 5.0, 6.0]}}}
    document = {"specimen": "GP1", "landmarks": points}
    assert state_of(document).specimen == "GP1"
    import json

    file.write_text(json.dumps({"format": "gp-labeler specimen", "version": 3, **document}))
    layers = viewer.open(file, plugin="gp-labeler-napari")
    assert [layer.name for layer in layers] == ["GP1_L", "GP1_R"]
    np.testing.assert_allclose(layers[0].data, [[3.0, 2.0, 1.0]])


def test_a_name_without_a_side_is_refused(viewer, tmp_path: Path) -> None:
    layer = viewer.add_points(np.zeros((1, 3)), features={"label": ["CA"]})
    with pytest.raises(gp_core.GpError, match="does not say the side"):
        layer.save(str(tmp_path / "points.fcsv"), plugin="gp-labeler-napari")
