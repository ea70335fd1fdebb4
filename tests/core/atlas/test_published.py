from __future__ import annotations

import subprocess
import sys

import numpy as np

from gp_core import Atlas, Specimen, fit_atlas
from gp_core.atlas.published import published_distances
from gp_core.landmarks.features import CODES, FEATURES


def test_the_table_is_whole_and_symmetric() -> None:
    mean, sd = published_distances()
    assert (mean[~np.eye(20, dtype=bool)] > 0).all()
    np.testing.assert_array_equal(mean, mean.T)
    np.testing.assert_array_equal(sd, sd.T)


def test_it_gives_its_table_back() -> None:
    atlas = Atlas.published()
    mean, _ = published_distances()
    near = [code for code in atlas.codes if code not in ("IN", "ZL")]
    for a in near:
        for b in near:
            distance = float(np.linalg.norm(atlas[a] - atlas[b]))
            assert abs(distance - mean[CODES.index(a), CODES.index(b)]) < 0.16, (a, b)


_AT_ONCE = """
import threading
from concurrent.futures import ThreadPoolExecutor
from gp_core.atlas import atlas

built, both, real = [], threading.Barrier(2, timeout=0.2), atlas.published_shape

def build():
    built.append(1)
    try:
        both.wait()  # passes only if a second one is let in
    except threading.BrokenBarrierError:
        pass
    return real()

atlas.published_shape = build
with ThreadPoolExecutor(2) as pool:
    first, second = (f.result() for f in [pool.submit(atlas.Atlas.published) for _ in range(2)])
print(first is second, len(built))
"""


def test_all_who_ask_at_once_get_the_same() -> None:
    done = subprocess.run([sys.executable, "-c", _AT_ONCE], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["True", "1"]


def test_it_is_a_left_side_in_its_own_cochlea_frame() -> None:
    atlas = Atlas.published()
    np.testing.assert_allclose(atlas["CO"], 0, atol=1e-9)
    np.testing.assert_allclose(atlas["CA"][1:], 0, atol=1e-9)
    assert atlas["CA"][0] > 0
    middle = (atlas["RWA"] + atlas["RWP"]) / 2
    assert middle[1] > 0
    assert atlas["DTL"][2] > 0
    assert atlas["DTM"][2] > 0
    assert set(atlas.codes) == {f.code for f in FEATURES if not f.computed}


def test_it_agrees_with_the_real_animals(real_specimens: list[Specimen]) -> None:
    published, real = Atlas.published(), fit_atlas(real_specimens)
    apart = {code: float(np.linalg.norm(published[code] - real[code])) for code in real.codes}
    assert apart.pop("IN") < 0.5
    assert apart.pop("ZL") < 0.4
    assert max(apart.values()) < 0.15, apart
