"""The four views, each under its coloured header: all of them, two beside each other, or one alone."""

from __future__ import annotations

from qtpy.QtCore import QEvent, QSize, Qt, Signal
from qtpy.QtGui import QColor, QMouseEvent, QPainter, QPaintEvent, QResizeEvent
from qtpy.QtWidgets import QLabel, QSizePolicy, QSplitter, QToolButton, QWidget

from gp_core.landmarks.features import feature
from gp_core.validation import FloatArray
from gp_labeler.models.workspace import Workspace
from gp_labeler.scene.planes import Plane
from gp_labeler.views.filter_words import filter_hint, filter_words
from gp_labeler.views.fonts import HEADING, fit, line_height, pixels, text_width
from gp_labeler.views.formatting import number_text, value_text
from gp_labeler.views.icons import icon
from gp_labeler.views.layouts import STRETCH, in_column, in_row, wide
from gp_labeler.views.scene_view import SceneView
from gp_labeler.views.signals import follow
from gp_labeler.views.slice_slider import SliceSlider
from gp_labeler.views.slice_view import SliceView
from gp_labeler.views.theme import theme_of

__all__ = ["ViewFrame", "ViewGrid"]

_HEADER_HEIGHT, _GAP = 24, 6
_ROWS = (("3d", "axial"), ("sagittal", "coronal"))
CLOSE_MM = 12.0
"""Across a view that looks closely at a point."""

JUDGED_PIXELS = 2.0
"""Logical pixels that the smallest voxel edge must cover for a person to judge a position."""


class ViewHeader(QWidget):
    """A bar with the view's colour, its name, where it is, and a button to maximise it.

    Parameters
    ----------
    name : str
        ``3d``, ``axial``, ``sagittal`` or ``coronal``.
    """

    maximise_asked = Signal()

    def __init__(self, name: str, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Fixed)
        self._name = name
        self.title = title = QLabel("3D" if name == "3d" else name.capitalize())
        title.setProperty("role", "heading")
        self.where = QLabel()
        self.where.setProperty("role", "hint")
        self.filters = QLabel()
        self.filters.setProperty("role", "warning")
        self._filter_words: tuple[str, ...] = ()
        self._button = QToolButton()
        self._button.setProperty("role", "quiet")
        self._button.setStyleSheet("padding: 0")
        self._button.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self._button.setToolTip("Maximise or restore this view (double click)")
        self._button.setAccessibleName(f"Maximise the {name} view")
        self._button.clicked.connect(self.maximise_asked)
        self._row = in_row(
            title, self.where, self.filters, STRETCH, self._button, margins=(10, 0, 2, 0), spacing=8, of=self
        )
        self._slider: SliceSlider | None = None
        fit(self, self._fit)
        self.take_theme()

    def add(self, slider: SliceSlider) -> None:
        """Put a slider before the button, where there is room for it."""
        self._slider = slider
        self._row.insertWidget(self._row.count() - 1, slider)

    def say_title(self, words: str) -> None:
        """Say what the view shows."""
        self.title.setText(words)
        self._leave_out()

    def say_where(self, words: str) -> None:
        """Say beside the name where the view is."""
        self.where.setText(words)
        self._leave_out()

    def say_filters(self, *words: str, hint: str = "") -> None:
        """Say that not the slice itself is shown, in the first of these words that there is room for."""
        self._filter_words = words
        self.filters.setToolTip(hint)
        self.filters.setAccessibleName(hint)
        self._leave_out()

    def _fit(self) -> None:
        """Give bar and button a size that goes with the text."""
        self.setFixedHeight(max(pixels(self, _HEADER_HEIGHT), line_height(self, HEADING) + 4))
        self._button.setFixedSize(pixels(self, 24), self.height() - 4)
        self._button.setIconSize(QSize(pixels(self, 14), pixels(self, 14)))
        self._leave_out()

    def _leave_out(self) -> None:
        """In a narrow view leave out the slider and where it is, and say filters shortly: no word is cut."""
        room = self.width() - self.title.sizeHint().width() - self._button.width() - 3 * self._row.spacing()
        room -= self._row.contentsMargins().left() + self._row.contentsMargins().right()
        fitting = [words for words in self._filter_words if text_width(self.filters, words) <= room]
        said = (*fitting, *self._filter_words[-1:], "")[0]
        self.filters.setText(said)
        self.filters.setVisible(bool(said))
        room -= text_width(self.filters, said) + self._row.spacing() if said else 0
        words = self.where.sizeHint().width() if self.where.text() else 0
        self.where.setVisible(words <= room)
        if self._slider is not None:
            self._slider.set_room(words + self._row.spacing() + self._slider.minimumWidth() <= room)

    @property
    def least_width(self) -> int:
        """The width at which its name is whole, logical pixels."""
        margins = self._row.contentsMargins()
        around = margins.left() + margins.right() + 3 * self._row.spacing()
        return self.title.sizeHint().width() + self._button.minimumWidth() + around

    def resizeEvent(self, event: QResizeEvent) -> None:  # noqa: N802
        super().resizeEvent(event)
        self._leave_out()

    def take_theme(self) -> None:
        """Draw in the colours of the window's theme."""
        self._button.setIcon(icon("layout", theme_of(self).muted, size=14))

    def paintEvent(self, _: QPaintEvent) -> None:  # noqa: N802
        theme = theme_of(self)
        painter = QPainter(self)
        painter.fillRect(self.rect(), QColor(theme.card))
        painter.fillRect(0, 0, 3, self.height(), QColor(theme.views[self._name]))
        painter.end()

    def mouseDoubleClickEvent(self, _: QMouseEvent) -> None:  # noqa: N802
        self.maximise_asked.emit()

    def changeEvent(self, event: QEvent) -> None:  # noqa: N802
        if event.type() == QEvent.Type.StyleChange:
            self.take_theme()
        super().changeEvent(event)


class ViewFrame(QWidget):
    """A view under its header.

    Parameters
    ----------
    name : str
        See `ViewHeader`.
    view : SceneView or SliceView
        The view.
    """

    maximise_asked = Signal(str)

    def __init__(self, name: str, view: SceneView | SliceView) -> None:
        super().__init__()
        self.name, self.view = name, view
        self.header = ViewHeader(name)
        in_column(self.header, wide(view), margins=0, spacing=0, of=self)
        if isinstance(view, SliceView):
            self.header.add(SliceSlider(view))
        self.header.maximise_asked.connect(self._ask)
        view.maximise_asked.connect(self._ask)

    def _ask(self) -> None:
        self.maximise_asked.emit(self.name)


class ViewGrid(QWidget):
    """3D and axial above, sagittal and coronal below; 3D and one slice side by side; any of them alone.

    Parameters
    ----------
    workspace : Workspace
        What is shown; its view says in which layout.
    """

    hovered = Signal(object)
    """(3,) scan position under the pointer in any view, or None."""

    def __init__(self, workspace: Workspace, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._workspace = workspace
        self.scene_view = SceneView(workspace)
        self.slice_views = {plane: SliceView(workspace, plane) for plane in Plane}
        self.frames = {"3d": ViewFrame("3d", self.scene_view)}
        self.frames |= {p.value: ViewFrame(p.value, self.slice_views[p]) for p in Plane}
        self._rows = [self._row(*names) for names in _ROWS]
        self._column = QSplitter(Qt.Orientation.Vertical)
        for row in self._rows:
            self._column.addWidget(row)
        self._column.setSizes([1000, 1000])
        in_column(self._column, margins=0, of=self)
        self.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Expanding)
        self._narrow = False
        self._beside, self._several = "axial", "four-up"
        fit(self, self._ask_for_room)
        self._listen()
        self._lay_out()
        workspace.interaction.visible_area = self

    @property
    def views(self) -> tuple[SceneView | SliceView, ...]:
        """The four views."""
        return (self.scene_view, *self.slice_views.values())

    @property
    def shown(self) -> tuple[str, ...]:
        """Names of the views that the layout shows."""
        layout = self._workspace.view.state.layout
        four = _ROWS[0] if self._narrow else (*_ROWS[0], *_ROWS[1])
        return {"four-up": four, "two-up": ("3d", self._beside)}.get(layout, (layout,))

    @property
    def name_here(self) -> str:
        """Name of the view under the pointer, else of the one that takes the keys, else ``3d``."""
        shown = [frame for frame in self.frames.values() if frame.isVisible()]
        under = [frame.name for frame in shown if frame.underMouse()]
        return next(iter(under + [frame.name for frame in shown if frame.view.hasFocus()]), "3d")

    def reset(self) -> None:
        """Show everything in every view."""
        for view in self.views:
            view.reset()

    def _show_closely(self, position: FloatArray) -> None:
        for view in self.slice_views.values():
            view.zoom_to(position, CLOSE_MM)

    def hides(self, position: FloatArray) -> bool:
        """Whether bone hides a (3,) scan position in the 3D view."""
        return bool(self.scene_view.scene.hidden(position)[0])

    def can_judge(self, position: FloatArray) -> bool:
        """Whether a painted view shows a (3,) scan position with voxels at least two logical pixels wide.

        A view that is still to be painted does not count: nobody has seen the position in it.
        """
        return any(view.is_up_to_date for view in self._close_views(position))

    def bring_close(self, position: FloatArray) -> None:
        """Show a (3,) scan position in every view closely enough to judge it; a closer view stays so."""
        volume = self._workspace.scan.volume
        if volume is None:
            return
        for view in self.views:
            side = min(view.width(), view.height())
            close = min(CLOSE_MM, side * min(volume.spacing) / (2 * JUDGED_PIXELS))
            view.zoom_to(position, min(close, view.across_mm))
        if not self._close_views(position):  # such as what bone hides in the 3D view, shown alone
            self._workspace.view.update(layout="four-up")

    def release(self) -> None:
        """Let go of scene and voxels."""
        for view in self.views:
            view.release()

    def _close_views(self, position: FloatArray) -> list[SceneView | SliceView]:
        """Return the visible views that show a position closely enough to judge it, once they are painted."""
        volume = self._workspace.scan.volume
        if volume is None:
            return []
        voxel = min(volume.spacing)
        return [v for v in self.views if v.isVisible() and v.voxel_pixels(position, voxel) >= JUDGED_PIXELS]

    def _row(self, left: str, right: str) -> QSplitter:
        row = QSplitter(Qt.Orientation.Horizontal)
        for name in (left, right):
            row.addWidget(self.frames[name])
        row.setSizes([1000, 1000])
        row.setChildrenCollapsible(False)
        row.setHandleWidth(_GAP)
        return row

    def _listen(self) -> None:
        self._column.setChildrenCollapsible(False)
        self._column.setHandleWidth(_GAP)
        for frame in self.frames.values():
            frame.maximise_asked.connect(self._maximise)
            frame.view.hovered.connect(self.hovered)
        for plane, view in self.slice_views.items():
            view.moved.connect(lambda mm, p=plane: self._say_where(p, mm))
        follow(self, self._workspace.view.changed, self._on_view_changed)
        follow(self, self._workspace.view.reset_asked, self.reset)
        follow(self, self._workspace.view.close_look_asked, self.bring_close)
        follow(self, self._workspace.view.close_up_asked, self._show_closely)
        follow(self, self._workspace.view.planes_changed, self._say_titles)
        follow(self, self._workspace.scan.threshold_changed, self._say_threshold)
        follow(self, self._workspace.document.reset, self._on_reset)
        follow(self, self._workspace.view.planes_changed, self._say_filters)
        follow(self, self._workspace.labels.active_changed, self._show_best)

    def _maximise(self, name: str) -> None:
        view = self._workspace.view
        view.update(layout=self._several if view.state.layout == name else name)

    def _on_view_changed(self, changed: frozenset[str]) -> None:
        if "layout" in changed:
            layout = self._workspace.view.state.layout
            self._several = layout if layout in ("four-up", "two-up") else self._several
            self._lay_out()
        if changed & {"slab", "denoise"}:
            self._say_filters()

    def _say_filters(self) -> None:
        """Say in the header of each slice view that it shows a slab, or less noise than the scan has."""
        state = self._workspace.view.state
        for plane, view in self.slice_views.items():
            mm = state.slab.mm if state.slab is not None else 0.0
            if state.slab is not None and view.source is not None:
                mm = view.source.thickness(view.slice_plane, state.slab)
            words, hint = filter_words(state, mm), filter_hint(state, mm)
            self.frames[plane.value].header.say_filters(*words, hint=hint)

    def _show_best(self, *_: object) -> None:
        """Beside the 3D view, show the slice view in which the active feature is best seen."""
        code = self._workspace.labels.active.code
        best = self._beside if code is None else feature(code).view.lower()
        if best in self.frames and best not in ("3d", self._beside):
            self._beside = best
            if self._workspace.view.state.layout == "two-up":
                self._lay_out()

    def _on_reset(self) -> None:
        self._lay_out()
        self._say_filters()
        self._say_titles()
        for frame in self.frames.values():
            frame.header.say_where("")

    def _say_titles(self) -> None:
        for plane in Plane:
            header, title = self.frames[plane.value].header, self._workspace.view.title(plane.value)
            if header.title.text() != title:
                header.say_title(title)
                self._ask_for_room()

    def _ask_for_room(self) -> None:
        """Ask for the width of one view, in which no word of a header is cut."""
        headers = [frame.header.least_width for frame in self.frames.values()]
        self._least = max(self.scene_view.minimumWidth(), *headers)
        self.setMinimumWidth(self._least)
        self._check_room()

    def _check_room(self) -> None:
        """Show two views, one over the other, where the panel leaves no room for two beside each other."""
        narrow = self.width() < 2 * self._least + _GAP
        if narrow != self._narrow:
            self._narrow = narrow
            self._rows[0].setOrientation(Qt.Orientation.Vertical if narrow else Qt.Orientation.Horizontal)
            self._lay_out()

    def resizeEvent(self, event: QResizeEvent) -> None:  # noqa: D102, N802
        super().resizeEvent(event)
        self._check_room()

    def _lay_out(self) -> None:
        shown, rows = self.shown, self._arranged()
        for row, names in zip(self._rows, rows, strict=True):
            if [row.indexOf(self.frames[name]) for name in names] != list(range(row.count())):
                for n, name in enumerate(names):
                    row.insertWidget(n, self.frames[name])
                row.setSizes([1000] * len(names))
        for name, frame in self.frames.items():
            frame.setVisible(name in shown)
        for row, names in zip(self._rows, rows, strict=True):
            row.setVisible(not set(names).isdisjoint(shown))

    def _arranged(self) -> tuple[tuple[str, ...], ...]:
        """Return which views lie in which row: in the first, those of the layout with two."""
        if self._workspace.view.state.layout != "two-up":
            return _ROWS
        two = self.shown
        return two, tuple(name for name in self.frames if name not in two)

    def _say_where(self, plane: Plane, position: float) -> None:
        view = self._workspace.view
        words = view.frame.position_text(view.planes[plane.value], position)
        if view.is_turned(plane.value):
            words = f"{number_text(position, 1, signed=True)} mm"
        elif view.frame.name == "head":
            words += " in the head"
        self.frames[plane.value].header.say_where(words)

    def _say_threshold(self, threshold: float | None) -> None:
        self.frames["3d"].header.say_where("" if threshold is None else f"bone above {value_text(threshold)}")
