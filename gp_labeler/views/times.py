"""When something was done, in the words of people: the local time."""

from __future__ import annotations

from datetime import datetime

from gp_labeler.views.formatting import NONE

__all__ = ["time_text"]


def time_text(time: str) -> str:
    """Return an ISO 8601 time such as ``2026-11-30 10:12``, local; a dash for none, others as they are."""
    if not time:
        return NONE
    try:
        moment = datetime.fromisoformat(time)
    except ValueError:
        return time
    return moment.astimezone().strftime("%Y-%m-%d %H:%M")
