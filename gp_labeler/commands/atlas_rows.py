"""The rows of the menu Atlas."""

from __future__ import annotations

from collections.abc import Iterator

from gp_labeler.commands.action import Action, Run, Test
from gp_labeler.models.workspace import Workbench

__all__ = ["atlas_rows"]


def _always(desk: Workbench) -> bool:
    return True


def _is_loaded(desk: Workbench) -> bool:
    return desk.atlas is not None


def _is_own(desk: Workbench) -> bool:
    return not desk.is_published_atlas or bool(desk.atlas_problem)  # then another one was chosen


def _can_try(desk: Workbench) -> bool:
    return desk.can_try_atlas


# fmt: off
def atlas_rows() -> Iterator[Action]:
    """Return the commands of the menu Atlas."""
    def row(id: str, title: str, run: Run, enabled: Test = _always, *, hint: str = "",
            group: str = "which", icon: str = "") -> Action:
        return Action(f"atlas.{id}", "Atlas", title, (), run, enabled, hint=hint, group=group, icon=icon)

    yield row("show", "Show the atlas", lambda d, ui: ui.show_step("atlas"), group="show", icon="atlas",
              hint="Which one is in use, and how well the labels fit it")
    yield row("published", "Use the published atlas", lambda d, ui: d.use_published_atlas(), _is_own)
    yield row("open", "Open atlas file…", lambda d, ui: ui.ask_open_atlas(), icon="file")
    yield row("fit_files", "Fit from landmark files…", lambda d, ui: ui.ask_fit_atlas(), group="fit",
              hint="Landmarks and specimens of labelled animals", icon="file")
    yield row("fit_folder", "Fit from a folder…", lambda d, ui: ui.ask_fit_atlas(folder=True), group="fit",
              hint="All labelled animals in a folder", icon="folder")
    yield row("save", "Save atlas…", lambda d, ui: ui.ask_save_atlas(), _is_loaded, group="fit", icon="save")
    yield row("try", "Leave-one-out", lambda d, ui: d.try_atlas(), _can_try, group="try", icon="play",
              hint="How well each animal's cochlea is found from the others")
# fmt: on
