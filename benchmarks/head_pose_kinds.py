"""Which kinds of scans are straightened, refused, or wrongly accepted: kinds that no limit was chosen on.

    python benchmarks/head_pose_kinds.py --phantoms 431-438             every kind, each head turned at random
    python benchmarks/head_pose_kinds.py --phantoms none --mice all     the mice, turned, cropped, resampled
    python benchmarks/head_pose_kinds.py --phantoms 431 --kinds table "8 bits"

A head is painted once and its scan then altered, so that one seed gives many kinds. Kinds that may be refused
are marked "may". Limits were chosen on seeds 400 to 430; those from 431 on are for reports. One thread.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
from scipy.ndimage import gaussian_filter, zoom

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "benchmarks")]

from head_pose import (  # noqa: E402
    DATA,
    FACES,
    Case,
    cropped,
    judged,
    mouse,
    phantom,
    seeds,
    show,
    summary,
    turned,
    two_heads,
)

from gp_labeler.head_pose import MidPlane  # noqa: E402
from gp_labeler.head_pose.template import phantom_template  # noqa: E402
from gp_labeler.imaging.threshold import propose_threshold  # noqa: E402
from gp_labeler.imaging.volume import Volume  # noqa: E402
from gp_labeler.phantom import USUAL  # noqa: E402

Alter = Callable[[Case, np.random.Generator], Case]

# ---- what is painted: one of these for each seed

PAINTED: tuple[tuple[str, tuple[str, ...], dict[str, Any]], ...] = (
    ("usual", (), {}),
    ("tube", (), {"holder": "tube"}),
    ("cradle", (), {"holder": "cradle"}),
    ("rod", (), {"holder": "rod"}),
    ("wire, clip, broken bulla", ("electrode", "clip", "broken_bulla"), {}),
    ("no jaw", (), {"jaw": False}),
    ("no jaw, dry", ("dry",), {"jaw": False}),
    ("hard beam, rings", (), {"beam_hardening": 0.4, "rings": 3000.0, "bone_density": 0.6}),
)


@contextmanager
def jaw(painted: bool) -> Iterator[None]:
    """Leave the jaw out of phantoms, or not."""
    if painted:
        yield
    else:
        with mock.patch("gp_labeler.phantom.phantom.paint_jaw"):
            yield


def painted(seed: int, spacing: float) -> Case:
    """Return the phantom of a seed, turned at random; what is painted beside it goes by the seed."""
    name, names, given = PAINTED[seed % len(PAINTED)]
    given = dict(given)
    with jaw(given.pop("jaw", True)):
        return phantom(seed, (*USUAL, "turn", *names), spacing, f"painted: {name}", **given)


# ---- what is done to a scan


def of(case: Case, values: np.ndarray, **given: Any) -> Case:
    """Return the case with other grey values on the same grid."""
    return replace(case, volume=Volume(values, case.volume.T_scan_voxel, name=case.volume.name, **given))


def eight_bits(case: Case, rng: np.random.Generator) -> Case:
    """As stored with 8 bits, what is bright cut off."""
    values = case.volume.array.astype(np.float32)
    low, high = np.percentile(values[::3, ::3, ::3], (0.1, rng.uniform(99.0, 99.9)))
    return of(case, (255 * (values - low) / (high - low)).clip(0, 255).astype(np.uint8))


def signed(case: Case, rng: np.random.Generator) -> Case:
    """As Hounsfield units: air is about -1000."""
    values = case.volume.array.astype(np.float32)
    low, high = np.percentile(values[::3, ::3, ::3], (1, 99.9))
    return of(case, (3500 * (values - low) / (high - low) - 1000).astype(np.int16))


def inverted(case: Case, rng: np.random.Generator) -> Case:
    """Dark bone in bright air."""
    values = case.volume.array.astype(np.int32)
    return of(case, (values.max() - values).astype(np.uint16))


def coarse(case: Case, rng: np.random.Generator) -> Case:
    """Of voxels twice as large."""
    return means(case, (2, 2, 2))


def anisotropic(case: Case, rng: np.random.Generator) -> Case:
    """Of slices four times as thick as their pixels."""
    factors = [1, 1, 1]
    factors[int(rng.integers(3))] = 4
    return means(case, tuple(factors))


def means(case: Case, factors: tuple[int, ...]) -> Case:
    """Of means of blocks of voxels (z, y, x)."""
    v = case.volume
    shape = [n // f for n, f in zip(v.array.shape, factors, strict=True)]
    part = v.array[tuple(slice(n * f) for n, f in zip(shape, factors, strict=True))].astype(np.float32)
    blocks = part.reshape([m for n, f in zip(shape, factors, strict=True) for m in (n, f)])
    T = v.T_scan_voxel.copy()
    T[:3, 3] += T[:3, :3] @ ((np.array(factors[::-1]) - 1) / 2)
    T[:3, :3] *= factors[::-1]
    return replace(case, volume=Volume(blocks.mean(axis=(1, 3, 5)), T, name=v.name))


def noisy(case: Case, rng: np.random.Generator) -> Case:
    """With noise a third as strong as bone is bright."""
    values = case.volume.array.astype(np.float32)
    threshold = propose_threshold(case.volume)
    contrast = np.median(values[values > threshold]) - np.median(values)
    return of(case, values + rng.normal(0, contrast / 3, values.shape).astype(np.float32))


def mirrored(case: Case, rng: np.random.Generator) -> Case:
    """Of slices in the reverse order, which the file does not say."""
    v = case.volume
    mirror = np.diag([1.0, 1.0, -1.0])
    low, high = v.extent
    shift = np.array([0.0, 0.0, low[2] + high[2]])
    point = mirror @ case.plane.nearest((low + high) / 2) + shift
    axes = mirror @ case.axes * (-1.0, 1.0, 1.0)
    plane = MidPlane.through(point, mirror @ case.plane.normal)
    turned_over = of(case, np.ascontiguousarray(v.array[::-1]))
    return replace(turned_over, plane=plane, axes=axes)


def in_circle(case: Case, rng: np.random.Generator) -> Case:
    """With a fill beyond the scanner's circle that the file does not name, darker or as bright as bone."""
    v = case.volume
    ny, nx = v.array.shape[1:]
    y, x = np.indices((ny, nx)) - np.array([[[ny - 1]], [[nx - 1]]]) / 2
    outside = np.hypot(y, x) > rng.uniform(0.85, 1.05) * min(ny, nx) / 2
    fill = float(rng.choice([v.array.min() - 1.0, -1000.0, np.percentile(v.array, 50)]))
    return of(case, np.where(outside[None], np.float32(fill), v.array.astype(np.float32)))


def bone_value(case: Case) -> float:
    """Return about how bright bone is."""
    values = case.volume.array
    return float(np.percentile(values[values > propose_threshold(case.volume)], 60))


def places(case: Case) -> np.ndarray:
    """Return the place of each voxel (N, 3), mm."""
    index = np.indices(case.volume.array.shape)[::-1].reshape(3, -1).T
    return case.volume.voxel_to_scan(index)


def with_table(case: Case, rng: np.random.Generator) -> Case:
    """On a table as bright as bone, at one face of the scan."""
    v, face = case.volume, int(rng.integers(6))
    axis, n = face % 3, max(2, case.volume.array.shape[face % 3] // 30)
    table = np.full([n if a == axis else m for a, m in enumerate(v.array.shape)], bone_value(case))
    table = np.concatenate([table, np.full_like(table, v.array.min())], axis)
    parts = [v.array, np.flip(table, axis)] if face < 3 else [table, v.array]
    T = v.T_scan_voxel.copy()
    if face >= 3:
        T[:3, 3] -= 2 * n * T[:3, 2 - axis]
    grown = Volume(np.concatenate(parts, axis).astype(np.float32), T, name=v.name)
    return replace(case, volume=grown)


def with_limbs(case: Case, rng: np.random.Generator) -> Case:
    """With long bones beside the head, on one side."""
    v, p = case.volume, places(case)
    centre, extent = v.extent.mean(axis=0), float(np.ptp(v.extent, axis=0).mean())
    solid = np.zeros(len(p), dtype=bool)
    side = case.plane.normal * rng.choice([-1, 1])
    for _ in range(3):
        along = rng.normal(size=3)
        along /= np.linalg.norm(along)
        start = centre + 0.3 * extent * side + rng.normal(0, 0.08 * extent, 3)
        t = (p - start) @ along
        off = np.linalg.norm(p - start - t[:, None] * along, axis=1)
        solid |= (off < 0.025 * extent) & (abs(t) < 0.2 * extent)
    values = np.where(solid.reshape(v.array.shape), bone_value(case), v.array)
    return of(case, values.astype(np.float32))


def crop_at(fraction: float) -> Alter:
    """Of a scan whose edge cuts some of the bone."""
    return lambda case, rng: cropped(case, str(rng.choice(list(FACES))), fraction)


def one_ear(case: Case, rng: np.random.Generator) -> Case:
    """Of a box around one ear."""
    ear = case.plane.nearest(case.volume.extent.mean(axis=0)) + 0.0
    bone = places(case)[(case.volume.array > propose_threshold(case.volume)).ravel()]
    side = rng.choice([-1, 1]) * case.plane.normal
    back = bone[(bone - ear) @ case.axes[:, 1] > np.quantile((bone - ear) @ case.axes[:, 1], 0.5)]
    beside = back[(back - ear) @ side > 0.1 * np.ptp((back - ear) @ side)]
    return boxed(case, beside.min(axis=0), beside.max(axis=0))


def both_ears(case: Case, rng: np.random.Generator) -> Case:
    """Of a box around both ears: the front half of the head lies beyond the scan."""
    bone = places(case)[(case.volume.array > propose_threshold(case.volume)).ravel()]
    along = bone @ case.axes[:, 1]
    back = bone[along > np.quantile(along, 0.5)]
    return boxed(case, back.min(axis=0), back.max(axis=0))


def boxed(case: Case, low: np.ndarray, high: np.ndarray) -> Case:
    """Of the part of a scan in a box, LPS mm."""
    v = case.volume
    corners = v.scan_to_voxel(np.array([low, high]))
    size = np.array(v.array.shape[::-1])
    first = np.clip(corners.min(axis=0).round().astype(int), 0, size - 2)
    last = np.clip(corners.max(axis=0).round().astype(int) + 1, first + 2, size)
    T = v.T_scan_voxel.copy()
    T[:3, 3] += T[:3, :3] @ first
    part = v.array[first[2] : last[2], first[1] : last[1], first[0] : last[0]]
    return replace(case, volume=Volume(np.ascontiguousarray(part), T, name=v.name))


def blurred(case: Case, rng: np.random.Generator) -> Case:
    """Of a scanner that is out of focus, on a finer grid than it deserves."""
    values = gaussian_filter(case.volume.array.astype(np.float32), 1.2)
    T = case.volume.T_scan_voxel.copy()
    fine = zoom(values, 1.5, order=1, grid_mode=True, mode="nearest")
    factors = np.array([n / m for n, m in zip(values.shape, fine.shape, strict=True)])[::-1]
    T[:3, 3] += T[:3, :3] @ ((factors - 1) / 2)
    T[:3, :3] *= factors
    return replace(case, volume=Volume(fine, T, name=case.volume.name))


KINDS: dict[str, tuple[Alter, bool]] = {
    "8 bits": (eight_bits, False),
    "signed": (signed, False),
    "coarse": (coarse, False),
    "anisotropic": (anisotropic, False),
    "noisy": (noisy, False),
    "blurred": (blurred, False),
    "mirrored": (mirrored, False),
    "circle": (in_circle, False),
    "crop 30 %": (crop_at(0.3), False),
    "crop 40 %": (crop_at(0.4), True),
    "both ears": (both_ears, True),
    "table": (with_table, False),
    "limbs": (with_limbs, False),
    "inverted": (inverted, True),
    "one ear": (one_ear, True),
}
"""Each with whether it may be refused."""


def altered(whole: Case, names: list[str], n: int) -> Iterator[Case]:
    """Yield a scan in some kinds."""
    for k, name in enumerate(names):
        alter, may = KINDS[name]
        made = alter(whole, np.random.default_rng([n, k]))
        group = ("may: " if may else "") + name
        yield replace(made, group=group, name=f"{whole.name} {whole.group}", hard=may)


def cases(args: argparse.Namespace) -> Iterator[Case]:
    """Yield all cases that were asked for; each head in every `args.every`-th kind."""
    wholes = [(seed, lambda seed=seed: painted(seed, args.spacing)) for seed in args.phantoms]
    if args.mice:
        data = next(d for d in DATA if d.is_dir())
        names = sorted(p.name.removesuffix(".nii.gz") for p in data.glob("*_.nii.gz"))
        wholes += [
            (i, lambda i=i, m=m: turned(mouse(data, m), 500 + i))
            for i, m in enumerate(names)
            if args.mice in ("all", m)
        ]
    previous = None
    for n, make in wholes:
        whole = make()
        kinds = args.kinds or list(KINDS)[n % args.every :: args.every]
        if not args.kinds:
            yield whole
        yield from altered(whole, [k for k in kinds if k in KINDS], n)
        if previous is not None and (not args.kinds or "two heads" in args.kinds):
            yield two_heads(whole, previous, "may: two heads")
        previous = whole


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--phantoms", type=seeds_or_none, default=[], metavar="N-M")
    parser.add_argument("--mice", default="", metavar="all|NAME")
    parser.add_argument("--kinds", nargs="+", choices=[*KINDS, "two heads"])
    parser.add_argument("--every", type=int, default=1, metavar="N", help="each head in every N-th kind only")
    parser.add_argument("--spacing", type=float, default=0.5, help="of phantoms, mm")
    parser.add_argument("--json", type=Path)
    args = parser.parse_args()
    template, rows = phantom_template(), []
    for case in cases(args):
        rows.append(judged(case, template))
        show(rows[-1])
    summary(rows)
    must = [row for row in rows if not row["hard"]]
    refused = sum("refused" in row for row in must)
    print(f"refused of those that should be found: {refused} of {len(must)}")
    if args.json:
        args.json.write_text(json.dumps(rows, indent=1))


def seeds_or_none(text: str) -> list[int]:
    """Return the seeds of a text such as 431-438; of none, no seed."""
    return [] if text == "none" else seeds(text)


if __name__ == "__main__":
    main()
