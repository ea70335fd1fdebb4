"""What opening, importing and exporting ask: in dialogs, or by plain questions that a script can answer."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from qtpy.QtWidgets import QWidget

from gp_core.errors import AlreadyExistsError
from gp_labeler.document.landmark_export import export_landmarks
from gp_labeler.document.landmark_import import OffBoneError, import_landmarks
from gp_labeler.document.recovery import Recovery
from gp_labeler.document.specimen_document import VolumeChangedError
from gp_labeler.imaging.readers import ImportPlan, inspect_volume
from gp_labeler.imaging.volume import Volume
from gp_labeler.models.workspace import Workspace
from gp_labeler.views.panels.scan.import_dialog import ImportDialog
from gp_labeler.views.panels.scan.recover_dialog import RecoverDialog
from gp_labeler.views.prompts import Prompts

__all__ = [
    "ask_about",
    "ask_how_to_read",
    "export_asking",
    "import_asking",
    "offer_other_scan",
    "offer_recoveries",
]


def offer_recoveries(
    workspace: Workspace, prompts: Prompts, recoveries: Sequence[Recovery], parent: QWidget
) -> None:
    """Offer what programs that were killed left unsaved."""
    if recoveries and prompts.in_dialogs:
        dialog = RecoverDialog(tuple(recoveries), parent)
        dialog.recover_asked.connect(workspace.document.recover)
        dialog.open()
        return
    for recovery in recoveries:
        answer = prompts.choose(
            "Unsaved work was found",
            recovery.text,
            ["Recover", "Later", "Delete it"],
            detail="The program ended before this was saved. Nothing is lost.",
        )
        if answer == "Recover":
            workspace.document.recover(recovery)
            return
        if answer == "Delete it":
            recovery.discard()


def ask_how_to_read(workspace: Workspace, prompts: Prompts, plan: ImportPlan, parent: QWidget) -> None:
    """Ask what a scan's files do not say, then read it."""
    if prompts.in_dialogs:
        ImportDialog(workspace, plan, parent=parent).open()
        return
    answered = ask_about(plan, prompts)
    if answered is not None:
        workspace.scan.read(answered)


def offer_other_scan(
    workspace: Workspace, prompts: Prompts, error: VolumeChangedError, volume: Volume
) -> None:
    """Ask whether to go on with a scan that is not the one that was labelled."""
    detail = f"{'; '.join(error.differences).capitalize()}. {error.remedy or ''}"
    answers = ["Use it anyway"]
    if prompts.choose("Another scan?", error.problem, answers, detail=detail, kind="warning"):
        workspace.scan.accept(volume)


def ask_about(plan: ImportPlan, prompts: Prompts) -> ImportPlan | None:
    """Return the plan with answers; None where the user thinks better of it, or nothing can be done."""
    if len(plan.choices) > 1 and plan.options.series is None:
        texts = [choice.text for choice in plan.choices]
        chosen = prompts.item("Which scan?", f"{plan.path.name} holds several scans", texts)
        if not chosen:
            return None
        plan = inspect_volume(plan, series=plan.choices[texts.index(chosen)].id)
    for problem in plan.errors:
        if "spacing" in problem.resolved_by:
            suggested = (plan.suggested_spacing or (0.1, 0.1, 0.1))[0]
            given = prompts.number(
                "Voxel size", f"{problem.text}. {problem.remedy} Voxel size, mm:", suggested
            )
            if given is None:
                return None
            plan = plan.with_options(spacing=given)
        elif "accept" in problem.resolved_by:
            if not prompts.choose(
                "Check this first", problem.text, ["Go on"], detail=problem.remedy, kind="warning"
            ):
                return None
            plan = plan.with_options(accept=plan.options.accept | {problem.code})
    if plan.errors:
        prompts.tell("It cannot be read", " ".join(problem.text for problem in plan.errors))
        return None
    if not plan.sides_known:
        answer = prompts.choose(
            "Which side is left?",
            f"{plan.format} does not say which side is left.",
            ["Keep the order of the slices", "Reverse it"],
            detail="After opening, check a structure whose side you know.",
        )
        if not answer:
            return None
        plan = plan.with_options(reverse=answer == "Reverse it")
    return plan


def import_asking(workspace: Workspace, files: Sequence[Path], prompts: Prompts, **how: Any) -> None:
    """Take over landmark files; asks where they cannot belong to the scan."""
    try:
        notes = import_landmarks(workspace.document, files, near_bone=workspace.scan.near_bone, **how)
    except OffBoneError as error:
        answers = ["Import anyway"]
        if prompts.choose("Do they belong to this scan?", error.problem, answers, detail=error.remedy or ""):
            import_asking(workspace, files, prompts, accept_off_bone=True)
        return
    words = ". ".join(notes) or f"Imported {', '.join(file.name for file in files)}"
    workspace.say(words, "warning" if notes else "info")


def export_asking(workspace: Workspace, folder: Path, prompts: Prompts) -> None:
    """Write the landmarks of both sides into a folder; asks before files are replaced."""
    state = workspace.document.measured_state
    try:
        report = export_landmarks(state, folder)
    except AlreadyExistsError as error:
        if not prompts.choose("Replace?", str(error), ["Replace"], kind="warning"):
            return
        report = export_landmarks(state, folder, overwrite=True)
    workspace.say(report.text.replace("\n", "  "), "info" if report.is_complete else "warning")
    workspace.messages.wrote.emit("landmarks", report)
