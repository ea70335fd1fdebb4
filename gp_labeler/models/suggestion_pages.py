"""Suggestions in pages of close views: what a page shows, what Enter confirms, and what a click corrects."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from gp_core.constants import CHI2_3_95
from gp_core.errors import GpError
from gp_core.landmarks.features import FEATURES, Side
from gp_core.landmarks.suggestion import Suggestion
from gp_core.validation import FloatArray
from gp_labeler.document.edits import point_text
from gp_labeler.document.page_confirmation import ConfirmPage, page_refusal
from gp_labeler.document.signals import Signal
from gp_labeler.document.specimen_document import SpecimenDocument
from gp_labeler.document.state import How, Landmark, Position
from gp_labeler.jobs.close_views import PLANES, ClosePicture, DrawCloseViews, PictureToDraw, looks_of
from gp_labeler.jobs.runner import Jobs
from gp_labeler.models.labels import LabelsModel
from gp_labeler.models.messages import Messages
from gp_labeler.models.scan import ScanModel
from gp_labeler.models.view import ViewModel
from gp_labeler.models.workflow import Active

__all__ = ["PAGE_SIZE", "PageEntry", "SuggestionPagesModel"]

PAGE_SIZE = 9
"""Close views on one page, at most."""

_KEY, _SCROLL_KEY = "close views", "close view of another slice"
_THIN_MM = 0.01
"""A place that lies farther off a slice is not in it."""

_SD_PER_RADIUS = CHI2_3_95**-0.5
"""Standard deviation of one coordinate over the 95 % radius, of a Gaussian error in three dimensions."""


@dataclass(frozen=True, eq=False)
class PageEntry:
    """One suggestion of a page, as it stands now.

    Parameters
    ----------
    side : Side
    code : str
    landmark : Landmark
        What is known of it: a suggestion, or what a person has decided.
    is_marked : bool
        Whether somebody wants to look at it in the views.
    pictures : tuple of ClosePicture
        The two of its close view; empty until they are drawn. Each stays until the next one is drawn.
    """

    side: Side
    code: str
    landmark: Landmark
    is_marked: bool = False
    pictures: tuple[ClosePicture, ...] = ()

    @property
    def suggestion(self) -> Suggestion | None:
        """None once a person has decided."""
        return self.landmark.suggestion

    @property
    def position(self) -> Position | None:
        """Where it is suggested, or placed by now, mm, scan frame; None where it cannot be seen."""
        return self.landmark.shown_position

    @property
    def is_corrected(self) -> bool:
        """Whether a person has placed it on a page."""
        about = self.landmark.provenance
        return self.landmark.decided and about is not None and about.how is How.CORRECTED

    @property
    def shows_its_place(self) -> bool:
        """Whether both pictures are drawn, and go through the place: neither is scrolled away."""
        return bool(self.pictures) and all(each.centre == self.position for each in self.pictures)

    def place_in(self, number: int) -> tuple[float, float]:
        """Return where a picture shows its place: across and down, 0 to 1 of the picture's width."""
        picture = self.pictures[number]
        return picture.place_of(picture.centre if self.position is None else self.position)

    def mm_off_slice(self, number: int) -> float:
        """Return how far a picture's slice lies from its place, mm; 0 where it does not, and for bone."""
        picture = self.pictures[number]
        if picture.depths is not None or self.position is None:
            return 0.0
        away = abs(picture.depth_of(self.position))
        return away if away > _THIN_MM else 0.0

    def radius_in(self, number: int) -> float:
        """Return the 95 % radius, 0 to 1 of a picture's width; 0 where none is known, or beside the slice."""
        if self.suggestion is None or self.suggestion.radius_95 is None or self.mm_off_slice(number):
            return 0.0
        return float(self.suggestion.radius_95 / self.pictures[number].across_mm)

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
    """Shows suggestions in pages, the least certain first; confirms what was shown, corrects what is wrong.

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
        self._drawn: dict[tuple[Active, int], ClosePicture] = {}
        self._scrolled: dict[tuple[Active, int], float] = {}
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
            (sum(entry.is_corrected for entry in entries), "corrected"),
            (sum(entry.suggestion is None and not entry.is_corrected for entry in entries), "decided"),
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
        self._marked, self._shown, self._scrolled = set(), {}, {}
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
        if entry.shows_its_place and entry.suggestion is not None:
            self._shown[Active(entry.side, entry.code)] = entry.suggestion

    def scroll(self, side: Side | str, code: str, number: int, n_slices: float) -> bool:
        """Turn one picture of a close view to another slice, as the wheel does in the views.

        Parameters
        ----------
        side : Side or str
        code : str
        number : int
            Which picture, 0 or 1.
        n_slices : float
            How many voxels further: left, posterior or superior in the frame of the views.

        Returns
        -------
        bool
            False for bone, which has no slices.
        """
        point = Active(Side.parse(side), code)
        if self._step(point, number) is None:
            return False
        self._scrolled[point, number] = self._n_scrolled(point, number) + n_slices
        self._submit(tuple(each for each in self._lacking([point]) if each.number == number), _SCROLL_KEY)
        self.changed.emit()
        return True

    def slices_to(self, side: Side | str, code: str, number: int, position: FloatArray) -> float:
        """Return how many slices a (3,) scan position, mm, lies from the picture's own; 0 for bone."""
        point = Active(Side.parse(side), code)
        step, place = self._step(point, number), self._entry(point).position
        if step is None or place is None:
            return 0.0
        return float((position - np.array(place)) @ step / (step @ step)) - self._n_scrolled(point, number)

    def correct(self, side: Side | str, code: str, number: int, across: float, down: float) -> bool:
        """Place a feature where a person sees it in a picture of its close view: it is then their label.

        Parameters
        ----------
        side : Side or str
        code : str
        number : int
            Which picture, 0 or 1.
        across, down : float
            From its top left corner, 0 to 1 of its width.

        Returns
        -------
        bool
            Whether anything changed.

        Raises
        ------
        GpError
            Nothing is seen there, or the point is locked.
        """
        entry, volume = self._entry(Active(Side.parse(side), code)), self._scan.volume
        where = entry.pictures[number].position_at(across, down) if entry.pictures else None
        if where is None or volume is None or not volume.contains(where[None])[0]:
            raise GpError(
                f"there is nothing to place {entry.name} on",
                remedy="Click bone, or a place on a slice that lies in the scan.",
            )
        about = entry.landmark.provenance
        source = about.source if about is not None else ""
        if entry.suggestion is not None:
            source = entry.suggestion.source
        return self._labels.place(where, How.CORRECTED, source=source, side=side, code=code)

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
        self.number, self._scrolled = number, {}
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
        self._pages, self._drawn, self._scrolled = (), {}, {}
        self._jobs.cancel(_KEY, _SCROLL_KEY)
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
        landmark = self._document.state.landmark(point.side, code)
        drawn = tuple(self._drawn[point, n] for n in (0, 1) if (point, n) in self._drawn)
        pictures = drawn if len(drawn) == 2 and landmark.shown_position is not None else ()
        return PageEntry(point.side, code, landmark, point in self._marked, pictures)

    def _step(self, point: Active, number: int) -> FloatArray | None:
        """Return the way from one slice of a picture to the next, (3,) mm, scan frame; None for bone."""
        look, volume = self._look(point, number), self._scan.volume
        if volume is None or look not in PLANES:
            return None
        normal = self._view.frame.plane(look).normal
        step: FloatArray = volume.step_along(normal) * normal
        return step

    def _n_scrolled(self, point: Active, number: int) -> float:
        return self._scrolled.get((point, number), 0.0)

    def _look(self, point: Active, number: int) -> str:
        has_bone = self._scan.threshold is not None
        return looks_of(point.side, point.code or "", with_bone=has_bone)[number]

    def _draw(self) -> None:
        """Draw what this page lacks, in the background; where it lacks nothing, the next one."""
        lacking = (self._lacking(page) for page in self._pages[self.number : self.number + 2])
        self._submit(next(filter(None, lacking), ()), _KEY)

    def _submit(self, wanted: tuple[PictureToDraw, ...], key: str) -> None:
        volume = self._scan.volume
        if volume is None or not wanted:
            return
        self._frame = self._view.frame
        level, width = self._view.state.level, self._view.state.width
        window = volume.intensity_range
        if level is not None and width is not None:
            window = level - width / 2, level + width / 2
        job = DrawCloseViews(volume, wanted, self._frame.axes, window, self._scan.threshold)
        self._jobs.submit(job, self._take, key=key)

    def _lacking(self, points: Iterable[Active]) -> tuple[PictureToDraw, ...]:
        """Return the pictures of some points that are not drawn as they stand."""
        wanted = (self._to_draw(point, n) for point in points for n in (0, 1))
        return tuple(each for each in wanted if each is not None and not self._is_drawn(each))

    def _to_draw(self, point: Active, number: int) -> PictureToDraw | None:
        """Return what a picture is to show; None of a point that has no place."""
        place = self._entry(point).position
        n_slices, step = self._n_scrolled(point, number), self._step(point, number)
        if place is not None and n_slices and step is not None:
            x, y, z = (np.array(place) + n_slices * step).tolist()
            place = x, y, z
        return None if place is None else PictureToDraw(point.side, point.code or "", number, place)

    def _is_drawn(self, wanted: PictureToDraw) -> bool:
        drawn = self._drawn.get((Active(wanted.side, wanted.code), wanted.number))
        return drawn is not None and drawn.centre == wanted.centre

    def _take(self, drawn: Mapping[PictureToDraw, ClosePicture]) -> None:
        self._drawn |= {(Active(each.side, each.code), each.number): drawn[each] for each in drawn}
        self.changed.emit()
        self._draw()

    def _on_landmarks(self, changed: frozenset[tuple[Side, str]]) -> None:
        for key in [key for key in self._scrolled if (key[0].side, key[0].code) in changed]:
            del self._scrolled[key]
        if self.is_open:
            self._draw()
            self.changed.emit()

    def _on_frame(self) -> None:
        """Draw all again where the frame of the views is another one."""
        if self.is_open and self._view.frame is not self._frame:
            self._drawn, self._shown, self._scrolled = {}, {}, {}
            self._draw()
            self.changed.emit()

    def _on_reset(self) -> None:
        self._marked, self._shown, self._drawn, self._scrolled = set(), {}, {}, {}
        if self.is_open:
            self._pages = ()
            self._jobs.cancel(_KEY, _SCROLL_KEY)
            self.finished.emit()


_SHARED = tuple(row.code for row in FEATURES if row.shared)


def _in_pages(points: Sequence[Active]) -> tuple[tuple[Active, ...], ...]:
    """Divide points into as few pages as can hold them, of nearly the same size."""
    n_pages = -(-len(points) // PAGE_SIZE)
    bounds = [len(points) * n // n_pages for n in range(n_pages + 1)]
    return tuple(tuple(points[a:b]) for a, b in pairwise(bounds))
