"""What suggesting from labelled scans asks of the window: which scans, and which side is left."""

from __future__ import annotations

from pathlib import Path

from gp_labeler.views.ui_part import UiPart

__all__ = ["AS_THE_FILE", "FOLDER", "FirstLabelsUi"]

LISTED, FOLDER, FILES = "From the list of specimens", "From a folder…", "From files…"
AS_THE_FILE, MIRRORED = "Left is as the file says", "The scan is mirrored…"
_LABELLED = "Labelled scans (*.gpspecimen.json *.mrk.json *.fcsv);;All files (*)"


class FirstLabelsUi(UiPart):
    """The part of `WindowUi` that concerns suggestions from labelled scans."""

    def ask_reopen_mirrored(self) -> None:
        """Ask whether to read the scan again, mirrored; `WindowUi` does."""
        raise NotImplementedError

    def ask_suggest_like(self) -> None:
        """Ask for labelled scans and for the left side, and suggest landmarks from them."""
        model = self._workspace.first_labels
        if model.is_running:
            model.cancel()
            return
        labelled, asks_left = self._ask_labelled(), not model.knows_left
        if labelled and self._knows_left():
            model.suggest(labelled, left_confirmed=asks_left)

    def _ask_labelled(self) -> list[Path]:
        """Return the labelled scans that the user chooses; none where the user thinks better of it."""
        open_now = self._workspace.document.path
        listed = [
            row.path
            for row in self._workspace.specimens.every
            if sum(row.placed.values()) and row.path != open_now
        ]
        answers = [LISTED, FOLDER, FILES] if listed else [FOLDER, FILES]
        answer = self.prompts.choose(
            "Suggest from my scans",
            "Which labelled scans shall the landmarks be suggested from?",
            answers,
            detail="Three to five heads of the same species are enough. The first time, each is prepared, "
            "which takes some minutes. Suggestions count once you have confirmed them.",
        )
        if answer == FOLDER:
            folder = self.prompts.folder("A folder of labelled scans", self._folder)
            return [] if folder is None else [folder]
        if answer == FILES:
            return self.prompts.open_files("Labelled scans", self._folder, _LABELLED, many=True)
        return listed if answer == LISTED else []

    def _knows_left(self) -> bool:
        """Return whether left is known, if need be by asking."""
        if self._workspace.first_labels.knows_left:
            return True
        answer = self.prompts.choose(
            "Left and right",
            "Is the animal's left side on the left of the scan, as the file says?",
            [AS_THE_FILE, MIRRORED],
            detail="Nothing in a scan can prove it: a head and its mirror image look alike. Check it against "
            "a mark on the animal. A mirrored scan is read again, the right way round.",
        )
        if answer == MIRRORED:
            self.ask_reopen_mirrored()
            return False
        if answer and self._workspace.head.asks_left:
            self._workspace.head.confirm_left()
        return bool(answer)
