"""Arrays of pixels are drawn as Qt draws the same points one by one."""

from __future__ import annotations

import numpy as np
import pytest
from qtpy.QtCore import QLineF, QPointF
from qtpy.QtGui import QColor, QImage, QPainter, QPen
from window_cases import image_bytes

from gp_labeler.views.painting.qt_paths import draw_segments, polygon

pytestmark = pytest.mark.any_binding


def drawn(draw) -> np.ndarray:
    """Return what is drawn on black, enlarged, with a pen as wide as that of the edge of bone."""
    image = QImage(120, 90, QImage.Format.Format_RGB32)
    image.fill(QColor("#000000"))
    painter = QPainter(image)
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    pen = QPen(QColor(246, 190, 110, 190), 1.0)
    pen.setCosmetic(True)
    painter.setPen(pen)
    painter.scale(3.0, 3.0)
    draw(painter)
    painter.end()
    return image_bytes(image)


@pytest.fixture
def segments() -> np.ndarray:
    """Some in view, some across its edge, some beside it."""
    rng = np.random.default_rng(0)
    start = rng.uniform(-20, 60, (300, 1, 2))
    return np.concatenate([start, start + rng.normal(0, 2, start.shape)], axis=1)


def test_segments_are_drawn_as_qt_draws_each(qapp, segments) -> None:
    def one_by_one(painter: QPainter) -> None:
        for line in segments:
            painter.drawLine(QLineF(*line.ravel().tolist()))

    expected = drawn(one_by_one)
    assert expected.any()
    assert np.array_equal(drawn(lambda painter: draw_segments(painter, segments)), expected)


def test_any_array_of_segments_is_drawn_alike(qapp, segments) -> None:
    whole = drawn(lambda painter: draw_segments(painter, segments))
    every_other = np.repeat(segments, 2, axis=0)[::2]
    assert np.array_equal(drawn(lambda painter: draw_segments(painter, every_other)), whole)
    single = segments.astype(np.float32)
    double = single.astype(np.float64)
    assert np.array_equal(
        drawn(lambda painter: draw_segments(painter, single)),
        drawn(lambda painter: draw_segments(painter, double)),
    )


def test_no_segments_draw_nothing(qapp) -> None:
    assert not drawn(lambda painter: draw_segments(painter, np.empty((0, 2, 2)))).reshape(-1, 4)[:, :3].any()


def test_a_polygon_has_the_points_of_its_array(qapp) -> None:
    points = np.array([[0.0, 1.5], [-2.25, 1e6], [3.0, 4.0]])
    assert list(polygon(points)) == [QPointF(x, y) for x, y in points.tolist()]
