"""ITK transform files, ``.tfm``, as 3D Slicer reads them."""

from __future__ import annotations

from os import PathLike

from gp_core.disk import write_text
from gp_core.frames import RigidTransform

__all__ = ["tfm_text", "write_tfm"]


def write_tfm(path: str | PathLike[str], T_dst_src: RigidTransform) -> None:
    """Write an ITK transform file that 3D Slicer shows as `T_dst_src`, such as cochlea to tracker.

    By ITK's convention, which Slicer undoes on reading, the file holds the inverse: it maps points of `dst`
    to points of `src`.

    Parameters
    ----------
    path : path-like
        Where to write.
    T_dst_src : RigidTransform
        Translation in mm.

    Raises
    ------
    GpError
        The file cannot be written.
    """
    write_text(path, tfm_text(T_dst_src))


def tfm_text(T_dst_src: RigidTransform) -> str:
    """Return the text of an ITK transform file that 3D Slicer shows as `T_dst_src`.

    Parameters
    ----------
    T_dst_src : RigidTransform
        Translation in mm.

    Returns
    -------
    str
        Content of a ``.tfm`` file.
    """
    back = T_dst_src.inverse()
    numbers = " ".join(repr(float(n)) for n in (*back.rotation.ravel(), *back.translation))
    return (
        "#Insight Transform File V1.0\n"
        f"# maps {back.src} points to {back.dst} points (mm); Slicer shows the way back\n"
        "#Transform 0\nTransform: AffineTransform_double_3_3\n"
        f"Parameters: {numbers}\nFixedParameters: 0 0 0\n"
    )
