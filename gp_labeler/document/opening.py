"""What a document can be loaded with: a new specimen, a specimen file, or recovered edits."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import Any

from gp_core.errors import GpError
from gp_core.landmarks.features import feature
from gp_core.validation import check_option
from gp_labeler.document.history import History
from gp_labeler.document.paths import absolute_path
from gp_labeler.document.recovery import Recovery, find_recovery, replayed
from gp_labeler.document.specimen_file import read_document, state_in
from gp_labeler.document.specimen_json import accepted_ghosts, state_of
from gp_labeler.document.state import SpecimenState
from gp_labeler.document.store import SpecimenStore

__all__ = [
    "LoadedSpecimen",
    "UnsavedEditsError",
    "new_specimen",
    "open_specimen",
    "recover_specimen",
    "tidy_name",
]


class UnsavedEditsError(GpError):
    """A program that was killed left unsaved edits of this specimen.

    Parameters
    ----------
    recovery : Recovery
        These edits: give it to `recover_specimen`, or open the file with `unsaved="leave"`.
    """

    def __init__(self, recovery: Recovery) -> None:
        self.recovery = recovery
        super().__init__(
            f"was not saved before the program ended: {recovery.text}",
            file=recovery.specimen_file,
            remedy="Recover these edits, or open the file as it was saved.",
        )


@dataclass(frozen=True)
class LoadedSpecimen:
    """A specimen that was read or begun, for `SpecimenDocument.load`.

    Parameters
    ----------
    history : History
        Its state, and what can be undone and redone.
    store : SpecimenStore
        Keeps it safe on disk.
    saved : SpecimenState, optional
        The state that is saved, if it is not the present one.
    notices : tuple of str
        What the user should be told once.
    copy_of : Path, optional
        The file that it was opened from as a copy.
    """

    history: History[SpecimenState]
    store: SpecimenStore = field(default_factory=SpecimenStore)
    saved: SpecimenState | None = None
    notices: tuple[str, ...] = ()
    copy_of: Path | None = None


def new_specimen(directory: Path | None = None, *, specimen: str = "unnamed") -> LoadedSpecimen:
    """Begin an empty specimen.

    Parameters
    ----------
    directory : Path, optional
        State directory (`paths.default_directory()` in the window); None keeps no journal.
    specimen : str
        Its name; characters that are not allowed in a file name are replaced.

    Raises
    ------
    GpError
        The state directory cannot be written.
    """
    state = SpecimenState(tidy_name(specimen))
    return LoadedSpecimen(History(state), SpecimenStore.begin(directory, state))


def open_specimen(
    path: str | PathLike[str],
    directory: Path | None = None,
    *,
    unsaved: str = "ask",
    as_copy: bool = False,
) -> LoadedSpecimen:
    """Read a specimen file.

    Parameters
    ----------
    path : path
        The file.
    directory : Path, optional
        State directory; see `new_specimen`.
    unsaved : str
        What to do about edits that a killed program left: ``ask`` raises, ``recover`` takes them up,
        ``leave`` opens the file as it was saved (they are offered again at the next start).
    as_copy : bool
        Open it beside the window that has it open, as a specimen that is not saved yet.

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
        return recover_specimen(recovery, directory)
    document = read_document(file)
    state = state_in(document, file)
    store = SpecimenStore.begin(directory, state, None if as_copy else file)
    notices, copy_of = _demotions(document), file if as_copy else None
    return LoadedSpecimen(History(state), store, notices=notices, copy_of=copy_of)


def recover_specimen(recovery: Recovery, directory: Path | None) -> LoadedSpecimen:
    """Go on where a killed program stopped; undo works back to where it was saved last.

    Raises
    ------
    InUseError
        Another window has just taken it up.
    """
    store = SpecimenStore.resume(directory, recovery)
    history = replayed(recovery.content)
    saved = state_of(recovery.content.base)
    if saved.volume is None:
        saved = saved.on_volume(history.state.volume, history.state.import_choices)
    damage = (f"{recovery.content.damage}.",) if recovery.content.damage else ()
    return LoadedSpecimen(history, store, saved, (*_demotions(recovery.content.document), *damage))


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
