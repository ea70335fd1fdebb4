"""The source of the site: the pages of docs/, and those that are made from the program.

`assemble` writes all of them into one folder, for Sphinx; nothing is written into the tree.
"""

from __future__ import annotations

import argparse
import html
import inspect
import re
import shutil
from collections.abc import Iterator
from importlib import import_module
from importlib.metadata import metadata
from pathlib import Path

import landmark_atlas
import pictures

import gp_core
from gp_core.cli.entry import make_parser as core_parser
from gp_labeler.cli.entry import make_parser as labeler_parser
from gp_labeler.cli.subcommands import SUBCOMMANDS

ROOT = Path(__file__).resolve().parents[2]
REPOSITORY = dict(
    line.split(", ", 1) for line in metadata("gp-labeler").get_all("Project-URL") or [] if ", " in line
)["Source"]
AT_TOP = ("CHANGELOG", "CONTRIBUTING", "CODE_OF_CONDUCT")
NAVIGATION = ROOT / "tools" / "site" / "navigation.md"

TITLES = {"positional arguments": "What it takes", "options": "Options"}
ROOMS = {
    "landmarks": "Landmarks",
    "registration": "Registration",
    "atlas": "Atlas",
    "pose": "Pose",
    "io": "Files",
    "study": "Study",
    "": "Frames, errors and constants",
}
"""Headings of the reference by the room of `gp_core` that a name is defined in."""

APPLICATION = {
    "plotting": ("Plotting", ["plotting"]),
    "imaging": (
        "Scans and surfaces",
        [
            f"imaging.{name}"
            for name in ("readers", "volume", "threshold", "surface", "mesh_files", "datasets")
        ],
    ),
    "phantom": ("Synthetic heads", ["phantom"]),
    "head_pose": ("Straight heads", ["head_pose"]),
    "autolabel": ("First labels", ["autolabel"]),
    "tracker": ("Tracked probe", ["tracker"]),
    "scripting": (
        "Scripts of the window",
        [f"scripting.{name}" for name in ("script", "runner", "batch", "window_driver")],
    ),
}
"""Title and modules of each page of the reference of the application, `gp_labeler`."""


def in_site(text: str) -> str:
    """Return a page of the top of the repository with links as they are in the site."""
    text = re.sub(r"\]\(docs/", "](", with_titles(text))
    for name in AT_TOP:
        text = text.replace(f"]({name}.md", f"]({name.lower()}.md")
    return text.replace("](CITATION.cff)", f"]({REPOSITORY}/blob/main/CITATION.cff)")


def with_titles(text: str) -> str:
    """Return a page whose links to pages show their titles, not the names of their files."""
    return re.sub(r"\[[\w./-]+\.md\]\(", "[](", text)


def first_pages() -> Iterator[tuple[str, str]]:
    """Yield path and text of the pages at the top of the repository; the first has the navigation."""
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    yield "index.md", in_site(readme) + "\n" + navigation()
    for name in AT_TOP:
        yield f"{name.lower()}.md", in_site((ROOT / f"{name}.md").read_text(encoding="utf-8"))


def navigation() -> str:
    """Return the navigation; pages of docs/ that it does not name go where it says so."""
    text = NAVIGATION.read_text(encoding="utf-8")
    docs = ROOT / "docs"
    pages = sorted(str(path.relative_to(docs).with_suffix("")) for path in docs.rglob("*.md"))
    return text.replace("{others}", "\n".join(page for page in pages if page not in text.split()))


def room_of(name: str) -> str:
    """Return the room of `gp_core` that a public name is defined in."""
    module = getattr(getattr(gp_core, name), "__module__", "") or ""
    words = module.split(".")
    return words[1] if len(words) > 2 and words[1] in ROOMS else ""


def python_pages() -> Iterator[tuple[str, str]]:
    """Yield path and text of a page for each room, with every public name."""
    names = sorted(set(gp_core.__all__) - {"__version__"}, key=str.casefold)
    for room, title in ROOMS.items():
        here = [name for name in names if room_of(name) == room]
        text = [f"# {title}\n", "Everything here is imported from `gp_core`.\n"]
        text += [
            python_entry("gp_core", name)
            for name in sorted(here, key=lambda name: not callable(getattr(gp_core, name)))
        ]
        yield f"reference/python/{room or 'common'}.md", "\n".join(text)
    yield "reference/python/index.md", index("Python", [f"{room or 'common'}" for room in ROOMS])


def application_pages() -> Iterator[tuple[str, str]]:
    """Yield path and text of a page for each part of the application that other programs may import."""
    for page, (title, modules) in APPLICATION.items():
        text = [
            f"# {title}\n",
            "These names are not as stable as those of `gp_core`: see [Stability](../../api-stability.md).\n",
        ]
        for name in modules:
            module = f"gp_labeler.{name}"
            text += [f"Imported from `{module}`:\n"]
            text += [python_entry(module, each) for each in classes_and_functions(module)]
        yield f"reference/application/{page}.md", "\n".join(text)
    yield "reference/application/index.md", index("Python: the application", list(APPLICATION))


def classes_and_functions(module: str) -> list[str]:
    """Return the public names of a module of ours, without constants and types for annotations."""
    values = {name: getattr(import_module(module), name) for name in import_module(module).__all__}
    return [name for name, value in values.items() if inspect.isclass(value) or inspect.isfunction(value)]


def python_entry(module: str, name: str) -> str:
    """Return the entry of a public name, whose docstring Sphinx reads."""
    value = getattr(import_module(module), name)
    kind = "class" if inspect.isclass(value) else "function" if callable(value) else "data"
    if inspect.isclass(value) and issubclass(value, BaseException):
        kind = "exception"
    lines = [f"## {name}\n", "```{eval-rst}", f".. auto{kind}:: {module}.{name}"]
    lines += ["   :no-value:"] if kind == "data" else []
    return "\n".join([*lines, "```\n"])


def index(title: str, pages: list[str]) -> str:
    """Return a page that lists others."""
    return "\n".join([f"# {title}\n", toctree(pages, "maxdepth: 1")])


def toctree(pages: list[str], option: str) -> str:
    """Return the list of pages of a part of the site."""
    return "\n".join(["```{toctree}", f":{option}\n", *pages, "```\n"])


def parsers() -> Iterator[argparse.ArgumentParser]:
    """Yield the parser of every program and command."""
    yield labeler_parser()
    for command in SUBCOMMANDS.values():
        yield command.parser()
    core = core_parser()
    yield core
    (commands,) = (a for a in core._actions if isinstance(a, argparse._SubParsersAction))
    yield from commands.choices.values()


def command_page(parser: argparse.ArgumentParser) -> str:
    """Return the page of one command."""
    parts = [
        f"# {parser.prog}\n",
        f"{prose(parser.description or '')}\n",
        "```text",
        parser.format_usage().strip(),
        "```\n",
    ]
    for group in parser._action_groups:
        actions = [a for a in group._group_actions if a.help != argparse.SUPPRESS]
        if actions:
            title = {"positional arguments": "What it takes", "options": "Options"}.get(
                group.title or "", group.title
            )
            parts += [f"## {(title or '')[:1].upper()}{(title or '')[1:]}\n"]
            parts += [prose(group.description) + "\n"] if group.description else []
            parts += ["| | |", "|---|---|", *(row(parser, action) for action in actions), ""]
    if parser.epilog:
        parts += ["## Examples\n", "```text", parser.epilog.strip(), "```\n"]
    return "\n".join(parts)


def row(parser: argparse.ArgumentParser, action: argparse.Action) -> str:
    """Return an option as a row of a table."""
    if isinstance(action, argparse._SubParsersAction):
        told = "<br>".join(f"[`{name}`](gp-core-{name}.md)" for name in action.choices)
        return f"| `{action.metavar}` | {told} |"
    formatter = parser._get_formatter()
    words = formatter._format_action_invocation(action)
    told = formatter._expand_help(action) if action.help else ""
    return f"| `{cell(words)}` | {cell(prose(told))} |"


def prose(help: str) -> str:
    """Return text of a parser as Markdown: options are code, so that their hyphens do not become a dash."""
    return re.sub(r"(?<![\w-])--[a-z][\w-]*", r"`\g<0>`", html.escape(help, quote=False))


def cell(text: str) -> str:
    """Return text as a cell of a table holds it."""
    return text.replace("|", "\\|").replace("\n", " ")


def command_pages() -> Iterator[tuple[str, str]]:
    """Yield path and text of the page of each command."""
    names, rows = [], []
    for parser in parsers():
        name = parser.prog.replace(" ", "-")
        names.append(name)
        rows.append(f"| [`{parser.prog}`]({name}.md) | {cell(prose(parser.description or ''))} |")
        yield f"reference/commands/{name}.md", command_page(parser)
    table = "\n".join(["| command | what it does |", "|---|---|", *rows, ""])
    yield "reference/commands/index.md", f"# Commands\n\n{table}\n{toctree(names, 'hidden:')}"


def assemble(folder: Path) -> None:
    """Write the source of the site into a folder."""
    shutil.copytree(ROOT / "docs", folder, dirs_exist_ok=True)
    for page in folder.rglob("*.md"):
        text = with_titles(pictures.with_screenshots(page.read_text(encoding="utf-8")))
        page.write_text(text, encoding="utf-8")
    generated = (first_pages, python_pages, application_pages, command_pages, landmark_atlas.pages)
    for path, text in (page for pages in generated for page in pages()):
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_text(text, encoding="utf-8")
