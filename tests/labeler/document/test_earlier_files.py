"""Specimen files, journals and recorded scripts that earlier versions wrote still open, with all they hold.

The files under ``earlier`` were written by those versions themselves, on phantom data; ``expected.json`` is
what they hold, as it is saved today.
"""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import pytest

from gp_labeler.document.opening import open_specimen, recover_specimen
from gp_labeler.document.paths import journal_folder
from gp_labeler.document.recovery import find_recoveries
from gp_labeler.document.specimen_document import SpecimenDocument
from gp_labeler.document.specimen_json import document_of
from gp_labeler.scripting.runner import run_script
from gp_labeler.scripting.script import read_script

EARLIER = Path(__file__).parent / "earlier"
EXPECTED = json.loads((EARLIER / "expected.json").read_text())


def plain(document: dict[str, Any]) -> dict[str, Any]:
    return json.loads(json.dumps(document))


def untimed(value: Any) -> Any:
    """Without when it was done and who ran it, and without what is computed: distances, the estimate.

    Earlier versions took the login name for the observer.
    """
    if isinstance(value, dict):
        left_out = ("time", "by", "pose", "bone_distance_mm", "checksum")
        return {key: untimed(each) for key, each in value.items() if key not in left_out}
    return [untimed(each) for each in value] if isinstance(value, list) else value


def holds(found: Any, expected: Any) -> bool:
    """Whether all that is expected is there; later versions may keep more."""
    if isinstance(expected, dict):
        return all(key in found and holds(found[key], each) for key, each in expected.items())
    return bool(found == expected)


@pytest.mark.parametrize("version", [1, 2, 3])
def test_specimen_files_open(version):
    loaded = open_specimen(EARLIER / f"specimen_{version}.gpspecimen.json")
    document = SpecimenDocument(loaded)
    assert plain(document_of(document.state)) == EXPECTED[f"specimen_{version}"]
    assert bool(loaded.notices) == (version < 3)  # an accepted ghost is a suggestion now, and that is said


@pytest.mark.parametrize("version", [1, 2, 3])
def test_journals_are_recovered_and_undo_works_back_to_what_was_saved(version, tmp_path):
    folder = journal_folder(tmp_path)
    folder.mkdir(parents=True)
    shutil.copy(EARLIER / f"journal_{version}.jsonl", folder)
    (recovery,) = find_recoveries(tmp_path)
    assert not recovery.content.damage
    document = SpecimenDocument(recover_specimen(recovery, tmp_path))
    assert plain(document_of(document.state)) == EXPECTED[f"journal_{version}"]
    texts = []
    while (text := document.undo_text) is not None:
        texts.append(text)
        assert document.undo()
    assert texts == EXPECTED[f"undo_{version}"]
    assert plain(document_of(document.state)) == EXPECTED[f"specimen_{version}"]
    document.close(discard=True)


def test_recorded_scripts_run(tmp_path, qapp):
    report = run_script(read_script(EARLIER / "recorded.toml"), tmp_path)
    assert report.ok, report.error
    found = json.loads((tmp_path / "recorded.gpspecimen.json").read_text())
    assert holds(untimed(found), untimed(EXPECTED["recorded"]))
