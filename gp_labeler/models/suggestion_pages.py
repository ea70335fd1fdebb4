"""Checking suggestions in pages of close views: what a page shows, and which of it Enter confirms."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise

from gp_core.constants import CHI2_3_95
from gp_core.errors import GpError
from gp_core.landmarks.features import FEATURES, Side
from gp_core.landmarks.suggestion import Suggestion
from gp_labeler.document.edits import point_text
from gp_labeler.document.page_confirmation import ConfirmPage, page_refusal
from gp_labeler.document.signals import Signal
from gp_labeler.document.specimen_document import SpecimenDocument
from gp_labeler.document.state import How
from gp_labeler.jobs.close_views import CloseView, DrawCloseViews, PointToDraw
from gp_labeler.jobs.runner import Jobs
from gp_labeler.models.labels import LabelsModel
from gp_labeler.models.messages import Messages
from gp_labeler.models.scan import ScanModel
from gp_labeler.models.view import ViewModel
from gp_labeler.models.workflow import Active

__all__ = ["PAGE_SIZE", "PageEntry", "SuggestionPagesModel"]

PAGE_SIZE = 9
"""Close views on one page, at most."""

_KEY = "close views"
_SD_PER_RADIUS = CHI2_3_95**-0.5
"""Standard deviation of one coordinate over the 95 % radius, of a Gaussian error in three dimensions."""


@dataclass(frozen=True, eq=False)
class PageEntry:
    """One suggestion of a page, as it stands now.

    Parameters
    ----------
    side : Side
    code : str
    suggestion : Suggestion, optional
        None once a person has decided.
    is_marked : bool
        Whether somebody wants to look at it in the views.
    close_view : CloseView, optional
        None until it is drawn.
    """

    side: Side
    code: str
    suggestion: Suggestion | None = None
    is_marked: bool = False
    close_view: CloseView | None = None

    @property
    def name(self) -> str:
        """Such as ``CA left``."""
        return point_text(self.side, self.code)

    @property
    def refusal(self) -> str:
        """Why it cannot be confirmed from the page, in words; empty where it can."""
        return "" if self.suggestion is None else page_refusal(self.suggestion)

    @property
    def is_offered(self) -> bool:
        """Whether Enter confirms it once it was shown."""
        return self.suggestion is not None and not self.refusal and not self.is_marked

    @property
    def sd(self) -> float | None:
        """Standard deviation of one coordinate, mm; None where the radius is not known."""
        if self.suggestion is None or self.suggestion.radius_95 is None:
            return None
        return float(self.suggestion.radius_95 * _SD_PER_RADIUS)


class SuggestionPagesModel:
    """Shows suggestions in pages, the least certain first, and confirms what of a page was shown.

    Parameters
    ----------
    document : SpecimenDocument
        Its suggestions are shown.
    view : ViewModel
        The close views lie in its frame, and have its grey values.
    scan : ScanModel
        What is drawn.
    labels : LabelsModel
        What was not confirmed becomes its active point, afterwards.
    jobs : Jobs
        Where close views are drawn.
    messages : Messages
        What the user is told by.
    """

    changed = Signal()
    """Another page, a mark, a suggestion, or close views that were drawn."""
    finished = Signal()
    """The last page was turned, or another specimen is open."""

    def __init__(
        self,
        document: SpecimenDocument,
        view: ViewModel,
        scan: ScanModel,
        labels: LabelsModel,
        jobs: Jobs,
        messages: Messages,
    ) -> None:
        self._document, self._view, self._scan = document, view, scan
        self._labels, self._jobs, self._messages = labels, jobs, messages
        self._pages: tuple[tuple[Active, ...], ...] = ()
        self._marked: set[Active] = set()
        self._shown: dict[Active, Suggestion] = {}
        self._drawn: dict[PointToDraw, CloseView] = {}
        self._frame = view.frame
        self.number = 0
        """Which page is shown, from 0."""
        document.reset.connect(self._on_reset)
        document.landmarks_changed.connect(self._on_landmarks)
        document.labelling_changed.connect(self._on_reset)
        view.planes_changed.connect(self._on_frame)

    # What there is

    @property
    def is_open(self) -> bool:
        """Whether pages are being checked."""
        return bool(self._pages)

    @property
    def can_begin(self) -> bool:
        """Whether there is a scan, and something is suggested in it."""
        return self._scan.volume is not None and bool(self._suggested())

    @property
    def n_pages(self) -> int:
        """How many pages there are."""
        return len(self._pages)

    @property
    def entries(self) -> tuple[PageEntry, ...]:
        """What the page shows."""
        return tuple(self._entry(point) for point in self._pages[self.number]) if self.is_open else ()

    @property
    def text(self) -> str:
        """What becomes of the page, in words."""
        entries = self.entries
        counts = (
            (sum(entry.is_offered for entry in entries), "to confirm"),
            (sum(entry.is_marked and entry.suggestion is not None for entry in entries), "marked"),
            (sum(bool(entry.refusal) and not entry.is_marked for entry in entries), "doubtful"),
            (sum(entry.suggestion is None for entry in entries), "decided"),
        )
        told = [f"{n} {words}" for n, words in counts if n]
        return " · ".join([f"Page {self.number + 1} of {max(self.n_pages, 1)}", *told])

    # What is done

    def begin(self) -> None:
        """Lay out all suggestions in pages of about the same size, the least certain first.

        Raises
        ------
        GpError
            There is no scan, or nothing is suggested.
        """
        if self._scan.volume is None:
            raise GpError("there is no scan to look at suggestions in", remedy="Open one first.")
        suggested = self._suggested()
        if not suggested:
            raise GpError("nothing is suggested", remedy="Suggest landmarks from your scans first.")
        self._pages, self.number = _in_pages(suggested), 0
        self._marked, self._shown = set(), {}
        self._draw()
        self.changed.emit()

    def mark(self, side: Side, code: str, on: bool = True) -> None:
        """Take down that a person wants to look at a suggestion in the views, or no more."""
        point = Active(side, code)
        if self._entry(point).suggestion is not None and (point in self._marked) is not on:
            self._marked ^= {point}
            self.changed.emit()

    def take_shown(self, entry: PageEntry) -> None:
        """Take down that the close view of an entry was on the screen as a whole."""
        if entry.close_view is not None and entry.suggestion is not None:
            self._shown[Active(entry.side, entry.code)] = entry.suggestion

    def confirm(self) -> None:
        """Confirm what the page has shown and nobody wants to look at again; then turn the page.

        Where a close view has not been shown yet, the page stays.
        """
        offered = [entry for entry in self.entries if entry.is_offered]
        shown = [e for e in offered if self._shown.get(Active(e.side, e.code)) == e.suggestion]
        if shown:
            points = tuple((entry.side, entry.code) for entry in shown)
            self._document.do(ConfirmPage(points, self._document.provenance(How.PAGE)))
        if len(shown) < len(offered):
            left = len(offered) - len(shown)
            many = "close view has" if left == 1 else "close views have"
            self._messages.say(f"{left} {many} not been shown yet: wait, or scroll down", "warning")
        else:
            self.turn(1)

    def turn(self, step: int) -> None:
        """Show a page before or after this one; after the last one, the pages are finished."""
        number = self.number + step
        if not self.is_open or number < 0:
            return
        if number >= self.n_pages:
            self.finish()
            return
        self.number = number
        self._draw()
        self.changed.emit()

    def undo(self) -> None:
        """Undo the last edit, and show the page whose suggestions are back."""
        before = {point for page in self._pages for point in page if self._entry(point).suggestion is None}
        self._document.undo()
        back = [
            n
            for n, page in enumerate(self._pages)
            if any(point in before and self._entry(point).suggestion is not None for point in page)
        ]
        if back:
            self.turn(back[0] - self.number)

    def finish(self) -> None:
        """Close the pages; what is still suggested then comes up in the views, the least certain first."""
        if not self.is_open:
            return
        self._pages, self._drawn = (), {}
        self._jobs.cancel(_KEY)
        left = self._suggested()
        if left and self._scan.volume is not None:
            self._labels.look_closely(left[0].side, left[0].code or "")
            one = "1 suggestion is" if len(left) == 1 else f"{len(left)} suggestions are"
            self._messages.say(f"{one} left to look at in the views")
        self.finished.emit()

    # Inside

    def _suggested(self) -> list[Active]:
        """Return all suggestions, the least certain first; IN once."""
        found: dict[Active, Suggestion] = {}
        for side in Side:
            for code, suggestion in self._document.landmarks(side).suggested.items():
                if not (side is Side.RIGHT and code in _SHARED):
                    found[Active(side, code)] = suggestion
        return sorted(found, key=lambda point: found[point].uncertainty, reverse=True)

    def _entry(self, point: Active) -> PageEntry:
        code = point.code or ""
        suggestion = self._document.landmarks(point.side).suggested.get(code)
        drawn = None if suggestion is None else self._drawn.get(_to_draw(point, suggestion))
        return PageEntry(point.side, code, suggestion, point in self._marked, drawn)

    def _draw(self) -> None:
        """Draw what this page lacks, in the background; where it lacks nothing, the next one."""
        volume = self._scan.volume
        lacking = (self._lacking(page) for page in self._pages[self.number : self.number + 2])
        wanted = next(filter(None, lacking), ())
        if volume is None or not wanted:
            return
        self._frame = self._view.frame
        level, width = self._view.state.level, self._view.state.width
        window = volume.intensity_range
        if level is not None and width is not None:
            window = level - width / 2, level + width / 2
        job = DrawCloseViews(volume, wanted, self._frame.axes, window, self._scan.threshold)
        self._jobs.submit(job, self._take, key=_KEY)

    def _lacking(self, page: Iterable[Active]) -> tuple[PointToDraw, ...]:
        """Return the suggestions of a page whose close views are not drawn."""
        suggested = [(p, self._document.landmarks(p.side).suggested.get(p.code or "")) for p in page]
        points = [_to_draw(point, suggestion) for point, suggestion in suggested if suggestion is not None]
        return tuple(point for point in points if point not in self._drawn)

    def _take(self, drawn: dict[PointToDraw, CloseView]) -> None:
        self._drawn |= drawn
        self.changed.emit()
        self._draw()

    def _on_landmarks(self, _: object) -> None:
        if self.is_open:
            self._draw()
            self.changed.emit()

    def _on_frame(self) -> None:
        """Draw all again where the frame of the views is another one."""
        if self.is_open and self._view.frame is not self._frame:
            self._drawn, self._shown = {}, {}
            self._draw()
            self.changed.emit()

    def _on_reset(self) -> None:
        self._marked, self._shown, self._drawn = set(), {}, {}
        if self.is_open:
            self._pages = ()
            self._jobs.cancel(_KEY)
            self.finished.emit()


_SHARED = tuple(row.code for row in FEATURES if row.shared)


def _to_draw(point: Active, suggestion: Suggestion) -> PointToDraw:
    return PointToDraw(point.side, point.code or "", suggestion.position)


def _in_pages(points: Sequence[Active]) -> tuple[tuple[Active, ...], ...]:
    """Divide points into as few pages as can hold them, of nearly the same size."""
    n_pages = -(-len(points) // PAGE_SIZE)
    bounds = [len(points) * n // n_pages for n in range(n_pages + 1)]
    return tuple(tuple(points[a:b]) for a, b in pairwise(bounds))
