"""A straightened head on disk as the template for front, up and pitch of other heads."""

from __future__ import annotations

from collections.abc import Callable
from os import PathLike
from pathlib import Path

from gp_core.errors import GpError
from gp_labeler.document.specimen_file import SUFFIX, read_specimen
from gp_labeler.head_pose.template import HeadTemplate
from gp_labeler.imaging.readers import read_volume

__all__ = ["read_head_template"]


def read_head_template(path: str | PathLike[str], cancel: Callable[[], bool] | None = None) -> HeadTemplate:
    """Read the bone of a head that was straightened and saved.

    Parameters
    ----------
    path : path
        A specimen file, ``.gpspecimen.json``, with a head frame. Its scan is read as it was then.
    cancel : callable, optional
        Asked whether to stop.

    Returns
    -------
    HeadTemplate

    Raises
    ------
    GpError
        The file cannot be read, the head was not straightened, or its scan is not there.
    """
    file = Path(path)
    if not file.name.endswith(SUFFIX):
        raise GpError("is not a specimen file", file=file, remedy=f"Choose a *{SUFFIX} file.")
    state = read_specimen(file)
    if state.head_frame is None:
        raise GpError(
            "has no head frame", file=file, remedy="Straighten its head in the window, and save the specimen."
        )
    if state.volume is None or state.volume.path is None or not Path(state.volume.path).exists():
        raise GpError(
            "its scan is not there", file=file, remedy="Open the specimen, find the scan, and save it."
        )
    volume = read_volume(Path(state.volume.path), cancel=cancel, **state.import_choices)
    return HeadTemplate.of(volume, state.head_frame.T_head_scan, threshold=state.threshold)
