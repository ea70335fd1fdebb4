"""How well heads are straightened by themselves: mid-plane, front and up, pitch, refusals, CPU seconds.

    python benchmarks/head_pose.py                            the three mice that limits were tuned on
    python benchmarks/head_pose.py --mice others --crops      the ten other mice, whole, turned and cropped
    python benchmarks/head_pose.py --mice none --phantoms 101-110    phantoms of fresh seeds
    python benchmarks/head_pose.py --hard                     half heads, holders, two heads: refused or right

Mice are read in place (../shared/data/mouse_ct, or --data). Their truth is the plane fitted to the 17 named
pairs and 10 midline points of their 45 landmarks; its own error is 0.24 degrees in the median. Front, up and
pitch zero are those of the skull template beside them. One thread; half an hour for everything.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.ndimage import map_coordinates
from scipy.spatial.transform import Rotation

from gp_core.errors import GpError
from gp_core.frames import RigidTransform
from gp_labeler.head_pose import HeadTemplate, MidPlane, straighten
from gp_labeler.head_pose.template import phantom_template
from gp_labeler.imaging.readers import read_volume
from gp_labeler.imaging.threshold import propose_threshold
from gp_labeler.imaging.volume import Volume
from gp_labeler.phantom import USUAL, HeadVariation, make_phantom

ROOT = Path(__file__).resolve().parents[1]
DATA = (ROOT.parent / "shared" / "data" / "mouse_ct", Path("/work/shared/data/mouse_ct"))
TUNED_ON = ("A_J_", "AKR_J_", "SJL_J_")
PAIRS = "2-3 4-5 6-7 8-9 10-11 12-14 15-17 18-20 22-25 24-27 30-31 32-33 36-37 38-39 40-41 42-43 46-47"
MIDLINE = "1 13 16 19 21 28 29 44 50 51"  # 49 has no partner and lies 2 mm off the plane: left out
FACES = "LRAPSI"

Truth = tuple[MidPlane, np.ndarray]
"""The mid-plane of a head, and its axes."""


@dataclass(frozen=True)
class Case:
    """A scan, and how the head in it lies; ``hard`` ones must be refused or right."""

    group: str
    name: str
    volume: Volume
    plane: MidPlane
    axes: np.ndarray  # columns left, posterior, superior
    hard: bool = False
    others: tuple[Truth, ...] = ()  # of further heads in the scan: any is right

    @property
    def truths(self) -> tuple[Truth, ...]:
        """Mid-plane and axes of each head."""
        return ((self.plane, self.axes), *self.others)


# ---- truth of the mice


def landmarks(path: Path) -> dict[str, np.ndarray]:
    """Return the points of a landmark file by label."""
    rows = json.loads(path.read_text())["markups"][0]["controlPoints"]
    return {row["label"]: np.array(row["position"]) for row in rows}


def skull_template(data: Path) -> dict[str, np.ndarray]:
    """Return the landmarks of the skull template, which lies straight in LPS."""
    rows = (data / "template_skull.fcsv").read_text().splitlines()
    cells = [row.split(",") for row in rows if not row.startswith("#")]
    return {row[11]: np.array([float(v) for v in row[1:4]]) for row in cells}


def mid_plane_of(points: dict[str, np.ndarray]) -> MidPlane:
    """Return the plane in which the named pairs and midline points are most nearly mirror images."""
    pairs = [pair.split("-") for pair in PAIRS.split()] + [[m, m] for m in MIDLINE.split()]
    first = np.array([points[a] for a, _ in pairs] + [points[b] for _, b in pairs])
    second = np.array([points[b] for _, b in pairs] + [points[a] for a, _ in pairs])
    centre = (first + second).mean(axis=0) / 2
    cross = (first - centre).T @ (second - centre)
    return MidPlane.through(centre, np.linalg.eigh(cross + cross.T)[1][:, 0])


def mouse(data: Path, name: str) -> Case:
    """Return a mouse with its truth."""
    points, known = landmarks(data / f"{name}.mrk.json"), skull_template(data)
    codes = [code for code in points if code in known and code != "49"]
    a, b = (np.array([where[code] for code in codes]) for where in (known, points))
    turn = Rotation.align_vectors(b - b.mean(axis=0), a - a.mean(axis=0))[0].as_matrix()
    plane = mid_plane_of(points)
    left, back = turn[:, 0], turn[:, 1]
    left = plane.normal * np.sign(plane.normal @ left)
    back = back - (back @ left) * left
    back /= np.linalg.norm(back)
    axes = np.stack([left, back, np.cross(left, back)], axis=1)
    return Case("mice as stored", name, read_volume(data / f"{name}.nii.gz"), plane, axes)


# ---- what is done to them


def turned(case: Case, seed: int) -> Case:
    """Return the head turned at random, resampled into the box around the turned scan."""
    R = Rotation.random(random_state=seed).as_matrix()
    v = case.volume
    low, high = v.extent
    centre, half = (low + high) / 2, (high - low) / 2
    half = np.abs(R) @ half
    step = min(v.spacing)
    axes = [centre[a] - half[a] + step * np.arange(int(np.ceil(2 * half[a] / step))) for a in range(3)]
    out = np.empty([len(a) for a in axes[::-1]], np.float32)
    values = v.array.astype(np.float32)
    y, x = np.meshgrid(axes[1], axes[0], indexing="ij")
    for k, z in enumerate(axes[2]):
        p = np.stack([x.ravel(), y.ravel(), np.full(x.size, z)], axis=1)
        index = v.scan_to_voxel((p - centre) @ R + centre)[:, ::-1].T
        out[k] = map_coordinates(values, index, order=1, cval=float(values.min())).reshape(x.shape)
    volume = Volume.from_parts(out, [step] * 3, centre - half, name=v.name)
    point = R @ (case.plane.nearest(centre) - centre) + centre
    plane = MidPlane.through(point, R @ case.plane.normal)
    return replace(case, group="mice turned", volume=volume, plane=plane, axes=R @ case.axes)


def cropped(case: Case, face: str, fraction: float) -> Case:
    """Return the scan without a fraction of its bone at one face of its grid (named as if along LPS)."""
    v, axis = case.volume, "LRPASI".index(face) // 2
    bone = (v.array > propose_threshold(v)).sum(axis=tuple(a for a in range(3) if a != 2 - axis))
    share = np.cumsum(bone) / bone.sum()
    high = face in "LPS"
    start = 0 if high else int(np.searchsorted(share, fraction))
    stop = int(np.searchsorted(share, 1 - fraction)) if high else len(share)
    index = [slice(None)] * 3
    index[2 - axis] = slice(start, stop)
    T = v.T_scan_voxel.copy()
    T[:3, 3] += T[:3, axis] * start
    volume = Volume(v.array[tuple(index)], T, name=v.name)
    name = f"{case.name} {fraction:.0%} off {face}"
    group = case.group.split()[0] + f" cropped {fraction:.0%}"
    return replace(case, group=group, name=name, volume=volume)


def one_side_off(case: Case, fraction: float) -> Case:
    """Return the head without a fraction of its bone on its own left: beyond the scan, as a fill."""
    v = case.volume
    mask = v.array > propose_threshold(v)
    index = np.indices(v.array.shape)[::-1].reshape(3, -1).T
    height = case.plane.heights(v.voxel_to_scan(index)).reshape(v.array.shape)
    cut = np.quantile(height[mask], 1 - fraction)
    low = float(v.array.min()) - 1
    values = np.where(height > cut, low, v.array.astype(np.float32))
    volume = Volume(values, v.T_scan_voxel, name=v.name, fill=low)
    return replace(case, group=f"hard: {fraction:.0%} off one side", volume=volume, hard=True)


def with_tube(case: Case) -> Case:
    """Return the head with a tube as bright as bone around it and a rod through it."""
    v = case.volume
    bright = float(np.percentile(v.array[v.array > propose_threshold(v)], 60))
    index = np.indices(v.array.shape)[::-1].reshape(3, -1).T
    p = v.voxel_to_scan(index) - v.extent.mean(axis=0)
    radius = np.abs(np.hypot(p[:, 0], p[:, 1]) - 0.46 * min(np.ptp(v.extent, axis=0)[:2])) < 0.3
    rod = np.hypot(p[:, 1] - 1.0, p[:, 2] - 0.3 * p[:, 0]) < 0.8
    values = np.where((radius | rod).reshape(v.array.shape), bright, v.array).astype(np.float32)
    volume = Volume(values, v.T_scan_voxel, name=v.name)
    return replace(case, group="hard: tube and rod", volume=volume, hard=True)


def two_heads(case: Case, other: Case, group: str) -> Case:
    """Return the head with another one beside it in the scan; either plane is right."""
    a, b = case.volume, other.volume
    size = np.maximum(a.array.shape, b.array.shape)
    size[2] = a.array.shape[2] + b.array.shape[2]
    values = np.full(size, a.array.min(), np.float32)
    values[tuple(slice(n) for n in a.array.shape)] = a.array
    values[: b.array.shape[0], : b.array.shape[1], a.array.shape[2] :] = b.array
    beside = np.eye(4)
    beside[0, 3] = a.array.shape[2]
    moved = a.T_scan_voxel @ beside @ np.linalg.inv(b.T_scan_voxel)
    point = moved[:3, :3] @ other.plane.nearest(np.zeros(3)) + moved[:3, 3]
    second = (MidPlane.through(point, np.linalg.inv(moved[:3, :3]).T @ other.plane.normal), other.axes)
    name = f"{case.name} and {other.name}"
    volume = Volume(values, a.T_scan_voxel, name=a.name)
    return replace(case, group=group, name=name, volume=volume, hard=True, others=(second,))


def phantom(seed: int, names: tuple[str, ...], spacing: float, group: str, **given: Any) -> Case:
    """Return a phantom with its truth."""
    variation = HeadVariation.drawn(seed, names).having(given)
    made = make_phantom(seed, spacing=spacing, variation=variation)
    T = made.T_head_scan
    plane = MidPlane(T.rotation[0], -float(T.translation[0]))
    name = f"phantom {seed} " + " ".join(f"{k}={v}" for k, v in given.items())
    return Case(group, name, made.volume, plane, T.inverse().rotation, group.startswith("hard"))


# ---- judging


def judged(case: Case, template: HeadTemplate) -> dict[str, Any]:
    """Straighten one case and compare it with its truth."""
    row: dict[str, Any] = {"group": case.group, "name": case.name, "hard": case.hard}
    start = time.process_time()
    try:
        pose = straighten(case.volume, template=template)
    except GpError as error:
        return row | {"refused": str(error), "cpu": time.process_time() - start}
    cpu = time.process_time() - start
    plane, axes = pose.mid_plane, pose.T_head_scan.inverse().rotation
    true_plane, true_axes = min(case.truths, key=lambda truth: plane.angle_to_deg(truth[0]))
    middle = case.volume.extent.mean(axis=0)[None]
    sign = np.sign(plane.normal @ true_plane.normal)
    left, back = plane.normal @ true_axes, axes[:, 1]
    left *= np.sign(left[0])
    confidence = pose.confidence
    return row | {
        "deg": plane.angle_to_deg(true_plane),
        "mm": float(abs(plane.heights(middle)[0] - sign * true_plane.heights(middle)[0])),
        "pitch": float(np.degrees(np.arctan2(back @ true_axes[:, 2], back @ true_axes[:, 1]))),
        "roll": float(np.degrees(np.arctan2(left[2], left[0]))),
        "yaw": float(np.degrees(np.arctan2(left[1], left[0]))),
        "front": bool(back @ true_axes[:, 1] > 0.5 and axes[:, 2] @ true_axes[:, 2] > 0.5),
        "warned": bool(pose.warnings),
        "confidence": None if confidence is None else vars(confidence),
        "cpu": cpu,
    }


def cases(args: argparse.Namespace) -> Iterator[Case]:
    """Yield all cases that were asked for."""
    data = args.data or next((d for d in DATA if d.is_dir()), DATA[0])
    names = sorted(p.name.removesuffix(".nii.gz") for p in data.glob("*_.nii.gz"))
    chosen = {"none": [], "tuned": TUNED_ON, "others": [n for n in names if n not in TUNED_ON], "all": names}
    mice = list(chosen[args.mice])[: args.few]
    previous = None
    for n, name in enumerate(mice):
        whole = mouse(data, name)
        yield whole
        yield turned(whole, n)
        if args.crops:
            for face in (FACES[n % 6], FACES[(n + 3) % 6]):
                yield cropped(whole, face, 0.3)
        if args.hard:
            yield one_side_off(whole, 0.6)
            yield one_side_off(whole, 0.7)
            yield with_tube(whole)
            if previous is not None:
                yield two_heads(whole, previous, "hard: two mice")
        previous = whole
    for n, seed in enumerate(args.phantoms):
        yield from phantoms(args, n, seed)


def phantoms(args: argparse.Namespace, n: int, seed: int) -> Iterator[Case]:
    """Yield the phantoms of one seed."""
    varied = (*USUAL, "turn")
    yield phantom(seed, ("turn",), args.spacing, "phantoms turned")
    whole = phantom(seed, varied, args.spacing, "phantoms varied, turned")
    yield whole
    if args.crops:
        cut = (0.3, FACES[n % 6])
        yield phantom(seed, varied, args.spacing, "phantoms cropped 30%", crop=cut)
    if args.hard:
        kind = ("tube", "cradle", "rod")[n % 3]
        yield phantom(seed, varied, args.spacing, "hard: holders", holder=kind)
        yield phantom(seed, (*varied, "electrode", "broken_bulla"), args.spacing, "phantoms damaged")
        yield phantom(seed, varied, args.spacing, "phantoms mirrored", mirrored="silent")
        second = phantom(seed + 1, varied, args.spacing, "")
        yield two_heads(whole, second, "hard: two phantoms")


def show(row: dict[str, Any]) -> None:
    """Print one case."""
    if "refused" in row:
        text = f"refused: {row['refused'][:90]}"
    else:
        c = row["confidence"]
        text = (
            f"{row['deg']:6.2f} deg {row['mm']:6.3f} mm, pitch {row['pitch']:6.1f}, "
            f"front and up {'right' if row['front'] else 'WRONG'}{' (warned)' if row['warned'] else ''}, "
            f"agreement {c['agreement']:.2f} overlap {c['overlap']:.2f} margin {c['margin']:.2f} "
            f"uncertainty {c['uncertainty_deg']:.1f}"
        )
    print(f"{row['group']:26s} {row['name']:34s} {text}, {row['cpu']:.1f} s", flush=True)


def summary(rows: list[dict[str, Any]]) -> None:
    """Print the figures of each group."""
    print(
        "\ngroup: n, refused, over 3 degrees | degrees, mm: median / 90 % / max | front | "
        "pitch, roll, yaw: median / max | CPU s"
    )
    for group in dict.fromkeys(row["group"] for row in rows):
        own = [row for row in rows if row["group"] == group]
        found = [row for row in own if "deg" in row]
        over = sum(row["deg"] > 3.0 for row in found)
        line = f"{group:26s} {len(own):3d}, {len(own) - len(found):2d}, {over}"
        if found:
            for key in ("deg", "mm"):
                values = np.array([row[key] for row in found])
                line += f" | {np.median(values):.2f} / {np.quantile(values, 0.9):.2f} / {values.max():.2f}"
            line += f" | {sum(row['front'] for row in found)} of {len(found)}"
            line += " | " + ", ".join(angles(found, key) for key in ("pitch", "roll", "yaw"))
        print(
            line
            + f" | {np.median([row['cpu'] for row in own]):.1f}, max {max(row['cpu'] for row in own):.1f}"
        )
    wrong = [row for row in rows if row.get("deg", 0.0) > 3.0]
    print(f"accepted though more than 3 degrees off: {len(wrong)} of {len(rows)}")


def angles(rows: list[dict[str, Any]], key: str) -> str:
    """Return the median and the greatest error of an angle, degrees, of heads whose front is right."""
    values = [abs(row[key]) for row in rows if row["front"]]
    return f"{np.median(values):.2f} / {max(values):.2f}" if values else "-"


def seeds(text: str) -> list[int]:
    """Return the seeds of a text such as 101-110."""
    first, _, last = text.partition("-")
    return list(range(int(first), int(last or first) + 1))


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--mice", choices=("none", "tuned", "others", "all"), default="tuned")
    parser.add_argument("--few", type=int, default=None, metavar="N", help="the first N mice only")
    parser.add_argument("--phantoms", type=seeds, default=[], metavar="N-M")
    parser.add_argument("--spacing", type=float, default=0.4, help="of phantoms, mm")
    parser.add_argument("--crops", action="store_true", help="also with 30 %% of the bone cut off")
    parser.add_argument("--hard", action="store_true", help="also what must be refused, or be right")
    parser.add_argument("--like", metavar="MOUSE", help="front, up and pitch from this mouse")
    parser.add_argument("--data", type=Path, help="folder of the mice")
    parser.add_argument("--json", type=Path)
    args = parser.parse_args()
    template = phantom_template()
    if args.like:
        known = mouse(args.data or next(d for d in DATA if d.is_dir()), args.like)
        middle = known.plane.nearest(known.volume.extent.mean(axis=0))
        T = RigidTransform.from_parts(known.axes, middle, dst="scan", src="head").inverse()
        template = HeadTemplate.of(known.volume, T)
    rows = []
    for case in cases(args):
        rows.append(judged(case, template))
        show(rows[-1])
    if not rows:
        sys.exit("no cases: is ../shared/data/mouse_ct there?")
    summary(rows)
    if args.json:
        args.json.write_text(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
