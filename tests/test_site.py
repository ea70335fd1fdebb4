"""The site's source: every page is in its navigation, every public name and command has its place."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pytest

import gp_core
from gp_labeler.cli.subcommands import SUBCOMMANDS
from gp_labeler.models.anatomical_planes import ANATOMICAL_PLANES, FEATURE_PLANES
from gp_labeler.scripting.script import make_script

_ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of pages that Sphinx makes HTML of."""
    folder = tmp_path_factory.mktemp("site")
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(_ROOT / "tools" / "site")
        import generate

        generate.assemble(folder)
        sys.modules.pop("generate")
        sys.modules.pop("landmark_atlas")
        sys.modules.pop("pictures")
    return folder


def test_every_public_name_is_in_the_reference(source: Path) -> None:
    text = "".join(path.read_text() for path in (source / "reference" / "python").iterdir())
    named = re.findall(r"auto\w+:: gp_core\.(\w+)", text)
    assert sorted(named) == sorted(set(gp_core.__all__) - {"__version__"})


def test_what_others_may_import_of_the_application_is_in_the_reference(source: Path) -> None:
    text = "".join(path.read_text() for path in (source / "reference" / "application").iterdir())
    named = re.findall(r"auto\w+:: gp_labeler\.([\w.]+)", text)
    assert len(named) == len(set(named))
    public = {"plotting.plot", "plotting.compare", "autolabel.propose", "autolabel.TemplateLibrary"}
    public |= {"scripting.script.make_script", "scripting.runner.run_script", "imaging.readers.read_volume"}
    assert public <= set(named)


def test_every_command_has_a_page_with_its_options(source: Path) -> None:
    pages = {path.stem: path.read_text() for path in (source / "reference" / "commands").iterdir()}
    assert {f"gp-labeler-{name}" for name in SUBCOMMANDS} <= pages.keys()
    assert {"gp-core", "gp-labeler", "gp-core-estimate", "gp-core-reliability"} <= pages.keys()
    assert "| `--shared-error MM` |" in pages["gp-core-estimate"]
    assert "gp-labeler mesh head.nrrd" in pages["gp-labeler-mesh"]


def test_options_in_the_text_of_command_pages_are_code(source: Path) -> None:
    """Otherwise Sphinx makes one dash of their two hyphens."""
    for page in (source / "reference" / "commands").iterdir():
        prose = re.sub(r"```.*?```|`[^`]*`", "", page.read_text(), flags=re.DOTALL)
        assert re.findall(r"--\w+", prose) == [], page.name


def test_the_list_of_commands_says_what_each_does(source: Path) -> None:
    listed = (source / "reference" / "commands" / "index.md").read_text()
    rows = re.findall(r"^\| \[`(.+?)`\]\((.+?)\.md\) \| \S.* \|$", listed, re.MULTILINE)
    assert {page for _, page in rows} == {
        path.stem for path in (source / "reference" / "commands").glob("gp-*.md")
    }


def test_no_link_shows_the_name_of_a_file_of_the_repository(source: Path) -> None:
    shown = [
        name for page in source.rglob("*.md") for name in re.findall(r"\[(\S+\.md)\]\(", page.read_text())
    ]
    assert shown == []


def test_every_feature_has_a_page_from_the_one_table(source: Path) -> None:
    pages = {path.stem: path.read_text() for path in (source / "reference" / "features").glob("*.md")}
    assert pages.keys() == {*gp_core.CODES, "index"}
    for row in gp_core.FEATURES:
        assert row.definition in pages[row.code]
        assert row.where in pages[row.code]
        assert len(row.mistakes) > 40
        assert row.mistakes in pages[row.code]
    assert "| [LLI](LLI.md) Long limb of the incus | 0.5 | 0.10 |" in pages["RWA"]
    for code, plane in FEATURE_PLANES.items():
        assert ANATOMICAL_PLANES[plane] in pages[code]


def test_every_picture_is_drawn_by_a_script_that_is_valid(
    source: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(_ROOT / "tools" / "site")
    import pictures

    steps = list(pictures.script())
    make_script(steps, name="pictures")
    drawn = {step["path"] for step in steps if step["do"] == "screenshot"}
    assert {f"reference/features/{code}.png" for code in gp_core.CODES} <= drawn
    asked = {name for page in (_ROOT / "docs").rglob("*.md") for name in pictures.wanted(page.read_text())}
    assert asked == pictures.SCREENSHOTS.keys()
    assert {f"pictures/{name}.png" for name in asked} <= drawn
    assert "(/pictures/tracker.png)" in (source / "tutorials" / "tracker.md").read_text()


def test_every_page_is_in_the_navigation(source: Path) -> None:
    listed = (source / "index.md").read_text()
    pages = {str(path.relative_to(source).with_suffix("")) for path in source.rglob("*.md")}
    missing = {page for page in pages if not re.search(rf"^{re.escape(page)}$", listed, re.MULTILINE)}
    generated = {"index"} | {page for page in pages if page.startswith("reference/") and "index" not in page}
    assert missing - generated == set()


def test_the_habits_of_a_project_are_there() -> None:
    changes = (_ROOT / "CHANGELOG.md").read_text()
    assert "## [Unreleased]" in changes
    assert f"## [{gp_core.__version__}]" in changes
    citation = (_ROOT / "CITATION.cff").read_text()
    assert "cff-version: 1.2.0" in citation
    assert "doi: 10.1097/MAO.0000000000003250" in citation


def test_the_invented_addresses_stand_in_one_place() -> None:
    folders = ("gp_core", "gp_labeler", "docs", "tools", "resources", "integrations", "benchmarks", ".github")
    files = [path for folder in folders for path in (_ROOT / folder).rglob("*") if path.is_file()]
    files += [path for path in _ROOT.iterdir() if path.is_file() and path.name != "PKG-INFO"]  # of an sdist
    address = "gp-labeler.github.io", "github.com/gp-labeler"
    named = {
        path.name
        for path in files
        if path.suffix in (".py", ".md", ".json", ".toml", ".cff", ".yml", ".yaml", "")
        and any(each in path.read_text(encoding="utf-8") for each in address)
    }
    assert named == {"pyproject.toml"}
