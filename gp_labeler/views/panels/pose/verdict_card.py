"""The card of the verdict: a person accepts or rejects the estimate."""

from __future__ import annotations

from qtpy.QtWidgets import QHBoxLayout, QLineEdit, QPushButton, QVBoxLayout, QWidget

from gp_labeler.document.state import PoseCheck
from gp_labeler.models.workspace import Workspace
from gp_labeler.views.fonts import field_width, fit
from gp_labeler.views.panels.parts import Card, Notice, emptied, text_label
from gp_labeler.views.signals import attempt, follow

__all__ = ["VerdictCard"]

_N_SHOWN = 3
_Moved = tuple[float, float]
"""How far an estimate is from the one that was judged, mm and degrees."""

_WHY = "Reason, in a few words"
_WORDS = {"accept": ("good", "Accepted"), "reject": ("error", "Rejected")}


class VerdictCard(Card):
    """Initials, a note, accept and reject; and what was said before.

    Parameters
    ----------
    workspace : Workspace
        Whose estimate is judged.
    """

    def __init__(self, workspace: Workspace, parent: QWidget | None = None) -> None:
        super().__init__("Verdict", parent)
        self._workspace = workspace
        self.initials, self.note = QLineEdit(), QLineEdit()
        self.initials.setPlaceholderText("Initials")
        self.initials.setAccessibleName("Initials of the reviewer")
        self.initials.setMaxLength(24)
        fit(self.initials, lambda: self.initials.setFixedWidth(field_width(self.initials, "Initials")))
        self.note.setPlaceholderText(_WHY)
        fit(self.note, lambda: self.note.setMinimumWidth(field_width(self.note, _WHY)))
        self.note.setAccessibleName("Note on the verdict")
        self.accept, self.reject = QPushButton("Accept"), QPushButton("Reject")
        self.accept.setToolTip("Record in the specimen that you reviewed and accepted this estimate")
        self.reject.setToolTip("Record in the specimen that this estimate must not be used")
        self.said = QVBoxLayout()
        self.said.setSpacing(4)
        self._shown: tuple[tuple[PoseCheck, ...], tuple[_Moved | None, ...]] | None = None
        who, what = QHBoxLayout(), QHBoxLayout()
        for row, widgets in ((who, (self.initials, self.note)), (what, (self.accept, self.reject))):
            row.setSpacing(6)
            for widget in widgets:
                row.addWidget(widget, 1)
            self.add(row)
        self.add(self.said)
        self.accept.clicked.connect(lambda: self.judge("accept"))
        self.reject.clicked.connect(lambda: self.judge("reject"))
        follow(self, workspace.document.details_changed, self.refresh)
        follow(self, workspace.document.reset, self._on_session)
        self._on_session()

    def refresh(self, *_: object) -> None:
        """Show what was said of this side, the latest first."""
        model = self._workspace.pose
        is_there = model.estimate is not None and model.estimate.pose is not None
        for button in (self.accept, self.reject):
            button.setEnabled(is_there)
        checks = tuple(c for c in self._workspace.document.state.pose_checks if c.side is model.side)[::-1]
        estimate = model.estimate
        moved = tuple(estimate.moved_since(c.pose) if estimate else None for c in checks[:_N_SHOWN])
        if (checks, moved) == self._shown:
            return
        self._shown = checks, moved
        emptied(self.said)
        for check, since in zip(checks, moved, strict=False):  # no more than are shown
            self.said.addWidget(_said(check, since))
        if len(checks) > _N_SHOWN:
            self.said.addWidget(text_label(f"and {len(checks) - _N_SHOWN} before", "hint"))

    def judge(self, verdict: str) -> bool:
        """Keep a verdict with the initials and the note that stand here."""
        by, note = self.initials.text().strip(), self.note.text().strip()
        done = attempt(
            self._workspace, lambda: self._workspace.pose.record_verdict(verdict, by=by, note=note)
        )
        if done:
            self.note.clear()
            self._workspace.say(f"{_WORDS[verdict][1]}; stored in the specimen")
        return done

    def _on_session(self, *_: object) -> None:
        self.initials.setText(self._workspace.document.author)
        self.note.clear()
        self.refresh()


def _said(check: PoseCheck, moved: _Moved | None) -> Notice:
    """Return the words of a verdict; one on an estimate that has moved since is none on this."""
    level, word = _WORDS[check.verdict]
    when = check.time.replace("T", " ").removesuffix("+00:00")
    radius = check.pose.get("radius_95_mm")
    about = f"95 % within {radius:.2f} mm" if isinstance(radius, float) else ""
    by = f" by {check.by}" if check.by else ""
    since = ""
    if moved is not None:
        level, since = "warning", f"has moved since by {moved[0]:.2f} mm, {moved[1]:.1f}°"
    return Notice(level, f"{word}{by}, {when} UTC", "  ·  ".join(filter(None, (check.note, about, since))))
