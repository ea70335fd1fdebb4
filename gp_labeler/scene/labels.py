"""The labels of everything in the 3D view, placed together so that none lies on another."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gp_core.validation import FloatArray
from gp_labeler.scene.camera import Viewpoint
from gp_labeler.scene.label_layout import lines_within, place_labels
from gp_labeler.scene.sprites import SpriteSheet, Text
from gp_labeler.scene.stage import Stage

__all__ = ["LABEL_PIXELS", "Label", "LabelActor"]

_WIDE_LETTERS = 1.1
"""How much wider than the mean of its text some of its letters may be."""

LABEL_PIXELS = 13.0
"""Font size, logical pixels."""


@dataclass(frozen=True, eq=False)
class Label:
    """A text beside a point on the screen.

    Parameters
    ----------
    text : Text
        What it says.
    anchor : (2,) float array
        The pixel it belongs to.
    gap : float
        How far from there it begins, pixels.
    rank : float
        Labels of a higher rank are placed earlier; a positive one is never left out.
    faint : bool
        Whether what it names is hidden.
    """

    text: Text
    anchor: FloatArray
    gap: float
    rank: float = 0.0
    faint: bool = False


class LabelActor:
    """Draws labels.

    Parameters
    ----------
    stage : Stage
        Where to draw.
    """

    def __init__(self, stage: Stage) -> None:
        self._stage = stage
        self._sheet = SpriteSheet(stage.overlay)
        self._written: tuple[object, ...] = ()
        self.visible = True

    def refresh(self, view: Viewpoint, labels: Sequence[Label]) -> None:
        """Draw these labels in place of those before."""
        shown_labels = list(labels) if self.visible else []
        self._write(tuple(label.text for label in shown_labels))
        wide = self._sheet.sizes[:, 0] > view.size[0] if shown_labels else ()
        if np.any(wide):
            self._write(tuple(map(self._broken(view.size[0]), (label.text for label in shown_labels))))
        anchors = np.array([label.anchor for label in shown_labels]).reshape(-1, 2)
        corners, shown = place_labels(
            anchors,
            self._sheet.sizes,
            view.size,
            gaps=[label.gap for label in shown_labels],
            ranks=[label.rank for label in shown_labels],
        )
        faint = np.array([label.faint for label in shown_labels], dtype=bool)
        self._sheet.draw(np.flatnonzero(shown), corners[shown], faint[shown])

    def _broken(self, width: int) -> Callable[[Text], Text]:
        """Return what breaks a text into lines that are no longer than the view."""
        sizes = dict(zip(self._written[0], self._sheet.sizes[:, 0], strict=True))  # type: ignore[call-overload]

        def broken(text: Text) -> Text:
            letter = sizes[text] / max(len(text.text), 1) * _WIDE_LETTERS
            lines = lines_within(text.text, width, lambda words: letter * len(words))
            return replace(text, text="\n".join(lines))

        return broken

    def close(self) -> None:
        """Let go of the texts."""
        self._sheet.close()

    def _write(self, texts: tuple[Text, ...]) -> None:
        height = LABEL_PIXELS * self._stage.scale * self._stage.text_scale
        wanted = (texts, height, self._stage.colours.halo)
        if wanted != self._written:
            self._sheet.write(texts, height, self._stage.colours.halo)
            self._written = wanted
