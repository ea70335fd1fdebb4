"""What stands in for the user's answers: only what a step has said; any other question stops the script."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from gp_labeler.views.prompts import Prompts

__all__ = ["ScriptPrompts"]

_EARLIER = {
    "Import nevertheless": "Import anyway",
    "Left is as the file says": "Left is correct",
    "Use it nevertheless": "Use it anyway",
}
"""What answers were called in earlier versions: their scripts still run."""


class ScriptPrompts(Prompts):
    """Answers the window's questions by what the step says."""

    in_dialogs = False

    def __init__(self) -> None:
        super().__init__()
        self.files: list[Path] = []
        self.saves: list[Path] = []
        self.answers: tuple[str, ...] = ()
        self.unanswered: list[str] = []

    def prepare(
        self, files: Sequence[Path] = (), answers: Sequence[str] = (), saves: Sequence[Path] = ()
    ) -> None:
        """Take the answers that the next step gives, and forget those of the last."""
        self.files, self.answers, self.saves = list(files), tuple(answers), list(saves)
        self.unanswered = []

    def choose(
        self, title: str, text: str, answers: Sequence[str], *, detail: str = "", kind: str = "question"
    ) -> str:
        """Return the first answer offered that the step allows."""
        allowed = {_EARLIER.get(answer, answer) for answer in self.answers}
        for answer in answers:
            if answer in allowed:
                return answer
        self.unanswered.append(f"{text} {detail}".strip())
        return ""

    def tell(self, title: str, text: str) -> None:
        """Take what must be read as a question that nobody answers."""
        self.unanswered.append(text)

    def open_files(
        self, title: str, filters: str, *, many: bool = False, start: Path | None = None
    ) -> list[Path]:
        """Return the files of the step."""
        if not self.files:
            self.unanswered.append(title)
        return self.files if many else self.files[:1]

    def folder(self, title: str, *, start: Path | None = None) -> Path | None:
        """Return the folder of the step."""
        return next(iter(self.open_files(title, "")), None)

    def save_file(self, title: str, suggestion: str, filters: str) -> Path | None:
        """Return the file of the step, to be written."""
        if not self.saves:
            self.unanswered.append(title)
        return next(iter(self.saves), None)

    def item(self, title: str, text: str, items: Sequence[str]) -> str:
        """Return the item that the step names."""
        for item in items:
            if item in self.answers or item.split()[0] in self.answers:
                return item
        self.unanswered.append(text)
        return ""

    def text(self, title: str, text: str, value: str = "") -> str | None:
        """Return the answer of the step."""
        if not self.answers:
            self.unanswered.append(text)
        return next(iter(self.answers), None)

    def number(self, title: str, text: str, value: float) -> float | None:
        """Leave it open: scripts give numbers where they are needed."""
        self.unanswered.append(text)
        return None
