"""Where unsaved edits are kept when the state directory cannot be written."""

from __future__ import annotations

from pathlib import Path

from gp_labeler.document.state_directory import fallback_directory, write_problem
from gp_labeler.views.prompts import Prompts

__all__ = ["directory_to_use"]

_CHOOSE, _WITHOUT = "Choose a folder…", "Work without"


def directory_to_use(wanted: Path, prompts: Prompts) -> Path | None:
    """Return the state directory, or what the user takes instead where it cannot be written.

    Parameters
    ----------
    wanted : Path
        The state directory.
    prompts : Prompts
        Asks.

    Returns
    -------
    Path or None
        None where edits shall not be kept.
    """
    directory = wanted
    while problem := write_problem(directory):
        other = fallback_directory()
        answers = [] if other is None else [f"Use {other}"]
        answer = prompts.choose(
            "Unsaved edits cannot be stored safely",
            f"The folder {directory} {problem}.",
            [*answers, _CHOOSE, _WITHOUT],
            detail="Every edit is written there at once, so that nothing is lost if the program or the "
            "computer stops. A folder for temporary files may be emptied when the computer restarts.",
            kind="warning",
        )
        if answer == _CHOOSE:
            directory = prompts.folder("Folder for unsaved edits", start=Path.home()) or directory
        elif answer == _WITHOUT or other is None:
            return None
        else:
            return other
    return directory
