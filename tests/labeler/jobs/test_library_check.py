"""The check of a library as a job: what it tells, and the pictures that it leaves."""

from __future__ import annotations

import numpy as np
import pytest
from small_heads import save_markups, save_volume, small_head

from gp_core.errors import GpError
from gp_labeler.autolabel.library import TemplateLibrary
from gp_labeler.autolabel.prediction import Prediction
from gp_labeler.jobs.library_check import CheckLibrary, LibraryChecked
from gp_labeler.jobs.runner import Progress


@pytest.fixture
def heads(tmp_path):
    """Return a folder of three labelled heads, CA and OI of the last exchanged, and the true points."""
    truth = {}
    for seed in range(3):
        volume, points = small_head(seed)
        truth[f"small-{seed}"] = dict(points)
        if seed == 2:
            points["CA_L"], points["OI_L"] = points["OI_L"], points["CA_L"]
        save_volume(tmp_path / f"small-{seed}.nrrd", volume)
        for side in "LR":
            own = {
                name.removesuffix(f"_{side}"): at for name, at in points.items() if name[-1] in (side, "N")
            }
            save_markups(tmp_path / f"small-{seed}_{side}.mrk.json", own)
    return tmp_path, truth


def test_what_contradicts_the_others_is_told_and_drawn(heads, monkeypatch):
    folder, truth = heads
    rng = np.random.default_rng(0)
    told = {
        name: Prediction(
            {k: {n: at + rng.normal(0, 0.2, 3) for n, at in points.items()} for k in "abc"}, None
        )
        for name, points in truth.items()
    }
    monkeypatch.setattr(TemplateLibrary, "held_out", lambda self, registration, report: told)
    job = CheckLibrary((folder,), folder / "templates", folder / "review.pdf")
    checked = job.run(Progress(lambda fraction, text: None))
    assert checked.files == (folder / "review.pdf",)
    assert checked.lines[0] == "3 specimens checked against each other: 1 finding."
    assert checked.lines[1].startswith("small-2: CA_L and OI_L seem to be exchanged")


def test_two_specimens_are_too_few(heads):
    folder, _ = heads
    for file in folder.glob("small-0*"):
        file.unlink()
    with pytest.raises(GpError, match=r"three labelled scans or more are needed, got 2\. Name more"):
        CheckLibrary((folder,), folder, folder / "x.pdf").run(Progress(lambda fraction, text: None))


def test_a_head_that_was_not_found_is_told_and_not_counted(heads, monkeypatch):
    folder, truth = heads
    told = {name: Prediction(dict.fromkeys("abc", points), None) for name, points in truth.items()}
    del told["small-0"]
    monkeypatch.setattr(TemplateLibrary, "held_out", lambda self, registration, report: told)
    job = CheckLibrary((folder,), folder / "templates", folder / "review.pdf")
    checked = job.run(Progress(lambda fraction, text: None))
    assert checked.n_checked == 2
    assert [text.partition(":")[0] for text in checked.problems] == ["small-0"]


@pytest.mark.parametrize("n", [0, 1, 3, 5])
def test_however_many_findings_there_are_few_lines_tell_of_all(n):
    findings = tuple(f"GP{k}: finding {k}" for k in range(n))
    lines = LibraryChecked(findings, (), 7, ("GP9: a problem.",)).lines
    assert lines[-1] == "GP9: a problem."
    shown = [line for line in lines if line.removesuffix(".") in findings]
    rest = [line for line in lines[1 + len(shown) : -1] if str(n - len(shown)) in line]
    assert len(shown) == min(n, 3)
    assert len(rest) == len(lines) - 2 - len(shown) == int(n > 3)
