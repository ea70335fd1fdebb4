"""The rows of the menu Atlas."""

from __future__ import annotations

from collections.abc import Iterator

from gp_labeler.commands.action import IN_WINDOW, Action, Run, Test
from gp_labeler.commands.conditions import always
from gp_labeler.models.workspace import Workspace

__all__ = ["atlas_rows"]


def _is_loaded(workspace: Workspace) -> bool:
    return workspace.atlas.current is not None


def _is_own(workspace: Workspace) -> bool:
    return not workspace.atlas.is_published or bool(workspace.atlas.problem)  # then another one was chosen


def _can_try(workspace: Workspace) -> bool:
    return workspace.atlas.can_try and not workspace.atlas.is_trying


# fmt: off
def atlas_rows() -> Iterator[Action]:
    """Return the commands of the menu Atlas."""
    def row(id: str, title: str, run: Run | None, enabled: Test = always, *, hint: str = "",
            group: str = "which", icon: str = "") -> Action:
        return Action(f"atlas.{id}", "Atlas", title, (), run, enabled, hint=hint, group=group, icon=icon)

    yield row("show", "Show the atlas", IN_WINDOW, group="show", icon="atlas",
              hint="The atlas in use, and how well the labels fit it")
    yield row("published", "Use the published atlas", lambda w: w.atlas.use_published(), _is_own)
    yield row("open", "Open atlas file…", IN_WINDOW, icon="file")
    yield row("fit_files", "Fit from landmark files…", IN_WINDOW, group="fit",
              hint="Landmarks and specimens of labelled animals", icon="file")
    yield row("fit_folder", "Fit from a folder…", IN_WINDOW, group="fit",
              hint="All labelled animals in a folder", icon="folder")
    yield row("save", "Save atlas…", IN_WINDOW, _is_loaded, group="fit", icon="save")
    yield row("reliability_files", "Repeatability of labels, from files…", IN_WINDOW,
              group="repeat", hint="Animals labelled more than once: specimens or landmarks", icon="file")
    yield row("reliability_folder", "Repeatability of labels, from a folder…",
              IN_WINDOW, group="repeat", icon="folder",
              hint="Subfolders are searched too")
    yield row("save_reliability", "Save repeatability…", IN_WINDOW,
              lambda w: w.reliability.report is not None, group="repeat", icon="save",
              hint="Table (.csv), full result (.json), or plot (.png, .pdf, .svg)")
    yield row("try", "Run leave-one-out", lambda w: w.atlas.try_out(), _can_try, group="try", icon="play",
              hint="Estimates each animal's cochlea from the other animals")
# fmt: on
