"""Tables of named points."""

import pytest
from landmark_makers import same_landmarks, some_landmarks

from gp_core.errors import FileFormatError
from gp_core.io import read_landmarks, read_points, write_csv
from gp_core.landmarks.sets import Status


@pytest.fixture
def file(tmp_path):
    return tmp_path / "GP01 left.csv"


@pytest.mark.parametrize(
    "text",
    [
        "CA,1,2,3\nRWP,4,5.5,6e0\n",
        "name,x,y,z\nCA,1,2,3\nRWP,4,5.5,6\n",
        "Feature;X_mm;Y (mm);Z [mm]\r\nca;1;2;3\r\nrwp;4;5.5;6\r\n",
        "z\ty\tx\tlabel\n3\t2\t1\tCA\n6\t5.5\t4\tRWP\n",
        "label,l,p,s,defined,selected,visible,locked,description\nCA,1,2,3,1,1,1,0,\nRWP,4,5.5,6,1,1,1,0,far\n",
        "label,r,a,s\nCA,-1,-2,3\nRWP,-4,-5.5,6\n",
        "# touched by J. D.\nCA 1 2 3\nRWP 4 5.5 6\n",
        "name    x    y    z\nCA      1    2    3\nRWP     4  5.5    6\n",
        "name;x;y;z\nCA;1;2;3\nRWP;4;5.5;6\n;;;\n;;;\n",
        "# CoordinateSystem = RAS\nname,x,y,z\nCA,-1,-2,3\nRWP,-4,-5.5,6\n",
        "# CoordinateSystem = 0\nCA,-1,-2,3\nRWP,-4,-5.5,6\n",
        "# CoordinateSystem = LPS\nlabel,l,p,s\nCA,1,2,3\nRWP,4,5.5,6\n",
        '\ufeff"CA","1","2","3"\n"RWP","4","5.5","6"\n',
    ],
)
def test_tables_in_every_shape(file, text):
    file.write_text(text, encoding="utf-8", newline="")
    landmarks = read_landmarks(file)
    assert landmarks.placed == ("CA", "RWP")
    assert landmarks["CA"].tolist() == [1, 2, 3]
    assert landmarks["RWP"].tolist() == [4, 5.5, 6]
    assert landmarks.side.value == "L"


def test_tsv(tmp_path):
    (tmp_path / "x.tsv").write_text("label\tl\tp\ts\tdefined\nCA\t1\t2\t3\t1\nCB\t\t\t\t0\n")
    landmarks = read_landmarks(tmp_path / "x.tsv", side="R")
    assert landmarks.placed == ("CA",)


def test_points_that_are_not_placed(file):
    file.write_text(
        "label,l,p,s,defined,status\nCA,1,2,3,1,defined\nCB,0,0,0,0,\nCC,,,,0,missing\nCL,NA,NA,NA,,undefined\n"
    )
    landmarks = read_landmarks(file)
    assert landmarks.placed == ("CA",)
    assert landmarks.unseen == {"CC"}


def test_empty_coordinates_are_not_placed(file, caplog):
    file.write_text("CA,1,2,3\nCB,,,\n")
    assert read_landmarks(file).status("CB") is Status.TO_DO
    assert "landmark CB" in caplog.text


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("name,x,y\nCA,1,2\n", "must name the columns l,p,s or r,a,s or x,y,z .*got 'name,x,y'"),
        ("name,x_um,y_um,z_um\nCA,1,2,3\n", "must name the columns"),
        ("CA,1,2\n", "line 1 has 3 columns, must have 4"),
        ("CA,1,2,3\nCB,1,2,3,4\n", "line 2 has 5 columns, must have 4"),
        ("name,x,y,z\nCA,1,2\n", "line 2 has 3 columns"),
        ("1,2,3\n4,5,6\n", "line 1 has 3 columns"),
        ("CA,1,2,inf\n", "landmark CA: .*three finite numbers.*'inf'"),
        ("CA;1,5;2,5;3,5\n", "landmark CA: .*'1,5'"),
        ("CA,1,,3\n", "landmark CA: .*three finite numbers"),
        ("name,x,y,z\n", "holds no points"),
        ("# nothing\n", "holds no points"),
        ("label,l,p,s,status\nCA,1,2,3,done\n", "landmark CA: status must be one of .*'done'"),
        ("# CoordinateSystem = RAS\nlabel,l,p,s\nCA,1,2,3\n", "states the coordinate system RAS.*l,p,s"),
        ("# CoordinateSystem = IJK\nCA,1,2,3\n", "must be LPS or RAS, got 'IJK'"),
        ('"CA,1,2,3\n', "line 1 cannot be split"),
    ],
)
def test_wrong_content_is_named(file, text, message):
    file.write_text(text)
    with pytest.raises(FileFormatError, match=message):
        read_landmarks(file)


def test_the_written_table_is_slicers_with_one_column_more(file):
    landmarks = some_landmarks(n_placed=5).with_unseen("ZL")
    write_csv(file, landmarks)
    header = file.read_text().splitlines()[0]
    assert header == "label,l,p,s,defined,selected,visible,locked,description,status"
    assert same_landmarks(read_landmarks(file), landmarks)
    assert read_points(file).points[0].description == "Cochlea apex"
