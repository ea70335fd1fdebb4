"""The Qt style sheet of a theme."""

from __future__ import annotations

from string import Template
from typing import TYPE_CHECKING

from qtpy.QtWidgets import QWidget

from gp_core.resources import resource_path
from gp_labeler.views.fonts import BIG, CAPTION, HEADING, TEXT, TITLE, families

if TYPE_CHECKING:
    from gp_labeler.views.theme import Theme

__all__ = ["set_role", "stylesheet"]

_TEMPLATE = Template("""
QMainWindow, QDialog { background: $panel; }
QWidget { color: $text; font-size: $text_px; font-family: $families; }
QWidget:disabled { color: $faint; }
QLabel { background: transparent; }
QToolTip { background: $raised; color: $text; border: 1px solid $border_strong; padding: 4px 6px; }

*[role="panel"] { background: $panel; }
*[role="card"] { background: $card; border: 1px solid $border; border-radius: 8px; }
*[role="rail"] { background: $window; border-right: 1px solid $border; }
QLabel[role="title"] { font-size: $title_px; font-weight: 600; }
QLabel[role="hero"] { font-size: $hero_px; font-weight: 600; }
QLabel[role="heading"] { font-size: $heading_px; font-weight: 600; }
QLabel[role="eyebrow"] { color: $muted; }
QLabel[role="hint"] { color: $muted; }
QLabel[role="ghost"] { color: $ghost; }
QLabel[role="shared"] { color: $good; }
QLabel[role="good"] { color: $good; }
QLabel[role="warning"] { color: $warning; }
QLabel[role="danger"] { color: $danger; }

QLabel[role="huge"] { font-size: $px64; font-weight: 700; }
QLabel[role="large"] { font-size: $px28; font-weight: 600; }
QLabel[role="big"] { font-size: $px20; }
QLabel[role="big-warning"] { font-size: $px20; color: $warning; }
QLabel[role="large-hint"] { font-size: $px20; color: $muted; }
QLabel[role="large-good"] { font-size: $px20; color: $good; }
QLabel[role="large-warning"] { font-size: $px20; color: $warning; }
QLabel[role="large-danger"] { font-size: $px20; color: $danger; }

QPushButton, QToolButton {
    background: $raised; border: 1px solid $border_strong; border-radius: 6px; padding: 5px 12px;
}
QToolButton { padding: 4px 6px; }
QPushButton:hover, QToolButton:hover { background: $hover; }
QPushButton:pressed, QToolButton:pressed, QToolButton:checked { background: $selected; }
QToolButton:checked { border-color: $accent_text; }
QPushButton:focus { border: 2px solid $focus; padding: 4px 11px; }
QToolButton:focus, QToolButton:checked:focus { border: 2px solid $focus; padding: 3px 5px; }
QPushButton:disabled, QToolButton:disabled { background: transparent; border-color: $border; color: $faint; }
QPushButton[role="primary"] {
    background: $accent; border-color: $accent; color: $on_accent; font-weight: 600;
}
QPushButton[role="primary"]:hover { background: $accent_hover; }
QPushButton[role="primary"]:focus { border: 2px solid $focus; padding: 4px 11px; }
QPushButton[role="primary"]:disabled { background: transparent; border-color: $border; color: $faint; }
QDialogButtonBox { button-layout: 3; }
QDialogButtonBox QPushButton:default {
    background: $accent; border-color: $accent; color: $on_accent; font-weight: 600;
}
QDialogButtonBox QPushButton:default:focus { border: 2px solid $focus; padding: 4px 11px; }
QPushButton[role="huge"] { font-size: $px22; padding: 8px 20px; }
QPushButton[role="huge-primary"] {
    font-size: $px28; font-weight: 600; background: $accent; border-color: $accent; color: $on_accent;
}
QPushButton[role="huge-primary"]:hover { background: $accent_hover; }
QPushButton[role="huge-primary"]:disabled { background: transparent; border-color: $border; color: $faint; }
QPushButton[role="link"] {
    background: transparent; border: 1px solid transparent; color: $accent_text;
    text-align: left; padding: 3px 6px;
}
QPushButton[role="link"]:hover { background: $hover; }
QPushButton[role="link"]:focus { border: 2px solid $focus; padding: 2px 5px; }
QPushButton[role="link"]:disabled { color: $faint; }
QToolButton[role="quiet"] { background: transparent; border-color: transparent; }
QToolButton[role="quiet"]:hover { background: $hover; }
QToolButton[role="quiet"]:focus { border: 2px solid $focus; }
QToolButton::menu-indicator { image: none; }

QLineEdit, QPlainTextEdit, QTextEdit, QComboBox, QAbstractSpinBox {
    background: $field; border: 1px solid $border_strong; border-radius: 5px; padding: 4px 6px;
    selection-background-color: $accent; selection-color: $on_accent;
    placeholder-text-color: $faint;
}
QLineEdit:focus, QPlainTextEdit:focus, QTextEdit:focus, QComboBox:focus, QAbstractSpinBox:focus {
    border: 2px solid $focus; padding: 3px 5px;
}
QAbstractSpinBox QLineEdit, QAbstractSpinBox QLineEdit:focus { border: none; padding: 0; }
QAbstractSpinBox::up-button, QAbstractSpinBox::down-button { width: 0; border: none; }
QLineEdit[wrong="true"] { border-color: $danger; }
QComboBox::drop-down { border: none; width: 22px; }
QComboBox::down-arrow { image: url("$icons/down.png"); width: $px12; height: $px12; }
QComboBox QAbstractItemView {
    background: $card; border: 1px solid $border_strong; selection-background-color: $accent;
    selection-color: $on_accent; outline: none;
}
QCheckBox, QRadioButton {
    spacing: 6px; padding: 1px 2px; background: transparent;
    border: 2px solid transparent; border-radius: 5px;
}
QCheckBox:focus, QRadioButton:focus { border-color: $focus; }
QCheckBox::indicator {
    width: $px14; height: $px14; background: $field; border: 1px solid $border_strong; border-radius: 4px;
}
QCheckBox::indicator:hover { border-color: $accent_text; }
QCheckBox::indicator:checked { background: $accent; border-color: $accent; image: url("$icons/tick.png"); }
QCheckBox::indicator:disabled { border-color: $border; }
QRadioButton::indicator {
    width: $px14; height: $px14; background: $field; border: 1px solid $border_strong; border-radius: $ring;
}
QRadioButton::indicator:checked {
    width: $dot; height: $dot; background: $on_accent; border: 5px solid $accent; border-radius: $ring;
}

QTableView, QListView, QTreeView {
    background: $card; border: 1px solid $border; border-radius: 8px; outline: none; gridline-color: $border;
    selection-background-color: $accent; selection-color: $on_accent;
}
QTableView:focus, QListView:focus, QTreeView:focus { border-color: $focus; }
QTableView::item { padding: 0 3px; }
QHeaderView { background: transparent; }
QHeaderView::section {
    background: transparent; color: $muted; border: none; border-bottom: 1px solid $border; padding: 4px 6px;
}
QTableCornerButton::section { background: $card; border: none; border-bottom: 1px solid $border; }
QListView::item { padding: 5px 8px; border-radius: 4px; }
QListView::item:hover { background: $hover; }
QListView::item:selected { background: $accent; color: $on_accent; }

QMenuBar { background: $window; color: $text; }
QMenuBar::item { padding: 4px 10px; background: transparent; border-radius: 4px; }
QMenuBar::item:selected { background: $accent; color: $on_accent; }
QMenu { background: $card; border: 1px solid $border_strong; padding: 4px; menu-scrollable: 1; }
QMenu::item { padding: 5px 24px 5px 12px; border-radius: 4px; }
QMenu::item:selected { background: $accent; color: $on_accent; }
QMenu::item:disabled { background: transparent; color: $faint; }
QMenu::item:disabled:selected { border: 1px solid $border_strong; }
QMenu::separator { height: 1px; background: $border; margin: 4px 8px; }
QToolBar { background: $window; border: none; spacing: 4px; padding: 4px 8px; }
QStatusBar { background: $window; border-top: 1px solid $border; color: $text; }
QStatusBar::item { border: none; }
QDockWidget::title { background: $panel; padding: 6px; }

QScrollArea { background: transparent; border: none; }
QScrollArea[role="page"] { border: 2px solid transparent; }
QScrollArea[role="page"]:focus { border-color: $focus; }
QScrollArea > QWidget > QWidget[role="panel"] { background: $panel; }
QScrollBar:vertical { background: transparent; width: 10px; margin: 2px; }
QScrollBar:horizontal { background: transparent; height: 10px; margin: 2px; }
QScrollBar::handle { background: $border_strong; border-radius: 3px; min-height: 24px; min-width: 24px; }
QScrollBar::handle:hover { background: $faint; }
QScrollBar::add-line, QScrollBar::sub-line, QScrollBar::add-page, QScrollBar::sub-page {
    background: none; border: none; height: 0; width: 0;
}
QSplitter::handle { background: $window; }
QSplitter::handle:hover { background: $border_strong; }

QProgressBar {
    background: $field; border: 1px solid $border; border-radius: 4px; text-align: center; height: 8px;
}
QProgressBar::chunk { background: $accent_hover; border-radius: 3px; }
QSlider { background: transparent; border: 2px solid transparent; border-radius: 5px; min-height: 20px; }
QSlider:focus { border-color: $focus; }
QSlider::groove:horizontal { background: $border_strong; border: none; height: 4px; border-radius: 2px; }
QSlider::sub-page:horizontal { background: $accent_hover; border-radius: 2px; }
QSlider::handle:horizontal {
    border: none; background: $text; width: 14px; height: 14px; margin: -5px 0; border-radius: 7px;
}
QSlider::sub-page:horizontal:disabled { background: $border_strong; }
QSlider::handle:horizontal:disabled { background: $faint; }
QTabBar::tab {
    background: transparent; color: $muted; padding: 6px 12px; border-bottom: 2px solid transparent;
}
QTabBar::tab:selected { color: $text; border-bottom-color: $accent_text; }
QTabWidget::pane { border: none; }
QGroupBox { border: none; margin-top: 20px; font-weight: 600; }
QGroupBox::title { subcontrol-origin: margin; left: 0; }
""")


def stylesheet(theme: Theme, text_scale: float = 1.0) -> str:
    """Return the style sheet for a window in this theme, with text that is so much larger than normal."""
    colours = {name: value for name, value in vars(theme).items() if isinstance(value, str)}
    icons = resource_path("icons/tick.png").parent.as_posix()
    quoted = ", ".join(f'"{name}"' for name in families())
    return _TEMPLATE.substitute(
        colours | _sizes(text_scale), ghost=theme.states["ghost"], icons=icons, families=quoted
    )


def set_role(widget: QWidget, role: str) -> None:
    """Give a widget one of the looks of the style sheet, also after it was shown."""
    if widget.property("role") != role:
        widget.setProperty("role", role)
        widget.style().unpolish(widget)
        widget.style().polish(widget)


def _sizes(scale: float) -> dict[str, str]:
    """Return lengths that grow with the text, as the template names them."""
    named = {"caption_px": CAPTION, "text_px": TEXT, "heading_px": HEADING, "title_px": TITLE, "hero_px": BIG}
    sizes = {name: max(round(size * scale), 1) for name, size in named.items()}
    sizes |= {f"px{size}": round(size * scale) for size in _LENGTHS}
    box = sizes["px14"]
    sizes |= {"dot": box - 8, "ring": box // 2 + 1}
    return {name: f"{size}px" for name, size in sizes.items()}


_LENGTHS = (12, 14, 20, 22, 28, 64)
