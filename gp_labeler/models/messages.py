"""What the models tell the user, and what was written to disk."""

from __future__ import annotations

from gp_core.terminal import printable
from gp_labeler.document.signals import Signal

__all__ = ["Messages"]


class Messages:
    """Announces texts for the user, and files."""

    said = Signal(str, str)
    """Text, and ``info``, ``warning`` or ``error``."""
    wrote = Signal(str, object)
    """What was written, and its file: ``pose``, ``report``, ``path`` (to follow with the robot), ``atlas`` or
    ``picture``; ``landmarks`` comes with the `ExportReport`, ``measurements`` with several files."""

    def say(self, text: str, level: str = "info") -> None:
        """Tell the user something."""
        self.said.emit(printable(text), level)
