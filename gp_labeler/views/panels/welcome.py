"""The first page: what to open, what was open before, and how it goes on."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtCore import QEvent, QSize, Qt, Signal
from PySide6.QtGui import QDragEnterEvent, QDragLeaveEvent, QDropEvent, QResizeEvent, QShowEvent
from PySide6.QtWidgets import (
    QFrame,
    QGridLayout,
    QHBoxLayout,
    QLabel,
    QPushButton,
    QScrollArea,
    QSizePolicy,
    QVBoxLayout,
    QWidget,
)

from gp_core.landmarks.features import Side
from gp_labeler.views.bind import set_role
from gp_labeler.views.feature_picture import FeaturePicture
from gp_labeler.views.icons import icon, icon_pixmap
from gp_labeler.views.panels.parts import emptied
from gp_labeler.views.theme import theme_of
from gp_labeler.workbench import Workbench

__all__ = ["Welcome", "dropped_path"]

_STEPS = (
    ("scan", "Open a scan", "Any micro-CT: NRRD, NIfTI, DICOM, TIFF or BMP stacks. Bone appears at once."),
    (
        "label",
        "Place three features",
        "CA, RWP and OS. From then on the atlas shows where the others should be.",
    ),
    ("export", "Export both sides", "Landmark files that open in 3D Slicer and feed the atlas."),
    ("pose", "Estimate a cochlea", "From a few touched points of another animal, with or without a scan."),
)
_N_RECENT = 7


class Welcome(QWidget):
    """Shown where no scan is open.

    Parameters
    ----------
    workbench : Workbench
        Whose recent files it lists.
    actions : object, optional
        Not needed here; all panels are made alike.
    """

    open_scan_asked = Signal()
    open_specimen_asked = Signal()
    demo_asked = Signal()
    path_chosen = Signal(str)

    def __init__(self, workbench: Workbench, actions: object = None, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._workbench = workbench
        self._icons: list[tuple[QLabel, str, int]] = []
        self._button_icons: list[tuple[QPushButton, str, bool]] = []
        self.setAttribute(Qt.WidgetAttribute.WA_StyledBackground)
        self.setProperty("role", "panel")
        self.setAcceptDrops(True)
        self._drop = _text("Drop a scan, a folder, a specimen or an atlas anywhere on this page", "hint")
        self._lay_out()
        self.refresh()

    def refresh(self) -> None:
        """List the recent files anew."""
        emptied(self._recent)
        self._button_icons = [entry for entry in self._button_icons if entry[0].objectName() != "recent"]
        recent = self._workbench.recent
        paths = [path for path in (recent.all() if recent else ()) if path.exists()][:_N_RECENT]
        for path in paths:
            self._recent.addWidget(self._recent_button(path))
        if not paths:
            self._recent.addWidget(
                _text("Nothing yet. What you open will be listed here.", "hint", wrap=True)
            )
        self._recent.addStretch(1)
        self._tint()

    def _lay_out(self) -> None:
        page = QWidget()
        page.setMaximumWidth(820)
        column = QVBoxLayout(page)
        column.setContentsMargins(32, 24, 32, 24)
        column.setSpacing(8)
        column.addStretch(1)
        column.addLayout(self._head())
        column.addSpacing(12)
        column.addLayout(self._buttons())
        column.addSpacing(4)
        column.addWidget(self._drop)
        column.addSpacing(16)
        lower = QGridLayout()
        lower.setHorizontalSpacing(24)
        lower.setColumnStretch(0, 1)
        lower.setColumnStretch(1, 1)
        self._recent = QVBoxLayout()
        self._recent.setSpacing(2)
        lower.addWidget(_text("Recent", "heading"), 0, 0)
        lower.addWidget(_text("How it goes", "heading"), 0, 1)
        lower.addLayout(self._recent, 1, 0)
        lower.addLayout(self._tutorial(), 1, 1)
        column.addLayout(lower)
        column.addStretch(2)
        self._put(page)

    def _head(self) -> QHBoxLayout:
        """Return the title with a drawing of the head beside it."""
        words = QVBoxLayout()
        words.setSpacing(4)
        words.addStretch(1)
        title = _text("Label a guinea-pig head", "hero")
        words.addWidget(title)
        what = "20 features on each side of a micro-CT, on bone and on slices."
        words.addWidget(_text(what, "hint", wrap=True))
        words.addStretch(1)
        self.picture = FeaturePicture()
        self.picture.show_feature("IN", Side.RIGHT)
        self.picture.setFixedSize(300, 150)
        row = QHBoxLayout()
        row.setSpacing(24)
        row.addLayout(words, 1)
        row.addWidget(self.picture)
        return row

    def _put(self, page: QWidget) -> None:
        """Centre the page, and let it scroll in a small window."""
        middle = QWidget()
        middle.setProperty("role", "panel")
        row = QHBoxLayout(middle)
        row.setContentsMargins(0, 0, 0, 0)
        row.addStretch(1)
        row.addWidget(page, 8)
        row.addStretch(1)
        scroll = QScrollArea()
        scroll.setWidgetResizable(True)
        scroll.setFrameShape(QFrame.Shape.NoFrame)
        scroll.setWidget(middle)
        scroll.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        layout = QVBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.addWidget(scroll)

    def _buttons(self) -> QHBoxLayout:
        row = QHBoxLayout()
        row.setSpacing(8)
        self.open_scan = self._big("Open scan…", "scan", "primary", "A file or folder with a micro-CT")
        self.open_specimen = self._big("Open specimen…", "file", "", "Go on with a labelled specimen")
        self.demo = self._big("Try a demo head", "play", "", "A synthetic head to practise on; takes seconds")
        self.open_scan.clicked.connect(self.open_scan_asked)
        self.open_specimen.clicked.connect(self.open_specimen_asked)
        self.demo.clicked.connect(self.demo_asked)
        for button in (self.open_scan, self.open_specimen, self.demo):
            row.addWidget(button)
        row.addStretch(1)
        return row

    def _big(self, text: str, icon_name: str, role: str, hint: str) -> QPushButton:
        button = QPushButton(text)
        button.setProperty("role", role)
        button.setMinimumHeight(40)
        button.setIconSize(QSize(18, 18))
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
            self._icons.append((picture, icon_name, 20))
            picture.setFixedSize(20, 20)
            words.addWidget(_text(title, ""))
            words.addWidget(_text(text, "hint", wrap=True))
            row.addWidget(picture, 0, Qt.AlignmentFlag.AlignTop)
            row.addLayout(words, 1)
            column.addLayout(row)
        column.addStretch(1)
        return column

    def _recent_button(self, path: Path) -> QPushButton:
        button = QPushButton()
        button.setObjectName("recent")
        button.setProperty("role", "link")
        button.setToolTip(str(path))
        button.setAccessibleName(f"Open {path.name}")
        folder = path.parent.name
        words = button.fontMetrics().elidedText(path.name, Qt.TextElideMode.ElideMiddle, 230)
        button.setText(f"{words}   in {folder}" if folder and len(path.name) + len(folder) < 34 else words)
        button.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Fixed)
        button.clicked.connect(lambda: self.path_chosen.emit(str(path)))
        self._button_icons.append((button, "folder" if path.is_dir() else "file", False))
        return button

    def _tint(self) -> None:
        """Draw the icons in the colours of the theme."""
        theme = theme_of(self)
        for label, name, size in self._icons:
            label.setPixmap(icon_pixmap(name, theme.accent_text, size, self.devicePixelRatioF()))
        for button, name, primary in self._button_icons:
            button.setIcon(icon(name, theme.on_accent if primary else theme.accent_text))

    def _welcome_drop(self, over: bool) -> None:
        set_role(self._drop, "good" if over else "hint")

    def resizeEvent(self, event: QResizeEvent) -> None:  # noqa: D102, N802 - Qt's name
        self.picture.setVisible(event.size().width() >= 720)
        super().resizeEvent(event)

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
