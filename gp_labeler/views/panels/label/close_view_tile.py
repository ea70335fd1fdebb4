"""One suggestion of a page: its close views with the place marked, its name, and what becomes of it."""

from __future__ import annotations

from qtpy.QtCore import QPoint, QPointF, QRectF, QSize, Qt, Signal
from qtpy.QtGui import (
    QColor,
    QFontMetricsF,
    QImage,
    QKeyEvent,
    QMouseEvent,
    QPainter,
    QPaintEvent,
    QPen,
    QWheelEvent,
)
from qtpy.QtWidgets import QAbstractButton, QSizePolicy, QWidget

from gp_core.landmarks.features import feature
from gp_labeler.models.suggestion_pages import PageEntry
from gp_labeler.scene.gestures import Modifier
from gp_labeler.views.fonts import CAPTION, fit, font_of, pixels
from gp_labeler.views.formatting import mm_text
from gp_labeler.views.layouts import in_column, in_row, wide
from gp_labeler.views.mouse import modifiers_of, notches_of, painted, pixel_of
from gp_labeler.views.panels.parts import text_label
from gp_labeler.views.stylesheet import set_role
from gp_labeler.views.theme import theme_of

__all__ = ["CloseViewTile"]

_SUGGESTED, _PLACED = "#6FC1F8", "#F6A43C"
_GAP, _CROSS, _OPEN = 4, 11.0, 4.0
"""Between the pictures; arms of the cross, and the gap in its middle, that shows the place itself."""

_FAINT = 0.5
"""How strong the cross is in a slice beside the place."""


class _ClosePictures(QWidget):
    """The two pictures, each with a cross at the place and a circle of the suggestion's 95 % radius."""

    drawn = Signal()
    """All of it was on the screen."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._entry: PageEntry | None = None
        self.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        fit(self, lambda: self.setMinimumSize(pixels(self, 220), pixels(self, 108)))

    def show_entry(self, entry: PageEntry) -> None:
        """Show the close view of a suggestion, or words while it has none."""
        self._entry = entry
        self.update()

    def place_at(self, where: QPointF) -> tuple[int, float, float] | None:
        """Return the picture at a point, and how far across and down it that is, 0 to 1; None beside them."""
        for number, box in enumerate(self._boxes() if self._entry and self._entry.pictures else ()):
            if box.contains(where):
                across, down = (where.x() - box.left()) / box.width(), (where.y() - box.top()) / box.height()
                return number, across, down
        return None

    def is_slice(self, number: int) -> bool:
        """Whether a picture is a slice, not bone."""
        return self._entry is not None and self._entry.pictures[number].depths is None

    def point_of(self, number: int, across: float, down: float) -> QPointF:
        """Return the point of this widget at which a picture shows a place."""
        box = self._boxes()[number]
        return box.topLeft() + QPointF(across * box.width(), down * box.height())

    def sizeHint(self) -> QSize:  # noqa: N802 - Qt's name
        return QSize(pixels(self, 340), pixels(self, 108))  # they take the room that there is

    def paintEvent(self, event: QPaintEvent) -> None:  # noqa: N802 - Qt's name
        painter = QPainter(self)
        painter.setRenderHints(QPainter.RenderHint.Antialiasing | QPainter.RenderHint.SmoothPixmapTransform)
        entry = self._entry
        if entry is not None and entry.pictures:
            for number, box in enumerate(self._boxes()):
                self._paint(painter, box, entry, number)
        elif entry is not None:
            painter.setPen(QColor(theme_of(self).muted))
            words = "Decided" if entry.position is None else "Drawing…"
            painter.drawText(QRectF(self.rect()), Qt.AlignmentFlag.AlignCenter, words)
        painter.end()
        if entry is not None and entry.pictures and self.visibleRegion().boundingRect() == self.rect():
            self.drawn.emit()

    def _boxes(self) -> tuple[QRectF, QRectF]:
        """Return where the two pictures are: square, and as large as there is room."""
        edge = min((self.width() - _GAP) / 2, float(self.height()))
        left, top = (self.width() - 2 * edge - _GAP) / 2, (self.height() - edge) / 2
        return QRectF(left, top, edge, edge), QRectF(left + edge + _GAP, top, edge, edge)

    def _paint(self, painter: QPainter, box: QRectF, entry: PageEntry, number: int) -> None:
        picture, off = entry.pictures[number], entry.mm_off_slice(number)
        rows, columns = picture.rgb.shape[:2]
        image = QImage(picture.rgb.data, columns, rows, 3 * columns, QImage.Format.Format_RGB888)
        painter.save()
        painter.setClipRect(box)
        painter.drawImage(box, image)
        painter.setOpacity(_FAINT if off else 1.0)
        self._mark(painter, entry, number)
        painter.setOpacity(1.0)
        self._name(painter, box, f"{picture.name}\n{mm_text(off)} away" if off else picture.name)
        painter.restore()

    def _mark(self, painter: QPainter, entry: PageEntry, number: int) -> None:
        """Draw cross and circle: light, with a dark edge, for slices are dark and bone is light."""
        middle = self.point_of(number, *entry.place_in(number))
        arms = [
            (middle + QPointF(x, y) * _OPEN, middle + QPointF(x, y) * _CROSS)
            for x, y in ((1, 0), (-1, 0), (0, 1), (0, -1))
        ]
        radius = entry.radius_in(number) * self._boxes()[number].width()
        colour = _PLACED if entry.suggestion is None else _SUGGESTED
        for ink, width in ((QColor(0, 0, 0, 170), 3.0), (QColor(colour), 1.3)):
            painter.setPen(QPen(ink, width))
            for start, end in arms:
                painter.drawLine(start, end)
            if radius:
                painter.drawEllipse(middle, radius, radius)

    def _name(self, painter: QPainter, box: QRectF, name: str) -> None:
        """Write which plane it is, at the foot, on a ground of its own: pictures are dark and light."""
        painter.setFont(font_of(self, CAPTION))
        size = QFontMetricsF(painter.font()).size(0, name)
        width, height = size.width() + 6, size.height() + 2
        ground = QRectF(box.left() + 2, box.bottom() - height - 2, width, height)
        painter.fillRect(ground, QColor("#000000"))
        painter.setPen(QColor("#FFFFFF"))
        painter.drawText(ground, Qt.AlignmentFlag.AlignCenter, name)


class CloseViewTile(QAbstractButton):
    """A suggestion on a page.

    A click, or Space, marks it as one to look at in the views; a click with Ctrl held says where the feature
    is, and the wheel turns a picture to another slice.
    """

    shown = Signal(object)
    """The `PageEntry` whose close views were on the screen as a whole."""
    pointed_at = Signal(int, float, float)
    """Where the feature is: which picture, how far across and down it, 0 to 1."""
    scrolled = Signal(int, float)
    """Which picture, and by how many slices."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.entry: PageEntry | None = None
        self.setCheckable(True)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setMouseTracking(True)
        self._is_pointing = False
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
        self.pictures.show_entry(entry)
        self.setAccessibleName(f"{entry.name}, {row.name}: {words}")
        self.update()

    def pixel_of_place(self, number: int, across: float, down: float) -> tuple[float, float]:
        """Return the logical pixel at which a picture shows a place, 0 to 1 across and down."""
        where = self._corner() + self.pictures.point_of(number, across, down)
        return where.x(), where.y()

    def mousePressEvent(self, event: QMouseEvent) -> None:  # noqa: D102, N802
        self._is_pointing = event.button() == Qt.MouseButton.LeftButton and self._is_held_to_point(event)
        if not self._is_pointing:
            super().mousePressEvent(event)

    def mouseMoveEvent(self, event: QMouseEvent) -> None:  # noqa: D102, N802
        self._show_cursor(self._is_held_to_point(event))
        super().mouseMoveEvent(event)

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:  # noqa: D102, N802
        if not self._is_pointing:
            super().mouseReleaseEvent(event)
            return
        self._is_pointing = False
        place = self._place_under(event)
        if place is not None:
            self.pointed_at.emit(*place)

    def wheelEvent(self, event: QWheelEvent) -> None:  # noqa: D102, N802
        place = self._place_under(event)
        is_over_slice = place is not None and self.pictures.is_slice(place[0])
        event.setAccepted(is_over_slice)  # beside the slices, the page scrolls
        if place is not None and is_over_slice:
            self.scrolled.emit(place[0], notches_of(event))

    def keyPressEvent(self, event: QKeyEvent) -> None:  # noqa: D102, N802
        if event.key() == Qt.Key.Key_Control:
            self._show_cursor(True)
        super().keyPressEvent(event)

    def keyReleaseEvent(self, event: QKeyEvent) -> None:  # noqa: D102, N802
        if event.key() == Qt.Key.Key_Control:
            self._show_cursor(False)
        super().keyReleaseEvent(event)

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

    def _is_held_to_point(self, event: QMouseEvent) -> bool:
        """Whether Ctrl is held over a picture."""
        return modifiers_of(event) == Modifier.CTRL and self._place_under(event) is not None

    def _place_under(self, event: QMouseEvent | QWheelEvent) -> tuple[int, float, float] | None:
        """Return the picture under the pointer, and how far across and down it."""
        where = painted(self, *pixel_of(self, event.position()))
        return self.pictures.place_at(where - self._corner())

    def _corner(self) -> QPointF:
        """Return where the pictures begin in this widget."""
        return QPointF(self.pictures.mapTo(self, QPoint(0, 0)))

    def _show_cursor(self, is_pointing: bool) -> None:
        self.setCursor(Qt.CursorShape.CrossCursor if is_pointing else Qt.CursorShape.ArrowCursor)


def _state_words(entry: PageEntry) -> tuple[str, str]:
    """Return what becomes of a suggestion, and the look of these words."""
    if entry.is_corrected:
        return "corrected, placed by you", "good"
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
