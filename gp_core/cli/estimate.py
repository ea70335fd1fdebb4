"""``gp-core estimate``: the pose of the cochlea from touched points."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from gp_core.atlas.fitting import fit_atlas
from gp_core.cli.options import (
    AtlasSource,
    Subparsers,
    add_atlas,
    add_command,
    add_json,
    add_names,
    lab_names,
    read_atlas,
    say,
)
from gp_core.constants import METHODS, MM_PER_DEGREE
from gp_core.disk import all_or_none, write_text
from gp_core.errors import GpError, blaming
from gp_core.frames import angle_between_deg
from gp_core.io import read_touches
from gp_core.io.file_names import named_side
from gp_core.io.pose_export import pose_text
from gp_core.io.pose_json import is_pose_file, read_pose
from gp_core.landmarks.sets import LandmarkSet
from gp_core.pose.answer import WITHHELD, pose_answer
from gp_core.pose.cochlea_pose import ROUND_WINDOWS, CochleaPose
from gp_core.pose.estimate import compare_with_other_ear, estimate_from
from gp_core.pose.estimate_inputs import EarInputs, EstimateInputs
from gp_core.pose.gate import GateReason, PoseGate, named_for_other_side
from gp_core.pose.hypothesis_check import read_as, with_names_exchanged
from gp_core.pose.insertion_path import UNITS, carry_path, read_path, rows_before_centre, write_path
from gp_core.pose.mixture import Hypothesis
from gp_core.pose.next_touch import TouchGain, gains
from gp_core.pose.systematic_error import DEFAULT_SHARED_ERROR_MM
from gp_core.standard_streams import shown_name
from gp_core.validation import FloatArray

__all__ = ["HELD_BACK", "add", "pose_table"]

HELD_BACK = WITHHELD
"""Exit status of a command that wrote no pose because names or side look wrong."""

_FOR_ROBOTS = ("tfm", "csv", "landmarks", "path_out")
"""Options whose files hold a pose without its states and warnings."""

_OF_A_PATH = ("path_units", "path_side", "path_axes", "path_rows", "path_out")
_AXES = "x,y,z"

_CERTAIN_ENOUGH = 0.995
"""Probability from which on a hypothesis that the program chose itself is accepted."""

_NEGLIGIBLE_GAIN = 0.03
"""Fraction of the present error region below which a gain is not worth a touch."""


def add(commands: Subparsers) -> None:
    """Add the command to the parser.

    Parameters
    ----------
    commands : Subparsers
        The subparsers of ``gp-core``, to which the commands are added.
    """
    parser = add_command(
        commands,
        "estimate",
        run,
        summary="estimate the pose of a cochlea from a few touched points",
        example="gp-core estimate touches.dat --side R --json pose.json",
    )
    parser.add_argument(
        "touches",
        metavar="TOUCHES",
        help="file of three or more touches: .dat, .csv, .mrk.json or .fcsv (a feature may have several); "
        "or a pose that --json wrote, to repeat its estimate, with other options where they are given",
    )
    add_names(parser)
    parser.add_argument("--side", choices=("L", "R"), help="side of the head; needed with a file of touches")
    add_atlas(parser)
    parser.add_argument(
        "--method",
        metavar="METHOD",
        help=f"{' or '.join(METHODS)}, or one of an installed package; default: robust",
    )
    parser.add_argument(
        "--probe-noise",
        type=float,
        metavar="MM",
        help="error of an ordinary touch; default: estimated from the touches",
    )
    _add_ambiguity(parser)
    parser.add_argument(
        "--round-window",
        choices=ROUND_WINDOWS,
        help="what y of the written frame points to: the middle of the touched RWA and RWP, where both fit "
        "(default), or of the fitted atlas",
    )
    add_json(parser)
    parser.add_argument("--tfm", metavar="FILE", help="write the pose as an ITK / Slicer transform here")
    parser.add_argument(
        "--csv", metavar="FILE", help="write the 4x4 matrix here: four rows of four numbers, mm"
    )
    parser.add_argument(
        "--landmarks",
        metavar="FILE",
        help="write CO and a point of the axis here, as Slicer markups (.mrk.json)",
    )
    _add_path(parser)


def _add_ambiguity(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("errors and ambiguity")
    group.add_argument(
        "--shared-error",
        type=float,
        metavar="MM",
        help="RMS length of an offset that all touches share (tip calibration, tracker, soft tissue); it "
        f"widens the region; default: {DEFAULT_SHARED_ERROR_MM:g}",
    )
    group.add_argument(
        "--exchange",
        type=_two_names,
        metavar="A,B",
        help="exchange the names of two touches before the estimate, such as RWA,RWP",
    )
    group.add_argument(
        "--take-best",
        action="store_true",
        help="if the other side, or an exchange of two names, is likelier than the given ones, use that",
    )
    group.add_argument(
        "--other-ear",
        metavar="FILE",
        help="touches of the other ear of the same head, in the same frame: the two estimates, mirrored on "
        "each other, are a check without any CT. It may be TOUCHES itself, if that holds both sides",
    )
    group.add_argument(
        "--both-ears",
        action="store_true",
        help="combine the axes of both ears if they agree (needs --other-ear)",
    )
    group.add_argument(
        "--midline",
        type=_names,
        metavar="S1,S2",
        help="skull features that lie in the mid-plane of the head, touched with either ear: they determine "
        "that plane better (needs --other-ear)",
    )
    group.add_argument(
        "--accept-warnings",
        action="store_true",
        help="write all files even where names or side look wrong or are undecided, or the ears disagree; "
        "without it, only --json is written then, and the status is 3",
    )


def _add_path(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("insertion path, transformed to the estimated pose")
    group.add_argument(
        "--path", metavar="CSV", help="three columns, in the cochlea frame: origin CO, x towards CA"
    )
    group.add_argument("--path-units", choices=tuple(UNITS), help="unit of its numbers; required with --path")
    group.add_argument(
        "--path-side", choices=("L", "R"), help="the ear for which it was planned; required with --path"
    )
    group.add_argument(
        "--path-axes",
        metavar="AXES",
        help="the axes of the file that are x, y and z of the cochlea frame, such as z,-y,x; default: x,y,z",
    )
    group.add_argument("--path-rows", type=int, metavar="N", help="read only the first N rows; default: all")
    group.add_argument(
        "--path-out",
        metavar="FILE",
        help="write it here in the frame of the touches: rows of three numbers, mm",
    )


def run(args: argparse.Namespace) -> int:
    """Run ``gp-core estimate``.

    Parameters
    ----------
    args : argparse.Namespace
        The parsed options.

    Returns
    -------
    int
        Exit status; see `gp_core.cli.entry.main`.
    """
    path = _path_of(args)
    given = _given(args)
    own_atlas = f" with atlas {' '.join(args.atlas)}" if args.atlas not in (None, ["published"]) else ""
    with blaming(args.touches + own_atlas):
        touches, pose, taken = _estimated(args, given)
        next_touches = _next_touches(given.inputs, touches)
    pose = _with_other_ear(args, given, pose)
    others = _other_reasons(given.inputs.source, pose, taken)
    answer = pose_answer(pose, others, accept_warnings=args.accept_warnings)
    held_back = answer["status"] == WITHHELD
    _write(args, pose, answer, path, held_back=held_back)
    for line in pose_table(pose, shown_name(args.touches), next_touches):
        say(line)
    remarks = _remarks(args, touches, pose, path, held_back=held_back)
    compared = _compared(pose, given.pose, args.touches)
    for line in (*_ear_lines(pose), *_taken_lines(taken), *remarks, *_gate_lines(args, answer), *compared):
        say(f"  {line}")
    return HELD_BACK if held_back else 0


@dataclass(frozen=True)
class _Given:
    """What the command line gives to estimate from: touches, or a pose file with what it was made from."""

    inputs: EstimateInputs
    pose: CochleaPose | None = None

    def estimate(self, touches: LandmarkSet) -> CochleaPose:
        """Estimate touches in this way."""
        return estimate_from(replace(self.inputs, touches=touches))


def _given(args: argparse.Namespace) -> _Given:
    """Return what the command line gives; a pose file's own settings hold unless an option overrules them."""
    given = _given_pose(args) if is_pose_file(args.touches) else _Given(_given_touches(args))
    if args.exchange is not None:
        with blaming(args.touches):
            exchanged = with_names_exchanged(given.inputs.touches, args.exchange)
            given = replace(given, inputs=replace(given.inputs, touches=exchanged))
    return given


def _given_touches(args: argparse.Namespace) -> EstimateInputs:
    if args.side is None:
        raise GpError("--side L or --side R is needed with a file of touches", file=args.touches)
    touches = read_touches(args.touches, args.side, names=lab_names(args))
    method = args.method or "robust"
    atlas, specimens = _atlas_for(args.atlas or ["published"], method)
    return EstimateInputs(
        touches=touches,
        method=method,
        round_window=args.round_window or ROUND_WINDOWS[0],
        probe_noise=args.probe_noise,
        shared_error=DEFAULT_SHARED_ERROR_MM if args.shared_error is None else args.shared_error,
        times=None,
        atlas=atlas,
        specimens=tuple(specimens or ()),
        source=shown_name(args.touches),
    )


def _given_pose(args: argparse.Namespace) -> _Given:
    pose = read_pose(args.touches)
    made = pose.inputs
    if made is None:
        raise GpError(
            "does not contain the touches and the atlas from which it was estimated",
            file=args.touches,
            remedy="It is of an earlier version: estimate it from the files of touches.",
        )
    if args.side not in (None, made.touches.side.value):
        raise GpError(f"is of the {made.touches.side.word} side", file=args.touches)
    inputs = _overruled(args, made)
    ear = made.other_ear
    if args.other_ear is not None:
        inputs = replace(inputs, other_ear=None)
    elif ear is not None:
        how = {"midline": args.midline, "combined": args.both_ears or None}
        chosen = {name: value for name, value in how.items() if value is not None}
        inputs = replace(inputs, other_ear=replace(ear, inputs=_overruled(args, ear.inputs), **chosen))
    return _Given(inputs, pose)


def _overruled(args: argparse.Namespace, inputs: EstimateInputs) -> EstimateInputs:
    """Return the inputs of a pose file with the settings that the command line gives."""
    names = ("method", "round_window", "probe_noise", "shared_error")
    overruled = {name: value for name in names if (value := getattr(args, name)) is not None}
    inputs = replace(inputs, **overruled)
    if args.atlas is not None:
        atlas, specimens = _atlas_for(args.atlas, inputs.method)
        inputs = replace(inputs, atlas=atlas, specimens=tuple(specimens or ()))
    return inputs


def _atlas_for(words: list[str], method: str) -> AtlasSource:
    """Return the atlas, or the animals; the robust method has one fitted to them."""
    atlas, specimens = read_atlas(words)
    if atlas is None and method != "jrmpc":
        with blaming(" ".join(words)):
            return fit_atlas(specimens or []), None
    return atlas, specimens


def _with_other_ear(args: argparse.Namespace, given: _Given, pose: CochleaPose) -> CochleaPose:
    """Compare the estimate with that of the other ear's file, and with ``--both-ears`` combine their axes."""
    if args.other_ear is None:
        option = "--both-ears" if args.both_ears else "--midline" if args.midline else ""
        if option and given.inputs.other_ear is None:
            raise GpError(f"{option} needs the touches of the other ear", remedy="Give --other-ear FILE.")
        return pose
    with blaming(args.other_ear):
        touches = read_touches(args.other_ear, pose.side.other, names=lab_names(args))
        source = shown_name(args.other_ear)
        inputs = replace(given.inputs, touches=touches, times=None, source=source, other_ear=None)
        return compare_with_other_ear(pose, EarInputs(inputs, args.midline or (), args.both_ears))


def _ear_lines(pose: CochleaPose) -> Iterator[str]:
    """Yield what the comparison with the other ear found."""
    found = pose.other_ear
    if found:
        yield f"{'! ' if pose.ears_disagree else ''}{found['text']}"
    if skull := found.get("skull"):
        yield f"{'! ' if skull['moved'] else ''}{skull['text']}"


def _taken_lines(taken: Hypothesis | None) -> Iterator[str]:
    """Yield what ``--take-best`` took."""
    if taken is not None:
        odds = f"{100 * taken.probability:.1f} %"
        yield f"! used as {taken.label}, which is more likely than the given names and side ({odds})"


def _gate_lines(args: argparse.Namespace, answer: Mapping[str, Any]) -> Iterator[str]:
    """Yield whether files were held back, or written in spite of warnings."""
    reasons = [reason["text"] for reason in answer["reasons"]]
    if answer["status"] == WITHHELD:
        yield f"! {_what_was_held_back(args, reasons)}"
    elif reasons:
        yield "! written in spite of these warnings: --accept-warnings was given"


def _compared(pose: CochleaPose, stored: CochleaPose | None, file: str) -> Iterator[str]:
    """Yield how an estimate differs from that of the pose file which it was made from, if it was."""
    if stored is None:
        return
    name = shown_name(file)
    if np.array_equal(pose.transform, stored.transform) and pose.as_dict() == stored.as_dict():
        yield f"identical to {name}"
        return
    mm = float(np.linalg.norm(pose.origin - stored.origin))
    degrees = float(angle_between_deg(pose.axis, stored.axis))
    yield f"CO lies {mm:.2g} mm from that of {name}, the axis {degrees:.2g} deg"


def _names(text: str) -> tuple[str, ...]:
    return tuple(name.strip().upper() for name in text.split(",") if name.strip())


def _two_names(text: str) -> tuple[str, str]:
    names = [name.strip().upper() for name in text.split(",")]
    if len(names) != 2 or names[0] == names[1]:
        raise argparse.ArgumentTypeError(f"expected two different features such as RWA,RWP, got {text!r}")
    return names[0], names[1]


def _estimated(args: argparse.Namespace, given: _Given) -> tuple[LandmarkSet, CochleaPose, Hypothesis | None]:
    """Estimate the touches as they are named; with ``--take-best``, under the likeliest hypothesis."""
    pose = given.estimate(given.inputs.touches)
    best = pose.likelier_hypothesis
    if best is None or not args.take_best:
        return given.inputs.touches, pose, None
    touches = read_as(given.inputs.touches, best)
    return touches, given.estimate(touches), best


def _next_touches(inputs: EstimateInputs, touches: LandmarkSet) -> tuple[TouchGain, ...]:
    """Return what each further touch would gain; nothing without an atlas."""
    if inputs.atlas is None:
        return ()
    return gains(touches, inputs.atlas, probe_noise=inputs.probe_noise, shared_error=inputs.shared_error)


def _other_reasons(source: str, pose: CochleaPose, taken: Hypothesis | None) -> list[GateReason]:
    """Return what speaks against side or names beside the pose itself."""
    others = []
    if taken is not None and taken.probability < _CERTAIN_ENOUGH:
        code = "side undecided" if taken.exchanged is None else "names undecided"
        others.append(GateReason(code, "the hypothesis used is not certain enough"))
    if source and named_side(source) is pose.side.other:
        others.append(named_for_other_side(source, pose.side))
    return others


def _what_was_held_back(args: argparse.Namespace, ambiguities: Sequence[str]) -> str:
    why = " and ".join(ambiguities)
    files = [file for name in _FOR_ROBOTS if (file := getattr(args, name))]
    what = f"not written: {' '.join(files)}, as {why}" if files else why
    if old := [file for file in files if Path(file).exists()]:
        what += f". Files of an earlier estimate are still there: {' '.join(old)}"
    return f"{what}. Check side, names and touches, or give --accept-warnings"


def _write(
    args: argparse.Namespace,
    pose: CochleaPose,
    answer: Mapping[str, Any],
    path: FloatArray | None,
    *,
    held_back: bool,
) -> None:
    """Write the requested files; for a pose that is held back, only the JSON, which holds its state."""
    if path is not None:
        with blaming(args.path):
            carried = carry_path(path, pose, path_side=args.path_side)
    with all_or_none():
        if args.json:
            write_text(args.json, pose_text(answer))
        if held_back:
            return
        if path is not None:
            write_path(args.path_out, carried)
        for save, file in (
            (pose.save_tfm, args.tfm),
            (pose.save_csv, args.csv),
            (pose.save_landmarks, args.landmarks),
        ):
            if file:
                save(file)


def _remarks(
    args: argparse.Namespace,
    touches: LandmarkSet,
    pose: CochleaPose,
    path: FloatArray | None,
    *,
    held_back: bool,
) -> Iterator[str]:
    """Yield further remarks on the touches, the pose and the written frame."""
    if touches.unseen:
        yield f"not seen by the tracker: {' '.join(sorted(touches.unseen))}"
    centre = None if path is None else rows_before_centre(path)
    if centre is not None:
        yield f"! no path can reach CO, which is row {centre + 1} of this one: try --path-rows {centre}"
    for reason in PoseGate().reasons(pose, accepted=True):
        if reason.code in ("radius", "cone"):
            yield f"! a robot link would not send this pose: {reason.text}"
    if args.json or (not held_back and any((args.tfm, args.csv, args.path_out))):
        yield f"the y axis of the written pose points to the {pose.round_window} round window"


def _path_of(args: argparse.Namespace) -> FloatArray | None:
    """Return the given insertion path; all options that it needs must be given."""
    if args.path is None:
        given = [name for name in _OF_A_PATH if getattr(args, name) is not None]
        if given:
            options = " and ".join(f"--{name.replace('_', '-')}" for name in given)
            verb = "needs" if len(given) == 1 else "need"
            raise GpError(f"{options} {verb} a path", remedy="Give --path CSV.")
        return None
    missing = [
        option
        for option, value in (
            (f"--path-units {'|'.join(UNITS)}", args.path_units),
            ("--path-side L|R", args.path_side),
            ("--path-out FILE", args.path_out),
        )
        if value is None
    ]
    if missing:
        raise GpError(f"an insertion path needs {' and '.join(missing)} too", file=args.path)
    return read_path(args.path, units=args.path_units, axes=args.path_axes or _AXES, rows=args.path_rows)


def pose_table(pose: CochleaPose, source: str, next_touches: Sequence[TouchGain] = ()) -> Iterator[str]:
    """Yield a short readable table of a pose, and which further touch gains most.

    Parameters
    ----------
    pose : CochleaPose
        An estimate.
    source : str
        Where the touches come from.
    next_touches : sequence of TouchGain
        The best first.

    Yields
    ------
    str
        A line of text.
    """
    yield f"Cochlea from {source}, {pose.side.word} side, method {pose.method}, atlas {pose.atlas}"
    yield ""
    yield from _position_lines(pose)
    yield ""
    yield "  touch   residual, mm"
    for code, distance in pose.residuals.items():
        doubtful = "   doubtful" if code in pose.suspects else ""
        yield f"  {code:<7} {distance:6.2f}{_repeats_of(pose, code)}{doubtful}"
    for warning in pose.warnings:
        yield f"  ! {warning}"
    if next_touches:
        yield f"  {_advice(next_touches[0])}"


def _repeats_of(pose: CochleaPose, code: str) -> str:
    """Return how often a feature was touched, and the spread of its touches."""
    one = pose.repeats.get(code)
    if one is None:
        return ""
    of = f" of {len(one.points)}" if one.outliers else ""
    return f"   mean of {one.n_used}{of} touches, spread {one.spread_mm:.2f} mm"


def _position_lines(pose: CochleaPose) -> Iterator[str]:
    """Yield origin and axis with their regions, the states of side and names, and the other hypotheses."""
    x, y, z = pose.origin
    within = "95 % within" if pose.method != "jrmpc" else "animals scatter by"
    yield f"  origin CO     {x:10.3f} {y:10.3f} {z:10.3f} mm   {within} {pose.radius_95:.2f} mm"
    x, y, z = pose.axis
    yield f"  axis CB->CA   {x:10.4f} {y:10.4f} {z:10.4f}      {within} {np.degrees(pose.cone_95):.1f} deg"
    yield f"  state         {pose.state}"
    if pose.shared_error is not None:
        yield f"  shared error  {pose.shared_error:g} mm, included in the regions"
    if pose.is_multimodal:
        plain = f"{pose.plain_radius_95:.2f} mm and {np.degrees(pose.plain_cone_95):.1f} deg"
        yield f"  as named      95 % within {plain}; the region above covers several hypotheses:"
        yield f"    {pose.probability:6.1%}  as named"
        for other in pose.hypotheses:
            x, y, z = other.origin
            yield f"    {other.probability:6.1%}  {other.label}: CO {x:.3f} {y:.3f} {z:.3f}"


def _advice(best: TouchGain) -> str:
    """Return what the best next touch gains, or that it gains little."""
    if best.worth < _NEGLIGIBLE_GAIN * (best.radius_95_now + MM_PER_DEGREE * np.degrees(best.cone_95_now)):
        return "no other touch would reduce the region much"
    return (
        f"touching {best.code} as well would help most: 95 % within about {best.radius_95:.2f} mm "
        f"and {np.degrees(best.cone_95):.1f} deg"
    )
