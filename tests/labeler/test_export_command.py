"""`gp-labeler export`: what the window's export writes, from the shell."""

from __future__ import annotations

from gp_core.landmarks.files import load_specimens
from gp_labeler.__main__ import main
from gp_labeler.session import labelling
from gp_labeler.session.session import Session
from gp_labeler.session.specimen_file import write_specimen


def _specimen(folder):
    session = Session()
    labelling.place(session, (1, 2, 3), side="L", code="CA")
    labelling.suggest(session, (4, 5, 6), side="L", code="OS", radius_95=0.5, source="atlas")
    write_specimen(folder / "GP1.gpspecimen.json", session.state)
    return str(folder / "GP1.gpspecimen.json")


def test_suggestions_are_left_out_unless_asked_for(tmp_path, capsys) -> None:
    file = _specimen(tmp_path)
    assert main(["export", file, "-o", str(tmp_path / "plain")]) == 0
    assert [path.name for path in (tmp_path / "plain").iterdir()] == ["unnamed_L.mrk.json"]
    assert "suggested, not confirmed: OS" in capsys.readouterr().out
    assert main(["export", file, "-o", str(tmp_path / "both"), "--suggested"]) == 0
    (animal,) = load_specimens(tmp_path / "both")
    assert animal.side("L").placed == ("CA",)
    assert set(animal.side("L").suggested) == {"OS"}


def test_nothing_is_replaced_unasked(tmp_path, capsys) -> None:
    file, out = _specimen(tmp_path), str(tmp_path / "out")
    assert main(["export", file, "-o", out]) == 0
    assert main(["export", file, "-o", out]) == 2
    assert "exists already" in capsys.readouterr().err
    assert main(["export", file, "-o", out, "--replace"]) == 0
    assert main(["export", file, "-o", out, "--format", ".xyz"]) == 2
