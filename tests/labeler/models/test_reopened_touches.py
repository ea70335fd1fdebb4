"""Tracked touches of a specimen that is opened again: the reference may have moved since."""

from __future__ import annotations

from pathlib import Path

from gp_core import PROBE, Atlas, Side
from gp_labeler.document import touching
from gp_labeler.document.specimen_file import read_specimen
from gp_labeler.document.touches import TouchHow
from gp_labeler.models.workspace import Workspace

ATLAS = Atlas.published()


def test_they_are_doubtful_with_or_without_a_tracker(tmp_path: Path) -> None:
    first = Workspace(atlas=ATLAS, author="AB")
    for name in PROBE:
        touching.record_touch(first.document, Side.LEFT, name, ATLAS[name], TouchHow.TRACKED)
    touching.record_touch(first.document, Side.LEFT, "OI", ATLAS["OI"], TouchHow.TYPED)
    file = first.document.save(tmp_path / "GP01.gpspecimen.json")
    first.close(discard=True)
    again = Workspace(atlas=ATLAS, author="AB")
    try:
        again.document.load(read_specimen(file))
        assert not again.tracker.on
        assert set(again.tracker.doubtful) == set(PROBE)  # the typed one is in no tracker's frame
        assert "earlier session" in again.tracker.frame_words
        again.pose.choose(side=Side.RIGHT)
        assert again.tracker.doubtful == ()
    finally:
        again.close(discard=True)
