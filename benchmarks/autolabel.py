"""First labels by themselves: how good poses, guesses and radii are, on heads that chose nothing.

    python benchmarks/autolabel.py pose --heads mice --turns 20 --out carried/
    python benchmarks/autolabel.py carry --heads mice --out carried/      every head from every other
    python benchmarks/autolabel.py guesses --heads mice --out carried/    errors, radii, subsets of templates
    python benchmarks/autolabel.py exchanges --heads mice --out carried/  planted exchanges, false alarms

Heads are ``mice`` (the ten of ../shared that chose nothing), ``dev-mice`` (the three that did), ``phantoms``
(as they are), ``varied`` (the same seeds, varied) and ``dev-phantoms`` (seeds 1 to 5). Settings are chosen
on seeds 101 to 110 and on the dev-mice; figures are of seeds from 201 on. Each is predicted from the others
of its kind, or from those of ``--library``.
"""

from __future__ import annotations

import argparse
import itertools
import json
import sys
import time
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from gp_core.io import read_points
from gp_labeler.autolabel import LabelledScan, TemplateLibrary
from gp_labeler.autolabel.confidence import GuessConfidence, HeldOut, centre_of, spread_of
from gp_labeler.autolabel.cross_check import check_predictions
from gp_labeler.autolabel.detours import detours_of
from gp_labeler.autolabel.labelled_scan import flat_points
from gp_labeler.autolabel.pose_search import find_pose
from gp_labeler.autolabel.prediction import Prediction
from gp_labeler.autolabel.registration import engine_named
from gp_labeler.autolabel.registration_process import HereRegistration
from gp_labeler.autolabel.template import Template
from gp_labeler.head_pose.surface_fit import angle_deg, fit_similarity
from gp_labeler.imaging.volume import Volume
from gp_labeler.phantom import USUAL, HeadVariation, make_phantom

MICE = Path(__file__).resolve().parents[2] / "shared" / "data" / "mouse_ct"
CHOSE = ("A_J_", "AKR_J_", "SJL_J_")
SPACING = 0.2


def mice(names: list[str] | None = None) -> list[LabelledScan]:
    """Return the shared mice."""
    scans = []
    for file in sorted(MICE.glob("*_.mrk.json")):
        name = file.name.removesuffix(".mrk.json")
        points = {p.label: p.position for p in read_points(file).points if p.position is not None}
        scans.append(LabelledScan(name, points, MICE / f"{name}.nii.gz"))
    return [scan for scan in scans if names is None or scan.name in names]


def phantoms(seeds: Iterable[int], varied: bool) -> list[LabelledScan]:
    """Return phantoms, which are made when they are needed first."""
    scans = []
    for seed in seeds:
        variation = HeadVariation.drawn(seed, USUAL) if varied else HeadVariation()
        head = make_phantom(seed, spacing=SPACING, variation=variation)
        scans.append(LabelledScan(head.specimen.name, flat_points(head.specimen.sides), volume=head.volume))
    return scans


def heads_of(kind: str, seeds: list[int]) -> list[LabelledScan]:
    """Return the heads of one kind, phantoms of some seeds."""
    if kind in ("mice", "dev-mice"):
        return mice(list(CHOSE) if kind == "dev-mice" else None)
    return phantoms(range(1, 6) if kind == "dev-phantoms" else seeds, kind == "varied")


def true_pose(scan: LabelledScan, template: Template, names: Iterable[str]) -> np.ndarray:
    """Return the rotation from a template to a head, by some of the landmarks that both have."""
    names = tuple(name for name in names if name in template.points)
    here = np.array([scan.points[name] for name in names])
    weights = np.full(len(names), 1 / len(names))
    return fit_similarity(template.array(names), here, weights, (0.5, 2.0)).rotation


def without_jaw_and_nose(scan: LabelledScan) -> np.ndarray:
    """Return the voxels of a phantom, with air from 9 mm below the ears, and 18 mm behind the incisors."""
    array = np.array(scan.load().array, dtype=np.float32)
    index = np.linalg.inv(scan.load().T_scan_voxel)
    ears = np.mean([xyz for name, xyz in scan.points.items() if name not in ("IN", "ZL_L", "ZL_R")], axis=0)
    below = int((index @ [*(ears - [0, 0, 9.0]), 1.0])[2])
    before = int((index @ [*(scan.points["IN"] + [0, 18.0, 0]), 1.0])[1])
    array[: max(below, 0)] = array[:, : max(before, 0)] = array.min()
    return array


def cropped(array: np.ndarray, affine: np.ndarray, share: float, rng: np.random.Generator) -> np.ndarray:
    """Return the part of a scan with a share of its brightest voxels, cut off by a face; moves `affine`."""
    axis, is_high = int(rng.integers(3)), bool(rng.integers(2))
    places = np.argwhere(array > np.percentile(array, 90))[:, 2 - axis]
    at = int(np.quantile(places, 1 - share if is_high else share))
    if is_high:
        affine[:3, 3] += affine[:3, axis] * at
    return np.take(array, range(at, array.shape[2 - axis]) if is_high else range(at), axis=2 - axis)


def spoiled(scan: LabelledScan, kind: str, rng: np.random.Generator) -> Volume:
    """Return a scan turned at random, and noisy, coarse, cropped or cut off as its kind says."""
    volume = scan.load()
    array = np.asarray(volume.array, dtype=np.float32)
    fill = None
    affine = np.array(volume.T_scan_voxel)
    if kind == "jawless":
        array = without_jaw_and_nose(scan)
    if kind.startswith("crop"):
        array = cropped(array, affine, float(kind[4:]) / 100, rng)
    if kind == "noisy":
        array = array + rng.normal(0, 0.08 * (np.percentile(array, 99.5) - array.min()), array.shape)
    if kind == "coarse":
        n = [d // 2 * 2 for d in array.shape]
        blocks = array[: n[0], : n[1], : n[2]].reshape(n[0] // 2, 2, n[1] // 2, 2, n[2] // 2, 2)
        array = blocks.mean(axis=(1, 3, 5))
        affine[:3, 3] += affine[:3, :3] @ np.full(3, 0.5)
        affine[:3, :3] *= 2
    if kind.startswith("cut"):
        places = np.argwhere(array > np.percentile(array, 90))
        normal = rng.normal(size=3)
        normal /= np.linalg.norm(normal)
        edge = np.quantile(places @ normal, 1 - float(kind[3:]) / 100)
        fill = float(array.min()) - 1000
        z, y, x = (n * np.arange(size) for n, size in zip(normal, array.shape, strict=True))
        array = np.where(z[:, None, None] + y[:, None] + x > edge, fill, array)
    turn = np.eye(4)
    turn[:3, :3] = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    turn[:3, :3] *= np.sign(np.linalg.det(turn[:3, :3]))
    return Volume(array.astype(np.float32), turn @ affine, name=volume.name, fill=fill)


def measured_points(volume: Volume, points: dict[str, np.ndarray]) -> list[str]:
    """Return the names of the points that lie in a scan, and not in its fill."""
    inside = [name for name, xyz in points.items() if volume.contains(xyz[None])[0]]
    return [name for name in inside if volume.values_at(points[name][None])[0] != volume.fill]


def run_pose(heads: list[LabelledScan], args: argparse.Namespace) -> None:
    """Find poses of heads turned at random, and write a line each."""
    library = TemplateLibrary(heads, args.out / "kept")
    templates = library.templates()
    wanted = heads if args.heads != "mice" else [head for head in heads if head.name not in CHOSE]
    lines = args.out / "pose.jsonl"
    done = {(d["head"], d["turn"], d["kind"]) for d in read_lines(lines)}
    for turn, scan, kind in itertools.product(range(args.turns), wanted, args.kinds):
        if (scan.name, turn, kind) in done:
            continue
        rng = np.random.default_rng([turn, len(scan.name), sum(map(ord, kind + scan.name))])
        template = [t for t in templates if t.name != scan.name][rng.integers(len(templates) - 1)]
        volume = scan.load()
        spoilt = spoiled(scan, kind, rng)
        moved = spoilt.T_scan_voxel[:3, :3] / spoilt.spacing
        back = volume.T_scan_voxel[:3, :3] / volume.spacing
        turn_matrix = moved @ back.T
        in_scan = measured_points(spoilt, {name: turn_matrix @ xyz for name, xyz in scan.points.items()})
        start = time.process_time()
        found = find_pose(spoilt, template.surface)
        line = {
            "head": scan.name,
            "turn": turn,
            "kind": kind,
            "template": template.name,
            "deg": angle_deg(found.fit.rotation, turn_matrix @ true_pose(scan, template, scan.points)),
            "deg_in_scan": angle_deg(found.fit.rotation, turn_matrix @ true_pose(scan, template, in_scan)),
            "in_scan": len(in_scan),
            "score": found.score,
            "lead": found.rival - found.score,
            "seen": found.seen,
            "scale": found.fit.scale,
            "certain": found.is_certain,
            "accepted": found.is_accepted,
            "cpu": time.process_time() - start,
        }
        with lines.open("a") as file:
            file.write(json.dumps(line) + "\n")
    tell_poses(read_lines(lines))


def tell_poses(lines: list[dict]) -> None:
    """Print how poses went, for each kind."""
    for kind in dict.fromkeys(line["kind"] for line in lines):
        own = [line for line in lines if line["kind"] == kind]
        deg = np.array([line["deg"] for line in own])
        in_scan = np.array([line["deg_in_scan"] for line in own])
        certain = np.array([line["certain"] for line in own])
        accepted = np.array([line["accepted"] for line in own])
        print(
            f"{kind:8s} n {len(own):4d}  certain {certain.sum():4d} (worst "
            f"{deg[certain].max(initial=0):5.1f} deg), uncertain {(accepted & ~certain).sum():3d} (worst "
            f"{deg[accepted & ~certain].max(initial=0):5.1f} deg), refused {(~accepted).sum():3d}, "
            f"of which wrong {(deg[~accepted] > 20).sum():3d};  accepted > 20 deg: "
            f"{(deg[accepted] > 20).sum()}, > 5 deg: {(deg[accepted] > 5).sum()} (by landmarks in the scan: "
            f"{(in_scan[accepted] > 5).sum()}, worst {in_scan[accepted].max(initial=0):.1f});  "
            f"CPU {np.mean([line['cpu'] for line in own]):.1f} s"
        )


def read_lines(path: Path) -> list[dict]:
    """Return what was written, a line each."""
    return [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []


def run_carry(heads: list[LabelledScan], args: argparse.Namespace) -> dict[str, dict]:
    """Carry landmarks onto every head from all others, or from those of the library; what is kept stays."""
    registration = HereRegistration(engine_named(args.engine))
    carried = {}
    for scan in heads:
        others = [
            other for other in heads if other is not scan and other.name in (args.library or [other.name])
        ]
        library = TemplateLibrary([scan, *others], args.out / "kept", most=len(heads))
        start = time.process_time()
        found = library.held_out_of(scan, registration)
        carried[scan.name] = {} if found is None else dict(found.carried)
        print(f"{scan.name}: {time.process_time() - start:.0f} CPU s", file=sys.stderr, flush=True)
    return carried


def subsets(names: list[str], k: int, most: int, seed: int) -> Iterator[tuple[str, ...]]:
    """Yield subsets of k names: all, or so many drawn."""
    every = list(itertools.combinations(names, k))
    rng = np.random.default_rng(seed)
    chosen = range(len(every)) if len(every) <= most else rng.choice(len(every), most, replace=False)
    yield from (every[i] for i in chosen)


def held_out_by(heads: dict[str, LabelledScan], carried: dict, name: str, others: tuple[str, ...]) -> HeldOut:
    """Return the errors of one head predicted from some others."""
    errors, spreads = {}, {}
    for point, truth in heads[name].points.items():
        found = np.array([carried[name][o][point] for o in others if point in carried[name][o]])
        if len(found):
            errors[point] = float(np.linalg.norm(centre_of(found) - truth))
            spreads[point] = spread_of(found)
    labels = {other: heads[other].points for other in others}
    between = {other: carried.get(other, {}) for other in others}
    detours = detours_of({other: carried[name][other] for other in others}, labels, between)
    return HeldOut(name, errors, spreads, detours)


def run_guesses(heads: list[LabelledScan], args: argparse.Namespace) -> None:
    """Print errors and radii of every head from subsets of the others."""
    carried = run_carry(heads, args)
    by_name = {scan.name: scan for scan in heads}
    no_target = CHOSE if args.heads == "mice" else (args.library or ())
    wanted = [name for name in by_name if name not in no_target]
    for k in args.k:
        rows = []
        for name in wanted:
            others = list(carried[name])
            for subset in subsets(others, k, args.subsets, seed=len(name)):
                history = (
                    [
                        held_out_by(by_name, carried, one, tuple(o for o in subset if o != one))
                        for one in subset
                    ]
                    if k > 1
                    else []
                )
                confidence = GuessConfidence(history)
                own = held_out_by(by_name, carried, name, subset)
                for point, error in own.errors.items():
                    radius = confidence.radius_95(point, own.spreads[point], own.detours.get(point, np.nan))
                    rows.append((name, point, error, np.nan if radius is None else radius))
        tell_guesses(k, rows)


def tell_guesses(k: int, rows: list[tuple]) -> None:
    """Print one line of figures."""
    error = np.array([row[2] for row in rows])
    radius = np.array([row[3] for row in rows])
    middle, most = np.percentile(error, [50, 90])
    text = f"k {k}  n {len(error)}  median {middle:.3f}  90 % {most:.3f}  max {error.max():.2f}"
    if not np.isnan(radius).all():
        held = error <= radius
        worst = radius >= np.quantile(radius, 0.8)
        large = error > 0.5
        share = (worst & large).sum() / max(large.sum(), 1)
        text += (
            f"  radius holds {100 * held.mean():.1f} % (median {np.median(radius):.2f});  worst 20 % hold "
            f"{100 * share:.0f} % of {large.sum()} errors > 0.5 mm"
        )
    print(text, flush=True)


def run_exchanges(heads: list[LabelledScan], args: argparse.Namespace) -> None:
    """Exchange two labels of a head, many times, and print how often the check of the library names them."""
    predictions = {
        name: Prediction(carried, None)
        for name, carried in run_carry(heads, args).items()
        if len(carried) > 2
    }
    scans = [scan for scan in heads if scan.name in predictions]
    rng, found = np.random.default_rng(0), []
    for scan in scans:
        for _ in range(args.exchanges):
            a, b = (str(name) for name in rng.choice(list(scan.points), 2, replace=False))
            points = dict(scan.points) | {a: scan.points[b], b: scan.points[a]}
            library = [replace(each, points=points) if each is scan else each for each in scans]
            told = check_predictions(library, predictions).of(scan.name)
            found.append(any(f.kind == "exchanged" and set(f.names) == {a, b} for f in told))
    alarms = sum(len(check_predictions(scans, predictions).of(scan.name)) for scan in scans)
    print(
        f"{len(scans)} heads: {sum(found)} of {len(found)} exchanges named; {alarms} findings without one",
        flush=True,
    )


def main() -> None:
    """Run one part."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("part", choices=("pose", "carry", "guesses", "exchanges"))
    parser.add_argument("--heads", default="mice")
    parser.add_argument("--seeds", type=int, nargs="+", default=list(range(201, 211)), help="of phantoms")
    parser.add_argument("--turns", type=int, default=20)
    parser.add_argument(
        "--kinds",
        nargs="+",
        default=["whole"],
        help="whole, noisy, coarse, jawless (phantoms), crop55, cut30, cut45: turned at random as well",
    )
    parser.add_argument("--k", type=int, nargs="+", default=[1, 3, 5])
    parser.add_argument("--subsets", type=int, default=30)
    parser.add_argument("--exchanges", type=int, default=25, help="planted in each head")
    parser.add_argument("--library", nargs="+", help="predict from these alone; by default from all others")
    parser.add_argument("--engine", default="auto")
    parser.add_argument("--out", type=Path, required=True)
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    heads = [
        replace(scan, volume=scan.load()) if scan.path is None else scan
        for scan in heads_of(args.heads, args.seeds)
    ]
    if args.part == "pose":
        run_pose(heads, args)
    elif args.part == "carry":
        run_carry(heads, args)
    elif args.part == "guesses":
        run_guesses(heads, args)
    else:
        run_exchanges(heads, args)


if __name__ == "__main__":
    main()
