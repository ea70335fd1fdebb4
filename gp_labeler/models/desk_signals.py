"""What a workbench tells its listeners, whichever session is open."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from psygnal import Signal

from gp_labeler.models.session import Session

__all__ = ["DeskSignals"]

_RELAYED = (
    "landmarks_changed",
    "touches_changed",
    "active_changed",
    "crosshair_changed",
    "ghosts_changed",
    "threshold_changed",
    "details_changed",
    "history_changed",
    "dirty_changed",
    "saved",
    "edited",
    "stepped",
)


class DeskSignals:
    """Signals of a workbench; those of the session's names repeat the ones of the session that is open."""

    session_replaced = Signal(object)
    """Another session is open: look at everything anew."""
    landmarks_changed = Signal(frozenset)
    touches_changed = Signal()
    active_changed = Signal(object)
    crosshair_changed = Signal(object)
    ghosts_changed = Signal()
    threshold_changed = Signal(object)
    """The threshold in effect, set or proposed; None while there is none."""
    details_changed = Signal()
    history_changed = Signal()
    dirty_changed = Signal(bool)
    saved = Signal(object)
    edited = Signal(object, bool)
    stepped = Signal(str)
    exported = Signal(object)
    """The `ExportReport` of landmark files that were written."""
    wrote = Signal(str, object)
    """What was written, ``pose``, ``report``, ``path`` (carried) or ``atlas``, and its file."""
    pictured = Signal(object)
    """The file of a picture of the window."""
    view_changed = Signal(frozenset)
    """Names of the fields of `session.view.state` that changed."""

    atlas_changed = Signal()
    """Another atlas is in use: `atlas`, `atlas_specimens`."""
    atlas_details_changed = Signal()
    """What is known of the atlas in use changed: `atlas_file`, `atlas_problem`, `trial`."""
    volume_opened = Signal(object)
    surfaces_changed = Signal()
    threshold_previewed = Signal(object)
    """A threshold that is being tried out on the slices; None when that is over."""
    judged = Signal()
    """Labels were held against the atlas: ask for `departures` again."""
    doubts_changed = Signal()
    """Some of them are doubtful: ask `session.point_states(side, wait=False)` again."""
    dragged = Signal(object)
    """The `Drag` that goes on; None when it is over."""
    tool_changed = Signal(str)
    replacing_changed = Signal(bool)
    """Whether the next click moves the chosen point, which is placed or suggested already."""
    point_shown = Signal(object)
    """(3,) scan position that every view shall bring into sight, mm."""
    import_asked = Signal(object)
    """An `ImportPlan` that needs answers: change its options, then `read_scan` it."""
    scan_differs = Signal(object, object)
    """(VolumeChangedError, Volume): the scan is not the one labelled; `accept_scan` takes it nevertheless."""
    message = Signal(str, str)
    """Text, and ``info``, ``warning`` or ``error``."""

    def __init__(self) -> None:
        self._links: list[tuple[Any, Callable[..., object]]] = []

    def _follow(self, session: Session) -> None:
        for name in _RELAYED:
            self._link(getattr(session, name), getattr(self, f"_relay_{name}", self._relay(name)))
        self._link(session.view.changed, self._relay("view_changed"))

    def _relay(self, name: str) -> Callable[..., None]:
        def repeat(*values: object) -> None:
            getattr(self, name).emit(*values)

        return repeat

    def _link(self, signal: Any, slot: Callable[..., object]) -> None:
        signal.connect(slot)
        self._links.append((signal, slot))

    def _unfollow(self) -> None:
        for signal, slot in self._links:
            signal.disconnect(slot, missing_ok=True)
        self._links.clear()
