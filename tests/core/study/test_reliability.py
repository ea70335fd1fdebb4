"""How repeatable labels are, of simulated observers whose errors are known."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest

from gp_core import Atlas, LandmarkSet, Side, Specimen, Suggestion
from gp_core.atlas.sampling import draw_animal
from gp_core.cli.entry import main
from gp_core.errors import GpError
from gp_core.frames import mirror_x
from gp_core.io import Labelling, landmark_file_name, write_markups
from gp_core.landmarks.anatomy import with_cochlea_origin
from gp_core.study.figures import label_agreement, save_figure
from gp_core.study.reliability import FeatureReliability, ReliabilityReport, reliability

OFFSET = np.array([0.0, 0.0, 0.5])
"""Of CD at OS, mm, in the frame of the head."""

SDS = {"AB": 0.1, "CD": 0.1}
ROUGH = {"ZL": 0.4}


def labelled(n_animals: int, rounds: tuple[int, ...] = (1, 2), seed: int = 0) -> list[Labelling]:
    """Let AB and CD label drawn animals, with 0.1 mm of error on a coordinate (ZL: 0.4 mm)."""
    rng, found = np.random.default_rng(seed), []
    for i in range(n_animals):
        animal = draw_animal(Atlas.published(), rng=rng, name=f"GP{i}", tilt_deg=10)
        for observer, sd in SDS.items():
            for number in rounds:
                sides, shared = {}, None
                for side, truth in animal.sides.items():
                    points = {
                        code: truth[code] + rng.normal(0, ROUGH.get(code, sd), 3)
                        for code in truth.placed
                        if code != "CO"
                    }
                    if observer == "CD":
                        points["OS"] = points["OS"] + OFFSET
                    points["IN"] = shared = points["IN"] if shared is None else shared
                    sides[side] = with_cochlea_origin(LandmarkSet.from_mapping(points, side))
                found.append(Labelling(Specimen(animal.name, sides), observer, number))
    return found


@pytest.fixture(scope="module")
def report() -> ReliabilityReport:
    return reliability(labelled(10))


def of(report: ReliabilityReport, code: str) -> FeatureReliability:
    return next(row for row in report.features if row.code == code)


def test_the_errors_of_the_observers_are_found(report: ReliabilityReport) -> None:
    assert (report.observers, report.n_animals, report.n_sides, report.n_labellings) == (
        ("AB", "CD"),
        10,
        20,
        80,
    )
    for code in ("CA", "RWA", "LLI", "MN"):
        row = of(report, code)
        assert row.intra is not None
        assert row.inter is not None
        assert (row.intra.n_pairs, row.inter.n_pairs) == (40, 20)
        assert row.intra.sd_mm == pytest.approx(0.1, rel=0.25)
        assert row.inter.sd_mm == pytest.approx(0.1, rel=0.35)
    rough = of(report, "ZL").intra
    assert rough is not None
    assert rough.sd_mm == pytest.approx(0.4, rel=0.25)
    overall = report.overall.intra
    assert overall is not None
    assert overall.sd_mm == pytest.approx(np.sqrt((17.5 * 0.01 + 0.16) / 18.5), rel=0.1)


def test_a_point_of_both_sides_is_counted_once(report: ReliabilityReport) -> None:
    intra, inter = of(report, "IN").intra, of(report, "IN").inter
    assert intra is not None
    assert inter is not None
    assert (intra.n_pairs, inter.n_pairs) == (20, 10)
    assert intra.sd_mm == pytest.approx(0.1, rel=0.35)


def test_the_constant_offset_of_an_observer_is_found(report: ReliabilityReport) -> None:
    first, *others = report.offsets
    assert (first.observers, first.code, first.n_sides, first.n_animals) == (("AB", "CD"), "OS", 20, 10)
    assert first.length_mm == pytest.approx(0.5, abs=0.1)
    assert first.offset_mm[2] > 0.4, "upwards"
    assert first.p_corrected < 0.01
    assert min(row.p_corrected for row in others) > 0.05
    os_row, oi = of(report, "OS"), of(report, "OI")
    assert os_row.icc_inter is not None
    assert oi.icc_inter is not None
    assert os_row.icc_inter.icc2 < os_row.icc_inter.icc3 - 0.05, "consistent, but not in agreement"
    assert abs(oi.icc_inter.icc2 - oi.icc_inter.icc3) < 0.02
    assert {d.code for d in report.disagreements} <= {"OS", "ZL"}
    assert report.disagreements[0].distance_mm == max(d.distance_mm for d in report.disagreements)


def test_correlations_are_of_animals_not_of_how_heads_lie(report: ReliabilityReport) -> None:
    fine, varied = of(report, "FPP").icc_inter, of(report, "MN").icc_inter
    assert fine is not None
    assert varied is not None
    assert fine.icc3 < 0.7, "FPP hardly differs between animals: an error of 0.1 mm drowns it"
    assert varied.icc3 > 0.9
    moved = [
        Labelling(
            Specimen(e.specimen.name, {s: _shifted(m, e.specimen.name) for s, m in e.specimen.sides.items()}),
            e.observer,
            e.round,
        )
        for e in labelled(10)
    ]
    again = reliability(moved)
    for a, b in zip(report.rows, again.rows, strict=True):
        assert a.icc_inter is not None
        assert b.icc_inter is not None
        assert b.icc_inter.icc3 == pytest.approx(a.icc_inter.icc3, abs=1e-6)
        assert a.inter is not None
        assert b.inter is not None
        assert b.inter.tem_mm == pytest.approx(a.inter.tem_mm, abs=1e-9)


def _shifted(landmarks: LandmarkSet, name: str) -> LandmarkSet:
    return LandmarkSet(landmarks.points + np.array([0, 0, 40.0 * int(name[2:])]), landmarks.side)


def test_what_it_does_to_the_cochlea_and_the_whole_sets(report: ReliabilityReport) -> None:
    assert report.pose_intra is not None
    assert report.pose_inter is not None
    assert (report.pose_intra.n_pairs, report.pose_inter.n_pairs) == (40, 20)
    assert 0.1 < report.pose_intra.origin_mm["mean"] < 0.35
    assert 1 < report.pose_intra.axis_deg["mean"] < 6
    rows = {row.source: row for row in report.anova}
    assert list(rows) == ["individual", "observer", "individual x observer", "residual"]
    assert rows["observer"].p is not None
    assert rows["observer"].p < 1e-3
    assert rows["individual x observer"].p is not None
    assert rows["individual x observer"].p > 0.01
    assert report.repeatability is not None
    assert 0.7 < report.repeatability < 1
    assert "IN" not in report.anova_features
    assert sum(row.share for row in report.anova) == pytest.approx(1)


def test_one_observer_alone_has_no_error_between_observers() -> None:
    alone = reliability([each for each in labelled(4) if each.observer == "AB"])
    assert alone.overall.inter is None
    assert alone.overall.icc_inter is None
    assert alone.overall.icc_intra is not None
    assert (alone.offsets, alone.pose_inter) == ((), None)
    assert [row.source for row in alone.anova] == ["individual", "residual"]


def test_two_observers_who_labelled_once_have_no_error_within() -> None:
    once = reliability(labelled(4, rounds=(1,)))
    assert once.overall.intra is None
    assert once.pose_intra is None
    assert once.overall.inter is not None
    assert [row.source for row in once.anova] == ["individual", "observer", "individual x observer"]


def test_what_was_not_placed_says_nothing() -> None:
    sets = labelled(4)
    changed = []
    for each in sets:
        sides = dict(each.specimen.sides)
        if each.observer == "CD" and each.round == 2:
            sides[Side.LEFT] = sides[Side.LEFT].with_unseen("MN").with_point("MH", None)
            sides[Side.LEFT] = sides[Side.LEFT].with_suggestions({"MH": Suggestion((0.0, 0.0, 0.0))})
        changed.append(Labelling(Specimen(each.specimen.name, sides), each.observer, each.round))
    found = reliability(changed)
    for code, n_unseen in (("MN", 4), ("MH", 0), ("CA", 0)):
        row = of(found, code)
        assert row.n_unseen == n_unseen
        assert row.intra is not None
        assert row.intra.n_pairs == (16 if code == "CA" else 12)
        assert row.intra.max_mm < 1, "a suggestion is no label"
    assert "MH" not in found.anova_features


def test_a_mirrored_pair_of_ears_has_mirrored_offsets() -> None:
    sets = []
    for each in labelled(3, rounds=(1,)):
        left = each.specimen.side("L")
        right = LandmarkSet(mirror_x(left.points), "R").with_point("IN", None)
        sets.append(
            Labelling(Specimen(each.specimen.name, {Side.LEFT: left, Side.RIGHT: right}), each.observer)
        )
    both, alone = reliability(sets), reliability(
        [Labelling(Specimen(e.specimen.name, {Side.LEFT: e.specimen.side("L")}), e.observer) for e in sets]
    )  # fmt: skip
    for code in ("OS", "CA"):
        one, other = (next(o for o in r.offsets if o.code == code) for r in (both, alone))
        np.testing.assert_allclose(one.offset_mm, other.offset_mm, atol=0.05)


def test_what_cannot_be_compared_is_refused() -> None:
    with pytest.raises(GpError, match=r"no side was labelled twice.*GP01_AB_r2_L\.mrk\.json"):
        reliability([each for each in labelled(3, rounds=(1,)) if each.observer == "AB"])
    sets = labelled(2, rounds=(1,))
    odd = LandmarkSet(sets[0].specimen.side("L").points, "L", frame="cochlea")
    sets[0] = Labelling(Specimen("GP0", {Side.LEFT: odd}), "AB")
    with pytest.raises(GpError, match=r"GP0.*left side are in the frame cochlea, scan"):
        reliability(sets)


def test_a_single_point_or_none_in_common_is_enough_to_say_so(tmp_path: Path) -> None:
    def of_points(observer: str, **points: list[float]) -> Labelling:
        marks = LandmarkSet.from_mapping(points, "L")
        return Labelling(Specimen("GP1", {Side.LEFT: marks}), observer)

    one = reliability([of_points("AB", CA=[0, 0, 0]), of_points("CD", CA=[0, 0, 0.3])])
    assert one.overall.inter is not None
    assert one.overall.inter.mean_mm == pytest.approx(0.3)
    assert (one.anova, one.offsets, one.overall.icc_inter, one.differences) == ((), (), None, ())
    save_figure(label_agreement(one), tmp_path / "empty.svg")
    none = reliability([of_points("AB", CA=[0, 0, 0]), of_points("CD", CB=[0, 0, 0.3])])
    assert (none.features, none.overall.inter) == ((), None)
    json.dumps(none.as_dict(), allow_nan=False)


def test_the_command_prints_and_writes_all_of_it(tmp_path: Path, capsys) -> None:
    folder = tmp_path / "labelled"
    folder.mkdir()
    for each in labelled(6):
        for side, marks in each.specimen.sides.items():
            name = landmark_file_name(each.specimen.name, side, observer=each.observer, round_=each.round)
            known = LandmarkSet(marks.points, side, observer=each.observer, round=each.round)
            write_markups(folder / name, known, specimen=each.specimen.name)
    files = {name: str(tmp_path / f"out.{name}") for name in ("json", "csv", "png")}
    words = ["--json", files["json"], "--csv", files["csv"], "--figure", files["png"]]
    assert main(["reliability", str(folder), *words]) == 0
    said = capsys.readouterr().out
    assert "Labels of 6 animals, 12 sides, 48 labellings by AB, CD" in said
    assert "OS   CD is 0." in said
    assert "Procrustes ANOVA of 18 features" in said
    assert "Farthest apart" in said
    content = json.loads(Path(files["json"]).read_text())
    assert content == reliability(labelled(6)).as_dict()
    table = list(csv.DictReader(Path(files["csv"]).read_text().splitlines()))
    assert [row["feature"] for row in table] == [*(row["feature"] for row in content["features"]), "all"]
    assert float(table[-1]["inter_tem_mm"]) == content["overall"]["inter"]["tem_mm"]
    assert Path(files["png"]).stat().st_size > 10_000
    (tmp_path / "one").mkdir()
    for file in folder.glob("*_AB_r1_*"):
        (tmp_path / "one" / file.name).write_bytes(file.read_bytes())
    assert main(["reliability", str(tmp_path / "one")]) == 2
    assert "no side was labelled twice" in capsys.readouterr().err


def test_the_figure_has_a_panel_for_each_direction(report: ReliabilityReport, tmp_path: Path) -> None:
    figure = label_agreement(report)
    assert [ax.get_ylabel() for ax in figure.axes] == [
        f"Difference, mm {way}" for way in ("forwards", "outwards", "upwards")
    ]
    largest = max(abs(x) for row in report.differences for x in row.difference)
    for ax in figure.axes:
        assert sum(len(c.get_offsets()) for c in ax.collections) == len(report.differences)
        assert ax.get_ylim()[1] > largest, "every point is in the picture"
    save_figure(figure, tmp_path / "agreement.svg")
