"""One suggestion of a page: its close views with the place marked, its name, and what becomes of it."""

from __future__ import annotations

from qtpy.QtCore import QPointF, QRectF, QSize, Qt, Signal
from qtpy.QtGui import QColor, QFontMetricsF, QImage, QPainter, QPaintEvent, QPen
from qtpy.QtWidgets import QAbstractButton, QSizePolicy, QWidget

from gp_core.landmarks.features import feature
from gp_labeler.jobs.close_views import CloseView
from gp_labeler.models.suggestion_pages import PageEntry
from gp_labeler.views.fonts import CAPTION, fit, font_of, pixels
from gp_labeler.views.formatting import mm_text
from gp_labeler.views.layouts import in_column, in_row, wide
from gp_labeler.views.panels.parts import text_label
from gp_labeler.views.stylesheet import set_role
from gp_labeler.views.theme import theme_of

__all__ = ["CloseViewTile"]

_SUGGESTED = "#6FC1F8"
_GAP, _CROSS, _OPEN = 4, 11.0, 4.0
"""Between the pictures; arms of the cross, and the gap in its middle, that shows the place itself."""


class _ClosePictures(QWidget):
    """The two pictures, each with a cross at the suggestion and a circle of its 95 % radius."""

    drawn = Signal()
    """All of it was on the screen."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._view: CloseView | None = None
        self._radius: float | None = None
        self._words = ""
        self.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        fit(self, lambda: self.setMinimumSize(pixels(self, 220), pixels(self, 108)))

    def show_view(self, view: CloseView | None, radius: float | None, words: str) -> None:
        """Show close views, with a radius in mm, or words in their place."""
        self._view, self._radius, self._words = view, radius, words
        self.update()

    def sizeHint(self) -> QSize:  # noqa: N802 - Qt's name
        return QSize(pixels(self, 340), pixels(self, 108))  # they take the room that there is

    def paintEvent(self, event: QPaintEvent) -> None:  # noqa: N802 - Qt's name
        painter = QPainter(self)
        painter.setRenderHints(QPainter.RenderHint.Antialiasing | QPainter.RenderHint.SmoothPixmapTransform)
        if self._view is None:
            painter.setPen(QColor(theme_of(self).muted))
            painter.drawText(QRectF(self.rect()), Qt.AlignmentFlag.AlignCenter, self._words)
        else:
            for box, n in zip(self._boxes(), (0, 1), strict=True):
                self._paint(painter, box, self._view, n)
        painter.end()
        if self._view is not None and self.visibleRegion().boundingRect() == self.rect():
            self.drawn.emit()

    def _boxes(self) -> tuple[QRectF, QRectF]:
        """Return where the two pictures are: square, and as large as there is room."""
        edge = min((self.width() - _GAP) / 2, float(self.height()))
        left, top = (self.width() - 2 * edge - _GAP) / 2, (self.height() - edge) / 2
        return QRectF(left, top, edge, edge), QRectF(left + edge + _GAP, top, edge, edge)

    def _paint(self, painter: QPainter, box: QRectF, view: CloseView, n: int) -> None:
        rgb = view.pictures[n]
        rows, columns = rgb.shape[:2]
        image = QImage(rgb.data, columns, rows, 3 * columns, QImage.Format.Format_RGB888)
        painter.save()
        painter.setClipRect(box)
        painter.drawImage(box, image)
        self._mark(painter, box, view.across_mm)
        self._name(painter, box, view.names[n])
        painter.restore()

    def _mark(self, painter: QPainter, box: QRectF, across_mm: float) -> None:
        """Draw cross and circle: light, with a dark edge, for slices are dark and bone is light."""
        middle = box.center()
        arms = [
            (middle + QPointF(x, y) * _OPEN, middle + QPointF(x, y) * _CROSS)
            for x, y in ((1, 0), (-1, 0), (0, 1), (0, -1))
        ]
        for colour, width in ((QColor(0, 0, 0, 170), 3.0), (QColor(_SUGGESTED), 1.3)):
            painter.setPen(QPen(colour, width))
            for start, end in arms:
                painter.drawLine(start, end)
            if self._radius is not None:
                radius = self._radius / across_mm * box.width()
                painter.drawEllipse(middle, radius, radius)

    def _name(self, painter: QPainter, box: QRectF, name: str) -> None:
        """Write which plane it is, at the foot, on a ground of its own: pictures are dark and light."""
        painter.setFont(font_of(self, CAPTION))
        metrics = QFontMetricsF(painter.font())
        width, height = metrics.horizontalAdvance(name) + 6, metrics.height() + 2
        ground = QRectF(box.left() + 2, box.bottom() - height - 2, width, height)
        painter.fillRect(ground, QColor("#000000"))
        painter.setPen(QColor("#FFFFFF"))
        painter.drawText(ground, Qt.AlignmentFlag.AlignCenter, name)


class CloseViewTile(QAbstractButton):
    """A suggestion on a page; a click, or Space, marks it as one to look at in the views."""

    shown = Signal(object)
    """The `PageEntry` whose close views were on the screen as a whole."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.entry: PageEntry | None = None
        self.setCheckable(True)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.heading, self.state = text_label(role="heading"), text_label(role="hint", wrap=True)
        self.how_sure, self.pictures = text_label(role="hint"), _ClosePictures()
        self.pictures.drawn.connect(lambda: self.shown.emit(self.entry))
        top = in_row(wide(self.heading), self.how_sure, margins=0)
        parts = (top, self.state, wide(self.pictures))
        self._column = in_column(*parts, margins=(8, 5, 8, 8), spacing=3, of=self)
        for part in (self.heading, self.state, self.how_sure):
            part.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)

    def show_entry(self, entry: PageEntry) -> None:
        """Show a suggestion as it stands."""
        self.entry = entry
        suggestion, row = entry.suggestion, feature(entry.code)
        self.setChecked(entry.is_marked and suggestion is not None)
        self.heading.setText(entry.name)
        self.heading.setToolTip(row.name)
        words, role = _state_words(entry)
        self.state.setText(f"{row.name}: {words}")
        set_role(self.state, role)
        self.how_sure.setText(_sure_words(entry))
        waiting = "Drawing…" if suggestion is not None else "Decided"
        self.pictures.show_view(
            entry.close_view, None if suggestion is None else suggestion.radius_95, waiting
        )
        self.setAccessibleName(f"{entry.name}, {row.name}: {words}")
        self.update()

    def sizeHint(self) -> QSize:  # noqa: D102, N802 - Qt's name
        return self._column.sizeHint()

    def minimumSizeHint(self) -> QSize:  # noqa: D102, N802 - Qt's name
        return self._column.minimumSize()

    def paintEvent(self, event: QPaintEvent) -> None:  # noqa: D102, N802 - Qt's name
        theme = theme_of(self)
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        is_doubtful = self.entry is not None and bool(self.entry.refusal)
        colour, width = theme.border_strong, 1.0
        if self.isChecked() or is_doubtful:
            colour, width = theme.warning, 2.0
        if self.hasFocus():
            colour, width = theme.focus, 3.0
        painter.setPen(QPen(QColor(colour), width))
        painter.setBrush(QColor(theme.selected if self.isChecked() else theme.card))
        edge = width / 2
        painter.drawRoundedRect(QRectF(self.rect()).adjusted(edge, edge, -edge, -edge), 7, 7)
        painter.end()


def _state_words(entry: PageEntry) -> tuple[str, str]:
    """Return what becomes of a suggestion, and the look of these words."""
    if entry.suggestion is None:
        return "decided", "good"
    if entry.refusal:
        return f"look at it in the views: {entry.refusal}", "warning"
    if entry.is_marked:
        return "marked, to look at in the views", "warning"
    return "to confirm", "hint"


def _sure_words(entry: PageEntry) -> str:
    """Return how far off it may be, in words."""
    if entry.suggestion is None or entry.suggestion.radius_95 is None or entry.sd is None:
        return ""
    return f"95 % within {mm_text(entry.suggestion.radius_95)}, SD {mm_text(entry.sd)}"
