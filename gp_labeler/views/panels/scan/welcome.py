"""The start page: what to open, what was opened before, and which steps follow."""

from __future__ import annotations

from pathlib import Path

from qtpy.QtCore import QEvent, QSize, Qt, Signal
from qtpy.QtGui import QDragEnterEvent, QDragLeaveEvent, QDropEvent, QResizeEvent, QShowEvent
from qtpy.QtWidgets import (
    QBoxLayout,
    QHBoxLayout,
    QLabel,
    QPushButton,
    QSizePolicy,
    QVBoxLayout,
    QWidget,
)

from gp_core.landmarks.features import Side
from gp_labeler.models.workspace import Workspace
from gp_labeler.views.feature_picture import FeaturePicture
from gp_labeler.views.fonts import elided, fit, font_of, pixels, text_width
from gp_labeler.views.icons import icon, icon_pixmap
from gp_labeler.views.layouts import STRETCH, in_column, in_row, wide
from gp_labeler.views.panels.action_button import Actions, do_action
from gp_labeler.views.panels.flow import FlowLayout
from gp_labeler.views.panels.parts import emptied, scrolled
from gp_labeler.views.stylesheet import set_role
from gp_labeler.views.theme import theme_of

__all__ = ["Welcome", "dropped_path"]

_STEPS = (
    ("scan", "Open a scan", "Any micro-CT: NRRD, NIfTI, DICOM, TIFF or BMP stacks. Bone appears at once."),
    (
        "label",
        "Place three features",
        "CA, RWP and OS. Then the atlas predicts the others.",
    ),
    ("export", "Export both sides", "Landmark files for 3D Slicer and for atlases."),
    ("pose", "Estimate a cochlea", "From a few touched points of another animal, with or without a scan."),
)
_N_RECENT, _AROUND = 7, 24


class Welcome(QWidget):
    """Shown where no scan is open.

    Parameters
    ----------
    workspace : Workspace
        Whose recent files it lists.
    actions : mapping of str to QAction
        What its buttons do.
    """

    path_chosen = Signal(str)

    def __init__(self, workspace: Workspace, actions: Actions, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._workspace, self._actions = workspace, actions
        self._icons: list[tuple[QLabel, str]] = []
        self._button_icons: list[tuple[QPushButton, str, bool]] = []
        self.setAttribute(Qt.WidgetAttribute.WA_StyledBackground)
        self.setProperty("role", "panel")
        self.setAcceptDrops(True)
        self._drop = _text("Drop a scan, a folder, a specimen or an atlas anywhere on this page", "hint")
        self._lay_out()
        self.setFocusProxy(self.open_scan)
        self.refresh()

    def refresh(self) -> None:
        """List the recent files again."""
        emptied(self._recent)
        self._button_icons = [entry for entry in self._button_icons if entry[0].objectName() != "recent"]
        recent = self._workspace.recent
        paths = [path for path in (recent.all() if recent else ()) if path.exists()][:_N_RECENT]
        for path in paths:
            self._recent.addWidget(self._recent_button(path))
        if not paths:
            self._recent.addWidget(_text("No recent files.", "hint", wrap=True))
        self._recent.addStretch(1)
        self._tint()

    def _lay_out(self) -> None:
        page = QWidget()
        fit(page, lambda: page.setMaximumWidth(pixels(page, 820)))
        column = in_column(STRETCH, self._head(), margins=(32, 24, 32, 24), spacing=8, of=page)
        column.addSpacing(12)
        column.addLayout(self._buttons())
        column.addSpacing(4)
        column.addWidget(self._drop)
        column.addSpacing(16)
        self._lower = QBoxLayout(QBoxLayout.Direction.LeftToRight)
        self._lower.setSpacing(24)
        self._recent = QVBoxLayout()
        self._recent.setSpacing(2)
        for name, below in (("Recent", self._recent), ("How it works", self._tutorial())):
            part = in_column(_text(name, "heading"), below)
            self._lower.addLayout(part, 1)
        column.addLayout(self._lower)
        column.addStretch(2)
        self._put(page)

    def _head(self) -> QHBoxLayout:
        """Return the title with a drawing of the head beside it."""
        words = in_column(STRETCH, spacing=4)
        title = _text("Label a guinea-pig head", "hero")
        words.addWidget(title)
        what = "20 features on each side of a micro-CT, on bone and on slices."
        words.addWidget(_text(what, "hint", wrap=True))
        words.addStretch(1)
        self.picture = FeaturePicture()
        self.picture.show_feature("IN", Side.RIGHT)
        fit(self.picture, lambda: self.picture.setFixedSize(pixels(self, 300), pixels(self, 150)))
        return in_row(wide(words), self.picture, spacing=24)

    def _put(self, page: QWidget) -> None:
        """Centre the page, and let it scroll in a small window."""
        middle = QWidget()
        middle.setProperty("role", "panel")
        in_row(STRETCH, wide(page, 8), STRETCH, margins=0, of=middle)
        in_column(scrolled(middle), margins=0, of=self)

    def _buttons(self) -> FlowLayout:
        row = FlowLayout(spacing=8)
        self.open_scan = self._big("Open scan…", "scan", "primary", "A file or folder with a micro-CT")
        self.open_specimen = self._big("Open specimen…", "file", "", "Continue with a saved specimen")
        self.specimens = self._big("All specimens…", "layout", "", "List of the specimens in your folders")
        self.demo = self._big("Try a demo head", "play", "", "A synthetic head for practice; takes seconds")
        for button, id in (
            (self.open_scan, "file.open"),
            (self.open_specimen, "file.open"),
            (self.specimens, "file.specimens"),
            (self.demo, "file.demo"),
        ):
            do_action(button, self._actions[id])
            row.addWidget(button)
        return row

    def _big(self, text: str, icon_name: str, role: str, hint: str) -> QPushButton:
        button = QPushButton(text)
        button.setProperty("role", role)
        fit(button, lambda: button.setMinimumHeight(pixels(button, 40)))
        fit(button, lambda: button.setIconSize(QSize(pixels(button, 18), pixels(button, 18))))
        button.setToolTip(hint)
        self._button_icons.append((button, icon_name, role == "primary"))
        return button

    def _tutorial(self) -> QVBoxLayout:
        column = QVBoxLayout()
        column.setSpacing(10)
        for icon_name, title, text in _STEPS:
            row, words, picture = QHBoxLayout(), QVBoxLayout(), QLabel()
            words.setSpacing(0)
            row.setSpacing(10)
            self._icons.append((picture, icon_name))
            words.addWidget(_text(title, ""))
            words.addWidget(_text(text, "hint", wrap=True))
            row.addWidget(picture, 0, Qt.AlignmentFlag.AlignTop)
            row.addLayout(words, 1)
            column.addLayout(row)
        column.addStretch(1)
        return column

    def _recent_button(self, path: Path) -> QPushButton:
        button = _RecentButton(path)
        button.clicked.connect(lambda: self.path_chosen.emit(str(path)))
        self._button_icons.append((button, "folder" if path.is_dir() else "file", False))
        return button

    def _tint(self) -> None:
        """Draw the icons in the colours of the theme."""
        theme = theme_of(self)
        size = pixels(self, 20)
        for label, name in self._icons:
            label.setFixedSize(size, size)
            label.setPixmap(icon_pixmap(name, theme.accent_text, size, self.devicePixelRatioF()))
        for button, name, primary in self._button_icons:
            button.setIcon(icon(name, theme.on_accent if primary else theme.accent_text))

    def _welcome_drop(self, over: bool) -> None:
        set_role(self._drop, "good" if over else "hint")

    def resizeEvent(self, event: QResizeEvent) -> None:  # noqa: D102, N802 - Qt's name
        is_wide, ways = event.size().width() >= pixels(self, 720), QBoxLayout.Direction
        self.picture.setVisible(is_wide)
        self._lower.setDirection(ways.LeftToRight if is_wide else ways.TopToBottom)
        super().resizeEvent(event)

    def minimumSizeHint(self) -> QSize:  # noqa: D102, N802 - Qt's name
        return QSize(pixels(self, 320), pixels(self, 120))

    def changeEvent(self, event: QEvent) -> None:  # noqa: D102, N802 - Qt's name
        super().changeEvent(event)
        if event.type() is QEvent.Type.StyleChange and hasattr(self, "_recent"):
            self._tint()

    def showEvent(self, event: QShowEvent) -> None:  # noqa: D102, N802 - Qt's name
        self.refresh()
        super().showEvent(event)

    def dragEnterEvent(self, event: QDragEnterEvent) -> None:  # noqa: D102, N802 - Qt's name
        if dropped_path(event) is not None:
            event.acceptProposedAction()
            self._welcome_drop(True)

    def dragLeaveEvent(self, event: QDragLeaveEvent) -> None:  # noqa: D102, N802 - Qt's name
        self._welcome_drop(False)

    def dropEvent(self, event: QDropEvent) -> None:  # noqa: D102, N802 - Qt's name
        self._welcome_drop(False)
        path = dropped_path(event)
        if path is not None:
            event.acceptProposedAction()
            self.path_chosen.emit(str(path))


class _RecentButton(QPushButton):
    """A file opened before: its name, shortened where there is no room, and the folder where there is."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self._path = path
        self.setObjectName("recent")
        self.setProperty("role", "link")
        self.setToolTip(str(path))
        self.setAccessibleName(f"Open {path.name}")
        self.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Fixed)
        fit(self, self._shorten)

    def _shorten(self) -> None:
        font, room = font_of(self), self.width() - self.iconSize().width() - _AROUND
        whole = f"{self._path.name}   in {self._path.parent.name}"
        fits = text_width(self, whole) <= room
        self.setText(whole if fits else elided(font, self._path.name, max(room, 0)))

    def resizeEvent(self, event: QResizeEvent) -> None:  # noqa: N802 - Qt's name
        super().resizeEvent(event)
        self._shorten()


def dropped_path(event: QDropEvent) -> Path | None:
    """Return the first local file or folder that is dragged; None where there is none."""
    for url in event.mimeData().urls():
        if url.isLocalFile():
            return Path(url.toLocalFile())
    return None


def _text(words: str, role: str, *, wrap: bool = False) -> QLabel:
    label = QLabel(words)
    if role:
        label.setProperty("role", role)
    label.setWordWrap(wrap)
    return label
