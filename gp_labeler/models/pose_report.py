"""One page about an estimated pose, as HTML: what was touched, what came of it, who accepted it.

The same text is shown by a browser and laid out as a PDF, so it keeps to what both understand: tables,
pictures, plain colours. Nothing is computed here.
"""

from __future__ import annotations

import base64
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from html import escape

import numpy as np

from gp_core.constants import DEFINING_FEATURES, METHOD_NAMES
from gp_core.landmarks.features import CODES
from gp_core.pose.cochlea_pose import CochleaPose
from gp_labeler.document.labelling_edits import labelling_text
from gp_labeler.document.specimen_file import application
from gp_labeler.document.state import PoseCheck, SpecimenState
from gp_labeler.document.touches import Touch
from gp_labeler.models.both_ears import BothEars
from gp_labeler.models.estimate import SideEstimate

__all__ = ["PoseReport"]

_WAYS = {
    "features": "features both touched and labelled",
    "skull": "skull features",
    "placed": "touches placed on it",
    "known": "a registration given with the touches",
}
_WITHHELD = (
    "Until they agree, nothing is sent to a robot, and files for a robot are written only after the estimate "
    "is accepted."
)
_GOOD, _BAD, _QUIET, _RULE = "#1b7f4b", "#b3361f", "#5d6670", "#d5dae0"
_TABLE = '<table cellspacing="0" cellpadding="0" style="margin-left: 0px; margin-right: 0px">'
_BAR_PX, _BAR_MM = 80, 2.0


@dataclass(frozen=True, eq=False)
class PoseReport:
    """What one page says.

    Parameters
    ----------
    state : SpecimenState
    estimate : SideEstimate
        Of the side reported; it has a pose.
    pictures : mapping of str to bytes
        PNG files by caption, in the order they are shown, six at most for one page.
    time : str
        ISO 8601.
    ears : BothEars, optional
        How the estimate agrees with that of the other ear, where both were touched.
    """

    state: SpecimenState
    estimate: SideEstimate
    pictures: Mapping[str, bytes] = field(default_factory=dict)
    time: str = ""
    ears: BothEars | None = None

    @property
    def check(self) -> PoseCheck | None:
        """The last verdict on this side, if there is one."""
        checks = [check for check in self.state.pose_checks if check.side is self.estimate.side]
        return checks[-1] if checks else None

    def html(self, *, embed: bool = True) -> str:
        """Return the page.

        Parameters
        ----------
        embed : bool
            Whether pictures are part of the text; otherwise they are named ``picture-0.png`` and so on.
        """
        body = "".join(
            (
                self._head(),
                self._verdict(),
                self._poses(),
                self._pictures(embed),
                self._touches(),
                self._foot(),
            )
        )
        title = escape(f"{self.state.specimen}, {self.estimate.side.word} cochlea")
        return (
            f'<!DOCTYPE html><html lang="en"><head><meta charset="utf-8"><title>{title}</title>'
            f"<style>{_STYLE}</style></head><body>{body}</body></html>\n"
        )

    def _head(self) -> str:
        volume = self.state.volume
        scan = "no scan" if volume is None else f"{volume.name}, voxels {_spacing(volume.spacing)} mm"
        return (
            f"<h1>{escape(self.state.specimen)}: pose of the {self.estimate.side.word} cochlea</h1>"
            f'<p class="quiet">{escape(scan)} &middot; {_when(self.time)}</p>'
        )

    def _verdict(self) -> str:
        check = self.check
        if check is None:
            return '<p class="box">Not judged yet. &nbsp; Accept / reject: ______ &nbsp; Initials: ______</p>'
        word, colour = ("Accepted", _GOOD) if check.verdict == "accept" else ("Rejected", _BAD)
        note = f" &middot; {escape(check.note)}" if check.note else ""
        by = escape(check.by or "unknown")
        moved = self.estimate.moved_since(check.pose)
        since = "" if moved is None else f'<br><b style="color:{_BAD}">{_moved(*moved)}</b>'
        said = f'<b style="color:{colour}">{word}</b> by {by}, {_when(check.time)}{note}{since}'
        return f'<p class="box">{said}</p>'

    def _poses(self) -> str:
        poses = self.estimate.poses
        heads = "".join(f"<th>{METHOD_NAMES.get(method, method)}</th>" for method in poses)
        rows = "".join(
            f"<tr><td>{name}</td>{''.join(f'<td>{text}</td>' for text in texts)}</tr>"
            for name, texts in self._rows()
        )
        registration = self._registration()
        warnings = "".join(f'<p style="color:{_BAD}">! {escape(text)}</p>' for text in self._warnings())
        table = f"{_TABLE}<tr><th></th>{heads}</tr>{rows}</table>"
        return f"<h2>Estimate</h2>{table}{registration}{self._both_ears()}{warnings}"

    def _both_ears(self) -> str:
        """Say how the two ears agree, and whether the axis is that of both."""
        if self.ears is None or self.ears.is_empty:
            return ""
        if self.ears.comparison is None:
            text = f"The two ears cannot be compared: {self.ears.problem}"
            return f'<p style="color:{_BAD}">! {escape(text)}</p>'
        pose = self.estimate.poses.get("robust")
        joined = pose is not None and pose.of_both_ears
        check = self.ears.comparison.check
        text = "; ".join(self.ears.comparison.texts) + ("; the axis is that of both ears" if joined else "")
        text += "." if check.agrees else f". {check.remedy} {_WITHHELD}"
        words = escape(text[:1].upper() + text[1:]).replace(" deg", "&deg;")
        return f"<p>{words}</p>" if check.agrees else f'<p style="color:{_BAD}">! {words}</p>'

    def _rows(self) -> Iterator[tuple[str, list[str]]]:
        estimate = self.estimate
        poses = list(estimate.poses.items())
        frame = poses[0][1].transform_to_touches.dst if poses else "tracker"
        yield f"Origin CO, {frame} frame, mm", [_numbers(pose.origin, 2) for _, pose in poses]
        yield "Modiolar axis CB&rarr;CA", [_numbers(pose.axis, 3) for _, pose in poses]
        yield "95 % region", [_region(pose) for _, pose in poses]
        if any(pose.is_multimodal for _, pose in poses):
            yield "95 % region, as named", [_plain_region(pose) for _, pose in poses]
        yield "Shared error, included", [_shared_error(pose) for _, pose in poses]
        yield "State", [pose.state for _, pose in poses]
        yield "Robot's y to the round window", [f"as {pose.round_window}" for _, pose in poses]
        yield "Atlas", [escape(pose.atlas) for _, pose in poses]
        if estimate.registered is not None:
            placed = [estimate.in_scan(method) for method, _ in poses]
            yield "Origin CO in the scan (LPS), mm", [_numbers(p.origin, 2) if p else "" for p in placed]
        if estimate.truth is not None and estimate.registered is not None:
            errors = [estimate.errors(method) for method, _ in poses]
            yield (
                "<b>From the labelled cochlea</b>",
                [f"<b>{e[0]:.2f} mm, {e[1]:.1f}&deg;</b>" if e else "" for e in errors],
            )

    def _registration(self) -> str:
        registered, placed = self.estimate.registered, self.estimate.in_scan()
        if registered is None or placed is None:
            return "<p>Not registered to a scan.</p>"
        text = f"In the scan by {_WAYS[registered.way]}"
        if registered.fiducials is not None:
            text += (
                f", {len(registered.fiducials.names)} points: FRE {registered.fre_mm:.2f} mm, "
                f"TRE at CO {registered.tre_mm(placed.origin):.2f} mm"
            )
        return f"<p>{text}{self._unconfirmed()}{self._labelled()}</p>"

    def _unconfirmed(self) -> str:
        """Say which labels the registration and the errors leave out, since nobody has looked at them."""
        codes = self.state.side(self.estimate.side).suggested
        if not codes:
            return ""
        what = "label is" if len(codes) == 1 else "labels are"
        return f"<br>{len(codes)} {what} only suggested and not used: {' '.join(codes)}"

    def _labelled(self) -> str:
        """Say who labelled this side, and what was noted of the labels that define the cochlea."""
        state, side = self.state, self.estimate.side
        if not state.side(side).placed:
            return ""
        who = labelling_text(state.labeller, state.round) if state.labeller else ""
        text = f"<br>Labelled by {escape(who)}" if who else ""
        for code in DEFINING_FEATURES:
            mark = state.landmark(side, code)
            said = [mark.certainty.value] if mark.certainty else []
            said += [mark.note] if mark.note else []
            text += f"<br>{code}: {escape(', '.join(said))}" if said else ""
        return text

    def _warnings(self) -> Iterator[str]:
        many = len(self.estimate.poses) > 1
        for method, pose in self.estimate.poses.items():
            for text in pose.warnings:
                yield f"{METHOD_NAMES[method]}: {text}" if many else text
        yield from (
            f"{METHOD_NAMES.get(name, name)}: {text}" for name, text in self.estimate.problems.items()
        )
        registered = self.estimate.registered
        if registered is not None and registered.fiducials is not None:
            yield from (f"registration: {text}" for text in registered.fiducials.warnings)

    def _pictures(self, embed: bool) -> str:
        if not self.pictures:
            return ""
        cells = [
            f'<td class="picture"><img width="218" src="{_source(n, png, embed)}"><br>{escape(caption)}</td>'
            for n, (caption, png) in enumerate(self.pictures.items())
        ]
        rows = "".join(f"<tr>{''.join(cells[n : n + 3])}</tr>" for n in range(0, len(cells), 3))
        return f"{_TABLE}{rows}</table>"

    def _touches(self) -> str:
        mine = {name: t for (side, name), t in self.state.touches.items() if side is self.estimate.side}
        touches = dict(sorted(mine.items(), key=lambda item: (item[0] not in CODES, item[0])))
        rows = "".join(self._touch_row(name, touch) for name, touch in touches.items())
        frame = self.estimate.touches.frame
        return (
            f'<h2>Touches</h2>{_TABLE}<tr><th width="90">Feature</th>'
            f'<th width="165">{frame.capitalize()} frame, mm</th>'
            f"<th>Residual, mm</th><th></th><th>How</th></tr>{rows}</table>"
        )

    def _touch_row(self, name: str, touch: Touch) -> str:
        residual, is_suspect = self._residual(name)
        bar = "" if residual is None else _bar(residual, _BAD if is_suspect else "#4d7fb3")
        mark = " <b>suspect</b>" if is_suspect else " left out" if touch.left_out else ""
        how = touch.how.value + (f", {touch.source}" if touch.source else "")
        if touch.earlier:
            how += f", mean of {len(touch.positions)} touches"
        if touch.n_samples > 1:
            how += f", {touch.n_samples} samples \u00b1{touch.spread_mm:.2f} mm"
        number = "" if residual is None else f"{residual:.2f}"
        return (
            f"<tr><td>{escape(name)}{mark}</td><td>{_numbers(touch.position, 2)}</td>"
            f"<td>{number}</td><td>{bar}</td><td>{escape(how)}</td></tr>"
        )

    def _residual(self, name: str) -> tuple[float | None, bool]:
        """Return how far a touch is from its feature, or a skull feature from its counterpart in the scan."""
        pose, registered = self.estimate.pose, self.estimate.registered
        if pose is not None and name in pose.residuals:
            return pose.residuals[name], name in pose.suspects
        fiducials = None if registered is None else registered.fiducials
        if fiducials is None or name in CODES:
            return None, False
        return fiducials.residuals_mm.get(name), name in fiducials.suspects

    def _foot(self) -> str:
        return (
            f'<p class="quiet">{escape(application())}. Axis and origin as in Usevitch et al. 2021. '
            "Research use: not a medical device.</p>"
        )


_STYLE = f"""
body {{ font-family: sans-serif; font-size: 10pt; color: #1c2126; max-width: 46em; }}
h1 {{ font-size: 15pt; margin: 0; }}
h2 {{ font-size: 11pt; margin: 10px 0 2px 0; }}
p {{ margin: 2px 0; }}
table {{ border-collapse: collapse; }}
th {{ text-align: left; font-weight: normal; color: {_QUIET}; padding: 1px 12px 1px 0; }}
td {{ padding: 1px 12px 1px 0; vertical-align: top; }}
.small {{ font-size: 8.5pt; }}
.quiet {{ color: {_QUIET}; font-size: 9pt; }}
.box {{ margin: 6px 0; padding: 4px 0; border-top: 1px solid {_RULE}; border-bottom: 1px solid {_RULE}; }}
.picture {{ color: {_QUIET}; font-size: 8pt; padding: 4px 6px 2px 0; }}
"""


def _bar(residual: float, colour: str) -> str:
    """Return a bar as long as a residual, as one cell: the only bar that paper and browser both draw."""
    width = max(int(_BAR_PX * min(residual / _BAR_MM, 1.0)), 2)
    return f'{_TABLE}<tr><td bgcolor="{colour}" width="{width}" style="padding:0">&nbsp;</td></tr></table>'


def _region(pose: CochleaPose) -> str:
    return f"{pose.radius_95:.2f} mm, cone {np.degrees(pose.cone_95):.1f}&deg;"


def _plain_region(pose: CochleaPose) -> str:
    return f"{pose.plain_radius_95:.2f} mm, cone {np.degrees(pose.plain_cone_95):.1f}&deg;"


def _shared_error(pose: CochleaPose) -> str:
    return "not considered" if pose.shared_error is None else f"{pose.shared_error:g} mm"


def _moved(mm: float, degrees: float) -> str:
    return f"Refers to an earlier estimate: this one differs by {mm:.2f} mm and {degrees:.1f}&deg;."


def _numbers(values: object, digits: int) -> str:
    return "&nbsp;&nbsp;".join(_number(v, digits) for v in np.asarray(values, dtype=np.float64).tolist())


def _number(value: float, digits: int) -> str:
    """Return a number with a true minus sign; a zero has none."""
    return f"{round(value, digits) + 0.0:.{digits}f}".replace("-", "&minus;")


def _when(time: str) -> str:
    """Return a time for people: ``2026-11-22 09:34 UTC``; what is no such time as it is."""
    short = re.sub(r"^(\d{4}-\d\d-\d\d)T(\d\d:\d\d):\d\d\+00:00$", r"\1 \2 UTC", time)
    return escape(short)


def _spacing(spacing: tuple[float, float, float]) -> str:
    texts = [f"{v:.4g}" for v in spacing]
    return texts[0] if len(set(texts)) == 1 else " \N{MULTIPLICATION SIGN} ".join(texts)


def _source(n: int, png: bytes, embed: bool) -> str:
    if not embed:
        return f"picture-{n}.png"
    return "data:image/png;base64," + base64.b64encode(png).decode()
