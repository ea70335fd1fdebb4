"""A phantom's scan is written whole in every format, or not at all."""

from __future__ import annotations

import resource
import signal
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest

from gp_core.errors import GpError
from gp_labeler.imaging.readers import read_volume
from gp_labeler.phantom import make_phantom, save_phantom
from gp_labeler.phantom.phantom import Phantom

FORMATS = (".nrrd", ".nii.gz", ".nii", ".mha")
OLD = b"the scan that was there before"


@lru_cache
def small_phantom() -> Phantom:
    return make_phantom(seed=3, spacing=0.5)


@pytest.mark.parametrize("ending", FORMATS)
def test_every_format_gives_the_scan_back(ending: str, tmp_path: Path) -> None:
    scan, truth = save_phantom(small_phantom(), tmp_path / f"head{ending}")
    read, made = read_volume(scan), small_phantom().volume
    np.testing.assert_array_equal(read.array, made.array)
    np.testing.assert_allclose(
        read.voxel_to_scan([[0, 0, 0], [5, 6, 7]]), made.voxel_to_scan([[0, 0, 0], [5, 6, 7]]), atol=1e-4
    )
    assert sorted(tmp_path.iterdir()) == sorted([scan, truth])


@pytest.mark.parametrize("missing", [1, 100_000])
@pytest.mark.parametrize("ending", FORMATS)
def test_a_full_disk_keeps_the_old_scan(ending: str, missing: int, tmp_path: Path, capfd) -> None:
    path = tmp_path / f"head{ending}"
    save_phantom(small_phantom(), path)
    n_bytes = path.stat().st_size
    path.with_name("head.truth.json").unlink()
    path.write_bytes(OLD)
    limit = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (n_bytes - missing, limit[1]))
        with pytest.raises(GpError, match=r"head\.\S+: .*cannot be written whole.*Free some space"):
            save_phantom(small_phantom(), path)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limit)
        signal.signal(signal.SIGXFSZ, handler)
    assert path.read_bytes() == OLD
    assert list(tmp_path.iterdir()) == [path]
    assert capfd.readouterr().err == ""
