"""Beginning a session: new, from a specimen file, or with what a killed program left."""

from __future__ import annotations

import re
from collections.abc import Mapping
from os import PathLike
from pathlib import Path
from typing import Any

from gp_core.errors import GpError
from gp_core.landmarks.features import feature
from gp_core.validation import check_option
from gp_labeler.document.paths import absolute_path
from gp_labeler.document.recovery import Recovery, find_recovery, replayed
from gp_labeler.document.specimen_file import read_document, state_in
from gp_labeler.document.specimen_json import accepted_ghosts, state_of
from gp_labeler.document.state import SpecimenState
from gp_labeler.document.store import Keeper
from gp_labeler.models.session import Session

__all__ = ["UnsavedEditsError", "new_session", "open_session", "recover_session", "tidy_name"]


class UnsavedEditsError(GpError):
    """A program that was killed left unsaved edits of this specimen.

    Parameters
    ----------
    recovery : Recovery
        These edits: give it to `recover_session`, or open the file with `unsaved="leave"`.
    """

    def __init__(self, recovery: Recovery) -> None:
        self.recovery = recovery
        super().__init__(
            f"was not saved before the program ended: {recovery.text}",
            file=recovery.specimen_file,
            remedy="Recover these edits, or open the file as it was saved.",
        )


def new_session(directory: Path | None = None, *, specimen: str = "unnamed", **options: Any) -> Session:
    """Begin with an empty specimen.

    Parameters
    ----------
    directory : Path, optional
        State directory (`places.default_directory()` in the window); None keeps no journal.
    specimen : str
        Its name; anything is made to do as a file name.
    **options
        `predict`, `author` and `clock` of `Session`.

    Raises
    ------
    GpError
        The state directory cannot be written.
    """
    state = SpecimenState(tidy_name(specimen))
    return Session(state, keeper=Keeper.begin(directory, state), **options)


def open_session(
    path: str | PathLike[str],
    directory: Path | None = None,
    *,
    unsaved: str = "ask",
    as_copy: bool = False,
    **options: Any,
) -> Session:
    """Open a specimen file.

    Parameters
    ----------
    path : path
        The file.
    directory : Path, optional
        State directory; see `new_session`.
    unsaved : str
        What to do about edits that a killed program left: ``ask`` raises, ``recover`` takes them up,
        ``leave`` opens the file as it was saved (they are offered again at the next start).
    as_copy : bool
        Open it beside the window that has it open, as a specimen that is not saved yet.
    **options
        `predict`, `author` and `clock` of `Session`.

    Raises
    ------
    UnsavedEditsError
        There are such edits, and `unsaved` is ``ask``.
    InUseError
        Another window has it open.
    GpError
        It cannot be read.
    """
    check_option(unsaved, "unsaved", ("ask", "recover", "leave"))
    file = absolute_path(path)
    recovery = find_recovery(directory, file) if directory and not as_copy and unsaved != "leave" else None
    if recovery is not None and directory is not None:
        if unsaved == "ask":
            raise UnsavedEditsError(recovery)
        return recover_session(recovery, directory, **options)
    document = read_document(file)
    state = state_in(document, file)
    session = Session(state, keeper=Keeper.begin(directory, state, None if as_copy else file), **options)
    session.notices = _demotions(document)
    return session


def recover_session(recovery: Recovery, directory: Path | None, **options: Any) -> Session:
    """Go on where a killed program stopped; undo works back to where it was saved last.

    Raises
    ------
    InUseError
        Another window has just taken it up.
    """
    keeper = Keeper.resume(directory, recovery)
    history = replayed(recovery.content)
    saved = state_of(recovery.content.base)
    if saved.volume is None:
        saved = saved.on_volume(history.state.volume, history.state.import_choices)
    session = Session(history, keeper=keeper, saved=saved, **options)
    session.notices = _demotions(recovery.content.document)
    return session


def _demotions(document: Mapping[str, Any]) -> tuple[str, ...]:
    """Say, once, that what an earlier version counted as placed is only suggested."""
    found = accepted_ghosts(document)
    if not found:
        return ()
    names = [code if side is None or feature(code).shared else f"{code} {side.value}" for side, code in found]
    many = "1 point was an accepted ghost" if len(found) == 1 else f"{len(found)} points were accepted ghosts"
    it = "it counts as a suggestion" if len(found) == 1 else "they count as suggestions"
    shown = ", ".join(names[:6]) + (", …" if len(names) > 6 else "")
    return (f"{many} that nobody had confirmed: {it} now ({shown}). Confirm or correct each in the table.",)


def tidy_name(text: str) -> str:
    """Return a name that does as a file name."""
    tidied = re.sub(r'[/\\:*?"<>|\s]+', " ", text).strip(" .")
    return tidied or "unnamed"
