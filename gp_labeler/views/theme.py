"""Colours, type and spacing of the window, dark and light.

A theme is put on a top-level widget with `apply_theme`; whatever lies inside asks `theme_of` when it paints
itself, and hears of a change as Qt's own style change event.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from qtpy.QtGui import QColor, QPalette
from qtpy.QtWidgets import QApplication, QWidget

from gp_labeler.scene.colours import DARK as DARK_SCENE
from gp_labeler.scene.colours import LIGHT as LIGHT_SCENE
from gp_labeler.scene.colours import SceneColours, contrast
from gp_labeler.views.fonts import base_font, set_text_scale
from gp_labeler.views.stylesheet import stylesheet

__all__ = [
    "DARK",
    "LIGHT",
    "THEMES",
    "Theme",
    "apply_theme",
    "contrast",
    "theme_of",
]

_PROPERTY = "gpTheme"

_VIEWS_DARK = MappingProxyType(
    {"3d": "#5CB8F5", "axial": "#F34A33", "sagittal": "#EDD54C", "coronal": "#6EB04B"}
)
_VIEWS_LIGHT = MappingProxyType(
    {"3d": "#1273BE", "axial": "#D2331D", "sagittal": "#A88A00", "coronal": "#4A8A2A"}
)


@dataclass(frozen=True, eq=False)
class Theme:
    """The colours of the window, as ``#RRGGBB``.

    Parameters
    ----------
    name : str
        ``dark`` or ``light``.
    window, panel, card, raised, hover, field : str
        Backgrounds: between the views, of panels, of cards, of buttons, under the pointer, of entry fields.
    border, border_strong : str
        Around cards, and around what can be clicked or typed into.
    text, muted, faint : str
        Words to read, beside them, and hints; all legible on every background.
    accent, on_accent, accent_hover, accent_text : str
        The one next action, what is written on it, and links.
    selected : str
        Background of the row being worked on.
    focus : str
        Around what the keys go to: stands out from every background, and from the accent.
    warning, danger, good : str
        What to look at, what stands against it, what is done.
    states : mapping
        Colour of each state of a point, by its name in `PointState`, and ``active`` and ``locked``.
    views : mapping
        Colour of each view: ``3d``, ``axial``, ``sagittal``, ``coronal``.
    scene : SceneColours
        What the scene draws with.
    """

    name: str
    window: str
    panel: str
    card: str
    raised: str
    hover: str
    field: str
    border: str
    border_strong: str
    text: str
    muted: str
    faint: str
    accent: str
    accent_hover: str
    on_accent: str
    accent_text: str
    selected: str
    focus: str
    warning: str
    danger: str
    good: str
    states: Mapping[str, str]
    views: Mapping[str, str] = dataclasses.field(default_factory=lambda: _VIEWS_DARK)
    scene: SceneColours = DARK_SCENE

    @property
    def is_dark(self) -> bool:
        """Whether words are lighter than what they stand on."""
        return self.name == "dark"

    def state(self, name: str) -> QColor:
        """Return the colour of a state."""
        return QColor(self.states[name])

    def palette(self) -> QPalette:
        """Return the same as a Qt palette, for what no style sheet reaches."""
        palette, role = QPalette(), QPalette.ColorRole
        for which, colour in (
            (role.Window, self.panel),
            (role.WindowText, self.text),
            (role.Base, self.field),
            (role.AlternateBase, self.card),
            (role.Text, self.text),
            (role.Button, self.raised),
            (role.ButtonText, self.text),
            (role.BrightText, self.danger),
            (role.Highlight, self.accent),
            (role.HighlightedText, self.on_accent),
            (role.PlaceholderText, self.faint),
            (role.Link, self.accent_text),
            (role.ToolTipBase, self.raised),
            (role.ToolTipText, self.text),
        ):
            palette.setColor(which, QColor(colour))
        for which in (role.WindowText, role.Text, role.ButtonText):
            palette.setColor(QPalette.ColorGroup.Disabled, which, QColor(self.faint))
        return palette


DARK = Theme(
    name="dark",
    window="#0E1318",
    panel="#141A21",
    card="#1A212A",
    raised="#242D38",
    hover="#2E3946",
    field="#10161C",
    border="#2A343F",
    border_strong="#5B6B7C",
    text="#E8EDF2",
    muted="#A9B5C1",
    faint="#98A5B2",
    accent="#2A6FB8",
    accent_hover="#2D76C2",
    on_accent="#FFFFFF",
    accent_text="#7CC4FA",
    selected="#22364B",
    focus="#B9E1FF",
    warning="#F6B44C",
    danger="#FF8086",
    good="#6FE3B4",
    states=MappingProxyType(
        {
            "to do": "#98A5B2",
            "ghost": "#6FC1F8",
            "suggested": "#6FC1F8",
            "placed": "#F6A43C",
            "checked": "#A6DB6C",
            "doubtful": "#FF7B81",
            "unseen": "#A9B5C1",
            "computed": "#6FE3B4",
            "active": "#FFFFFF",
            "locked": "#A9B5C1",
        }
    ),
)

LIGHT = Theme(
    name="light",
    window="#E3E8ED",
    panel="#F4F6F8",
    card="#FFFFFF",
    raised="#FFFFFF",
    hover="#E8EDF3",
    field="#FFFFFF",
    border="#D3DAE1",
    border_strong="#8492A0",
    text="#18222C",
    muted="#475563",
    faint="#5A6775",
    accent="#1C67B3",
    accent_hover="#17568F",
    on_accent="#FFFFFF",
    accent_text="#125FA8",
    selected="#D9E8F7",
    focus="#0B1620",
    warning="#8A5200",
    danger="#B3202B",
    good="#08704A",
    states=MappingProxyType(
        {
            "to do": "#5A6775",
            "ghost": "#0F66A9",
            "suggested": "#0F66A9",
            "placed": "#9A5200",
            "checked": "#3F6D12",
            "doubtful": "#B81C27",
            "unseen": "#475563",
            "computed": "#08704A",
            "active": "#101820",
            "locked": "#475563",
        }
    ),
    views=_VIEWS_LIGHT,
    scene=LIGHT_SCENE,
)

THEMES: Mapping[str, Theme] = MappingProxyType({theme.name: theme for theme in (DARK, LIGHT)})


def apply_theme(target: QWidget | QApplication, theme: Theme, *, text_scale: float = 1.0) -> None:
    """Give a window, with all that it holds and opens, the look of a theme.

    Parameters
    ----------
    target : QWidget or QApplication
    theme : Theme
    text_scale : float
        How large text is drawn, 1 for normal; see `fonts`.
    """
    target.setProperty(_PROPERTY, theme.name)
    set_text_scale(target, text_scale)
    target.setFont(base_font(text_scale))
    target.setPalette(theme.palette())
    target.setStyleSheet(stylesheet(theme, text_scale))


def theme_of(widget: QWidget | None) -> Theme:
    """Return the theme that a widget is drawn in: that of its window, or of the one that opened it."""
    while widget is not None:
        window = widget.window()
        name = window.property(_PROPERTY)
        if name in THEMES:
            return THEMES[name]
        widget = window.parentWidget()
    app = QApplication.instance()
    return THEMES.get(app.property(_PROPERTY), DARK) if app is not None else DARK
