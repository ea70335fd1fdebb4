"""Files as other labs and programs write them: sides in labels, columns and names, R, Excel, own names."""

from __future__ import annotations

import json

import numpy as np
import pytest

from gp_core.errors import FeatureError, FileFormatError
from gp_core.io import (
    landmarks_of,
    load_specimens,
    read_lab_names,
    read_landmarks,
    read_points,
    read_touches,
    sides_of,
)
from gp_core.io.file_names import name_parts
from gp_core.landmarks.features import CODES, Side
from gp_core.landmarks.labels import LabelNames, parse_label

_PLACES = {code: np.array([3.0 * i, (7.0 * i) % 11, (5.0 * i) % 13]) for i, code in enumerate(CODES)}
_OTHER = {code: place * [-1, 1, 1] + [40, 0, 0] for code, place in _PLACES.items()}
_TOUCHED = ("CL", "MN", "OS", "RWA", "RWP", "LLI")


def _row(*fields: object, mark: str = ",") -> str:
    return mark.join(str(field) for field in fields) + "\n"


def _both(label: str, *, header: str = "name,x,y,z\n") -> str:
    """A table of both sides, each label made of a code and the letter of its side."""
    text = header
    for letter, places in (("L", _PLACES), ("R", _OTHER)):
        text += "".join(_row(label.format(code=c, side=letter), *p) for c, p in places.items() if c != "IN")
    return text + _row("IN", *_PLACES["IN"])


@pytest.mark.parametrize(
    "label",
    [
        *("CA_L", "CA-L", "L_CA", "l.ca", "left CA", "CA left", "CA (L)", "Left: ca"),
        *("CA__L", "CA/left", "CA, left", "CA – L", "L|CA", "(left) CA", "CA[l]"),  # noqa: RUF001
    ],
)
def test_a_side_before_or_behind_a_code_is_read(label) -> None:
    assert parse_label(label) == ("CA", Side.LEFT)


@pytest.mark.parametrize("label", ["CA", "CAL", "Bolt_L", "left", "L", "L_", "_L", "leftCA", "CA_M", "L_R"])
def test_only_codes_carry_a_side(label) -> None:
    assert parse_label(label).side is None


@pytest.mark.parametrize("label", ["{code}_{side}", "{side}-{code}", "{code} ({side})"])
def test_one_list_holds_both_sides_and_the_point_that_they_share(tmp_path, label) -> None:
    file = tmp_path / "GP01.csv"
    file.write_text(_both(label), encoding="utf-8")
    left, right = sides_of(read_points(file))
    for code in set(CODES) - {"IN"}:
        assert left[code] == pytest.approx(_PLACES[code])
        assert right[code] == pytest.approx(_OTHER[code])
    assert left["IN"] == pytest.approx(right["IN"])
    (animal,) = load_specimens(file)
    assert set(animal.sides) == {Side.LEFT, Side.RIGHT}
    assert read_landmarks(file, side="R")["CA"] == pytest.approx(_OTHER["CA"])
    with pytest.raises(FeatureError, match=r"holds both sides of the head.*Give the side"):
        read_landmarks(file)


def test_a_point_without_a_side_among_others_with_one_is_named(tmp_path) -> None:
    file = tmp_path / "GP01.csv"
    file.write_text(_both("{code}_{side}").replace("RWA_R", "RWA"), encoding="utf-8")
    with pytest.raises(FeatureError, match=r"RWA: gives no side.*RWA_L or RWA_R"):
        sides_of(read_points(file))


def _with_column(side: str, column: str = "side") -> str:
    rows = "".join(_row(code, side, *_PLACES[code]) for code in _TOUCHED)
    return f"name,{column},x,y,z\n{rows}"


@pytest.mark.parametrize("word", ["R", "r", "right", "Right"])
@pytest.mark.parametrize("column", ["side", "Side", "ear"])
def test_a_column_tells_the_side(tmp_path, word, column) -> None:
    file = tmp_path / "touches.csv"
    file.write_text(_with_column(word, column), encoding="utf-8")
    assert landmarks_of(read_points(file)).side is Side.RIGHT
    assert len(read_touches(file, "R").placed) == 6
    for read in (lambda: read_touches(file, "L"), lambda: read_landmarks(file, side="L")):
        with pytest.raises(FeatureError, match="right side, as its labels or its column 'side' say"):
            read()


def test_a_column_that_is_no_side_is_refused(tmp_path) -> None:
    file = tmp_path / "touches.csv"
    file.write_text(_with_column("up"), encoding="utf-8")
    with pytest.raises(
        FileFormatError, match=r"CL: its column 'side' must hold L, R, left or right, got 'up'"
    ):
        read_points(file)


def test_a_label_that_contradicts_the_column_is_named(tmp_path) -> None:
    file = tmp_path / "touches.csv"
    file.write_text(_with_column("R").replace("OS,", "OS_L,"), encoding="utf-8")
    with pytest.raises(
        FeatureError, match=r"OS_L: is of the left side by its label, of the right by its column"
    ):
        read_points(file)


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("left_GP01", ("GP01", Side.LEFT)),
        ("GP01_R_final", ("GP01_final", Side.RIGHT)),
        ("GP01 right (2)", ("GP01 (2)", Side.RIGHT)),
        ("L_12_right", ("L_12", Side.RIGHT)),
        ("GP-left-ear", ("GP-ear", Side.LEFT)),
        ("GP01_(R)", ("GP01", Side.RIGHT)),
        ("GP01 [left] final", ("GP01 final", Side.LEFT)),
        ("rat of L and R", ("rat of L and R", None)),
        ("Larry", ("Larry", None)),
    ],
)
def test_the_side_may_stand_anywhere_in_a_file_name(name, told) -> None:
    assert name_parts(f"{name}.csv", ".csv") == told


@pytest.mark.parametrize("name", ["GP01_R", "right_GP01"])
def test_a_file_name_that_contradicts_labels_or_column_is_refused(tmp_path, name) -> None:
    labels = "name,x,y,z\n" + "".join(_row(f"{code}_L", *place) for code, place in _PLACES.items())
    for text in (labels, _with_column("left")):
        file = tmp_path / f"{name}.csv"
        file.write_text(text, encoding="utf-8")
        with pytest.raises(FeatureError, match="is named as the right side, but its labels or its column"):
            read_landmarks(file)
        with pytest.raises(FeatureError, match="is named as the right side"):
            load_specimens(file)
        assert read_landmarks(file, side="L").side is Side.LEFT


_R_TABLES = {
    "write.csv": '"","x","y","z"\n' + "".join(f'"{c}",{x},{y},{z}\n' for c, (x, y, z) in _PLACES.items()),
    "write.table": "x y z\n" + "".join(f"{c} {x} {y} {z}\n" for c, (x, y, z) in _PLACES.items()),
    "row numbers": '"","landmark","x","y","z"\n'
    + "".join(f'"{i}","{c}",{x},{y},{z}\n' for i, (c, (x, y, z)) in enumerate(_PLACES.items(), 1)),
    "row numbers without a name": "landmark x y z\n"
    + "".join(f"{i} {c} {x} {y} {z}\n" for i, (c, (x, y, z)) in enumerate(_PLACES.items(), 1)),
    "spreadsheet, tabs": "sep=\t\nname\tx\ty\tz\n"
    + "".join(_row(c, *p, mark="\t") for c, p in _PLACES.items()),
    "spreadsheet": "sep=;\nname;x;y;z\n" + "".join(_row(c, *p, mark=";") for c, p in _PLACES.items()),
    "spreadsheet, quoted": '"sep=;"\r\nname;x;y;z\r\n'
    + "".join(_row(c, *p, mark=";") for c, p in _PLACES.items()),
}


@pytest.mark.parametrize("kind", _R_TABLES)
def test_tables_of_r_and_of_spreadsheets_are_read(tmp_path, kind) -> None:
    file = tmp_path / "GP01_L.csv"
    file.write_text(_R_TABLES[kind], encoding="utf-8")
    read = read_landmarks(file)
    assert all(read[code] == pytest.approx(_PLACES[code]) for code in CODES)


@pytest.mark.parametrize("mark", [",", ";"])
def test_an_fcsv_that_went_through_a_spreadsheet_is_read(tmp_path, mark) -> None:
    head = ["# Markups fiducial file version = 4.11", "# CoordinateSystem = LPS"]
    head.append('"# columns = id,x,y,z,ow,ox,oy,oz,vis,sel,lock,label,desc,associatedNodeID"')
    text = "".join(f"{line}{13 * mark}\n" for line in head)
    for i, (code, place) in enumerate(_PLACES.items(), 1):
        text += _row(i, *place, 0, 0, 0, 1, 1, 1, 0, code, "", "", "", "", mark=mark)
    file = tmp_path / "GP01_L.fcsv"
    file.write_text(text, encoding="utf-8")
    read = read_landmarks(file)
    assert all(read[code] == pytest.approx(_PLACES[code]) for code in CODES)


def _their_file(folder, names: dict[str, str]):
    file = folder / "GP01_L.csv"
    ours = {theirs: code for theirs, code in names.items() if code}
    rows = "".join(_row(theirs, *_PLACES[parse_label(code).name]) for theirs, code in ours.items())
    file.write_text("name,x,y,z\n" + rows + _row("Bregma", 1, 2, 3), encoding="utf-8")
    return file


_THEIRS = {"Apex of cochlea": "CA", "base": "CB", "rw ant": "RWA", "RW-post": "RWP_L", "Bregma": ""}


@pytest.mark.parametrize("form", ["csv", "csv with a header", "json", "tsv"])
def test_other_names_are_translated_by_a_small_table(tmp_path, form) -> None:
    table = tmp_path / f"names.{form.partition(' ')[0]}"
    mark = "\t" if form == "tsv" else ","
    text = "".join(_row(theirs, ours, mark=mark) for theirs, ours in _THEIRS.items())
    if form == "json":
        text = json.dumps(_THEIRS)
    elif "header" in form:
        text = "name,code\n" + text
    table.write_text(text, encoding="utf-8")
    read = read_landmarks(_their_file(tmp_path, _THEIRS), names=read_lab_names(table))
    assert set(read.placed) == {"CA", "CB", "RWA", "RWP"}
    assert read["RWA"] == pytest.approx(_PLACES["RWA"])
    assert not read.extra


@pytest.mark.parametrize(
    "text",
    [
        '"","name","code"\n"1","Apex","CA"\n"2","Base","CB"\n',
        '"name" "code"\n"1" "Apex" "CA"\n"2" "Base" "CB"\n',
    ],
)
def test_a_table_of_names_that_r_wrote_is_read(tmp_path, text) -> None:
    table = tmp_path / "names.csv"
    table.write_text(text, encoding="utf-8")
    assert read_lab_names(table).codes == {"apex": "CA", "base": "CB"}


@pytest.mark.parametrize("label", ["left Apex", "Apex_L", "L-apex", "Apex (left)"])
def test_a_name_of_the_table_may_carry_a_side(label) -> None:
    names = LabelNames({"Apex": "CA", "Base": "CB_R", "Bolt": ""})
    assert parse_label(names.translate(label)) == ("CA", Side.LEFT)
    assert names.translate("Base_R") == "CB_R"
    assert names.translate("left Base") == "left Base"  # it stands for the right one
    assert names.leaves_out("Bolt_R")
    assert not names.leaves_out(label)


def test_without_the_table_the_first_unknown_name_is_said(tmp_path) -> None:
    with pytest.raises(FeatureError, match="unknown feature 'Apex of cochlea'"):
        read_landmarks(_their_file(tmp_path, _THEIRS))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("apex,CAX\n", r"apex: cannot stand for 'CAX', which is no feature"),
        ("apex,CA\nApex,CB\n", r"Apex: has two codes"),
        ("apex,CA\napex,CB\n", r"apex: occurs twice"),
        ("apex\n", "line 1 does not hold two columns"),
        ("# nothing\n", "holds no names"),
    ],
)
def test_a_table_of_names_that_is_wrong_is_refused_by_name(tmp_path, text, said) -> None:
    table = tmp_path / "names.csv"
    table.write_text(text, encoding="utf-8")
    with pytest.raises((FeatureError, FileFormatError), match=said) as caught:
        read_lab_names(table)
    assert "names.csv" in str(caught.value)


def test_names_that_lead_to_one_code_twice_are_refused(tmp_path) -> None:
    file = tmp_path / "GP01_L.csv"
    file.write_text("name,x,y,z\napex,0,0,0\nCA,5,5,5\n", encoding="utf-8")
    with pytest.raises(FeatureError, match="is in the file twice"):
        read_landmarks(file, names=LabelNames({"apex": "CA"}))
