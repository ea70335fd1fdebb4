"""What is asked where a scan's files do not say enough."""

from __future__ import annotations

from PySide6.QtWidgets import QWidget

from gp_labeler.imaging.readers import ImportPlan, inspect_volume
from gp_labeler.views.prompts import Prompts

__all__ = ["ask_about"]


def ask_about(plan: ImportPlan, parent: QWidget, prompts: Prompts) -> ImportPlan | None:
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
                "Look at this first", problem.text, ["Go on"], detail=problem.remedy, kind="warning"
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
            detail="Check a side that you know once it is open.",
        )
        if not answer:
            return None
        plan = plan.with_options(reverse=answer == "Reverse it")
    return plan
