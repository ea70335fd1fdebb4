"""What programs are told of an estimate: the pose, and whether it may be used."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from gp_core.pose.cochlea_pose import CochleaPose
from gp_core.pose.gate import GateReason, reasons_against_writing

__all__ = ["MAY_BE_USED", "WITHHELD", "pose_answer"]

MAY_BE_USED, WITHHELD = 0, 3
"""Values of ``status``, and exit statuses of ``gp-core estimate``."""


def pose_answer(
    pose: CochleaPose, also: Sequence[GateReason] = (), *, accept_warnings: bool = False
) -> dict[str, Any]:
    """Return the content of a pose file with its status, as ``estimate --json`` and the service give it.

    Parameters
    ----------
    pose : CochleaPose
        An estimate.
    also : sequence of GateReason
        Reasons against it that the pose itself does not hold, such as the name of its file.
    accept_warnings : bool
        Whether a person accepts the pose in spite of these reasons; they are told all the same.

    Returns
    -------
    dict
        `CochleaPose.content` with ``status`` (0: may be used; 3: withheld) and ``reasons``, each with a
        ``code`` for programs and a ``text`` for people.
    """
    reasons = (*reasons_against_writing(pose), *also)
    status = WITHHELD if reasons and not accept_warnings else MAY_BE_USED
    content = pose.content()
    told = [{"code": reason.code, "text": reason.text} for reason in reasons]
    return {"gpPose": content.pop("gpPose"), "status": status, "reasons": told, **content}
