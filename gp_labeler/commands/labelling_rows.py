"""The rows of the menu Landmarks that say who labels, how surely, and which labelling is in work."""

from __future__ import annotations

from collections.abc import Iterator

from gp_core.landmarks.provenance import Certainty
from gp_labeler.commands.action import IN_WINDOW, Action, Run, Test
from gp_labeler.models.workspace import Workspace

__all__ = ["labelling_rows"]


def _can_annotate(workspace: Workspace) -> bool:
    point = workspace.labels.annotated
    if point is None or point.code is None:
        return False
    return not workspace.document.state.landmark(point.side, point.code).locked


def _is_marked(certainty: Certainty) -> Test:
    def test(workspace: Workspace) -> bool:
        point = workspace.labels.annotated
        if point is None or point.code is None:
            return False
        return workspace.document.state.landmark(point.side, point.code).certainty is certainty

    return test


def _mark(certainty: Certainty) -> Run:
    def mark(workspace: Workspace) -> None:
        point, is_so = workspace.labels.annotated, _is_marked(certainty)(workspace)
        workspace.labels.annotate("" if is_so else certainty.value)
        if point is not None and point != workspace.labels.active:  # the card shows another one
            workspace.say(f"{point.code} {point.side.word}: {'not said' if is_so else certainty.value}")

    return mark


def _has_labels(workspace: Workspace) -> bool:
    return bool(workspace.document.state.landmarks)


# fmt: off
def labelling_rows() -> Iterator[Action]:
    """Return the commands."""
    for key, certainty in zip("123", Certainty, strict=True):
        yield Action(f"point.{certainty.value}", "Landmarks", f"Certainty: {certainty.value}",
                     (f"Alt+{key}",), _mark(certainty), _can_annotate, _is_marked(certainty),
                     group="certainty", hint="For the selected point, or else the point placed last")
    yield Action("labelling.again", "Landmarks", "Label again, blind", (), IN_WINDOW, _has_labels,
                 group="labelling", hint="Starts the next round; earlier points are kept, but hidden")
    yield Action("labelling.show", "Landmarks", "Observer and labellings…", (),
                 IN_WINDOW, group="labelling",
                 hint="Choose who labels; list the observers and rounds of this specimen")
# fmt: on
