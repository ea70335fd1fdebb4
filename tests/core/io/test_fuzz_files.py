"""Whatever bytes a file holds: a result or a `GpError`, and nothing else."""

import json

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from landmark_makers import some_landmarks

from gp_core.errors import GpError
from gp_core.io import (
    load_specimens,
    read_authors_mat,
    read_landmarks,
    read_points,
    read_touches,
    write_csv,
    write_fcsv,
    write_markups,
)

SUFFIXES = (".mrk.json", ".fcsv", ".csv", ".tsv", ".dat")
QUICK = settings(
    max_examples=60,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture],
)

JSON = st.recursive(
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats()
    | st.text(max_size=6)
    | st.sampled_from(["NA", "defined", "missing", "Fiducial", "LPS", "RAS", "mm", "um", "CA", 10**400]),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=6), inner, max_size=4),
    max_leaves=8,
)
BITS = st.sampled_from(
    [
        b"",
        b"\0",
        b"\r",
        b"\n\n",
        b",",
        b'"',
        b"nan",
        b"-1000",
        b"1e999",
        b"{",
        b"]",
        b"\xff",
        b"#",
        b"\t",
        b"S1",
        b"CA",
    ]
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("fuzz")


@pytest.fixture(scope="module")
def originals(folder):
    """Bytes of a file of each kind, as this program writes it."""
    landmarks = some_landmarks(n_placed=15).with_unseen("CO")
    write_markups(folder / "a_L.mrk.json", landmarks, specimen="a")
    write_fcsv(folder / "a_L.fcsv", landmarks)
    write_csv(folder / "a_L.csv", landmarks)
    tabs = (folder / "a_L.csv").read_text().replace(",", "\t")
    (folder / "a_L.tsv").write_text(tabs)
    np.savetxt(folder / "a_L.dat", np.random.default_rng(0).normal(size=(16, 3)), delimiter="\t")
    return {suffix: (folder / f"a_L{suffix}").read_bytes() for suffix in SUFFIXES}


def refusal(reader, *paths):
    """Return the message of the `GpError` that reading raises, if it does; any other error goes through."""
    try:
        reader(*paths)
    except GpError as error:
        return str(error)
    return None


def read_every_way(file):
    readers = [
        read_points,
        read_landmarks,
        lambda path: read_landmarks(path, side="R", unknown="extra"),
        lambda path: read_touches(path, "L"),
        load_specimens,
    ]
    for message in filter(None, (refusal(reader, file) for reader in readers)):
        assert str(file) in message
        assert "\n" not in message
        assert len(message) < 600 + 2 * len(str(file))


@given(content=st.binary(max_size=300), suffix=st.sampled_from(SUFFIXES))
@QUICK
def test_any_bytes(folder, content, suffix):
    file = folder / f"bytes_L{suffix}"
    file.write_bytes(content)
    read_every_way(file)


@given(
    content=st.text(alphabet="CARWSL,;\t\"#'=.-+e0123456789 \r\nNa", max_size=200),
    suffix=st.sampled_from(SUFFIXES),
)
@QUICK
def test_any_text(folder, content, suffix):
    file = folder / f"text_L{suffix}"
    file.write_bytes(content.encode())
    read_every_way(file)


@given(
    cuts=st.lists(st.tuples(st.floats(0, 1), st.integers(0, 40), BITS), max_size=4),
    suffix=st.sampled_from(SUFFIXES),
)
@QUICK
def test_damaged_files(folder, originals, cuts, suffix):
    content = originals[suffix]
    for where, n_gone, bits in cuts:
        at = int(where * len(content))
        content = content[:at] + bits + content[at + n_gone :]
    file = folder / f"cut_L{suffix}"
    file.write_bytes(content)
    read_every_way(file)


@given(content=JSON, at_top=st.booleans())
@QUICK
def test_any_json(folder, content, at_top):
    file = folder / "any_L.mrk.json"
    file.write_text(json.dumps(content if at_top else {"markups": content}))
    read_every_way(file)


@given(value=JSON, data=st.data())
@QUICK
def test_any_value_anywhere_in_a_markups_file(folder, originals, value, data):
    content = json.loads(originals[".mrk.json"])
    inner, key = content, data.draw(st.sampled_from(["markups", "gpLabeler"]))
    while isinstance(inner[key], (dict, list)) and inner[key] and data.draw(st.booleans() | st.just(True)):
        inner = inner[key]
        key = data.draw(st.sampled_from(sorted(inner) if isinstance(inner, dict) else range(len(inner))))
    inner[key] = value
    file = folder / "value_L.mrk.json"
    file.write_text(json.dumps(content))
    read_every_way(file)


@given(
    cuts=st.lists(
        st.tuples(st.floats(0, 1), st.integers(0, 8), st.binary(max_size=8)), min_size=1, max_size=3
    )
)
@QUICK
def test_damaged_mat_files(folder, cuts):
    from scipy.io import savemat

    savemat(folder / "a.mat", {"cc_L": np.ones((20, 3, 1)), "cc_R": np.ones((20, 3, 1))})
    content = (folder / "a.mat").read_bytes()
    for where, n_gone, bits in cuts:
        at = int(where * len(content))
        content = content[:at] + bits + content[at + n_gone :]
    (folder / "a.mat").write_bytes(content)
    message = refusal(read_authors_mat, folder / "a.mat", folder / "a.mat")
    assert message is None or "a.mat" in message
