"""Rigid transforms that know their frames, and the mirror between the two sides.

Points are (N, 3) rows in mm; matrices act on columns, ``p_dst = T_dst_src @ p_src``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from gp_core.argument_types import check_fields, checks_arguments
from gp_core.errors import FrameError
from gp_core.validation import FloatArray, as_points, as_vectors

__all__ = ["FRAMES", "RigidTransform", "angle_between_deg", "cross_matrix", "mirror_x", "quaternion_xyzw"]

FRAMES = ("scan", "head", "tracker", "cochlea", "window", "atlas")

_ORTHONORMAL_TOLERANCE = 1e-6


@dataclass(frozen=True)
class RigidTransform:
    """A rigid transform (no reflection) from frame `src` to frame `dst`.

    Parameters
    ----------
    matrix : (4, 4) array_like
        Homogeneous matrix ``T_dst_src``, translation in mm.
    dst, src : str
        Frame names, destination first.

    Raises
    ------
    FrameError
        The matrix is not a rotation (det +1) and a translation.

    Examples
    --------
    >>> T = RigidTransform.from_parts(np.eye(3), [1, 2, 3], dst="tracker", src="cochlea")
    >>> T.apply([[0, 0, 0]])
    array([[1., 2., 3.]])
    """

    matrix: FloatArray
    dst: str
    src: str

    def __post_init__(self) -> None:
        check_fields(self)
        matrix = np.array(self.matrix, dtype=np.float64)
        if matrix.shape != (4, 4) or not np.isfinite(matrix).all():
            raise FrameError(f"a rigid transform must be a finite (4, 4) matrix, got shape {matrix.shape}")
        rotation = matrix[:3, :3]
        off = float(np.abs(rotation.T @ rotation - np.eye(3)).max())
        if off > _ORTHONORMAL_TOLERANCE or not np.array_equal(matrix[3], [0, 0, 0, 1]):
            raise FrameError(f"T_{self.dst}_{self.src} is not rigid (off by {off:.2g})")
        if np.linalg.det(rotation) < 0:
            raise FrameError(f"T_{self.dst}_{self.src} mirrors (det -1); use mirror_x for the other side")
        matrix.setflags(write=False)
        object.__setattr__(self, "matrix", matrix)

    @classmethod
    def from_parts(cls, rotation: ArrayLike, translation: ArrayLike, *, dst: str, src: str) -> RigidTransform:
        """Make a transform from a rotation and a translation.

        Parameters
        ----------
        rotation : (3, 3) array_like
            Rotation, det +1.
        translation : (3,) array_like
            Translation, mm.
        dst, src : str
            Frame names, destination first.

        Returns
        -------
        RigidTransform
            ``T_dst_src``.

        Raises
        ------
        FrameError
            The matrix is not a rotation.
        """
        matrix = np.eye(4)
        try:
            matrix[:3, :3] = rotation
            matrix[:3, 3] = translation
        except (TypeError, ValueError, OverflowError):
            raise FrameError("a rigid transform is of (3, 3) and (3,) numbers") from None
        return cls(matrix, dst, src)

    @classmethod
    def identity(cls, *, dst: str, src: str) -> RigidTransform:
        """Make the transform that leaves coordinates unchanged.

        Parameters
        ----------
        dst, src : str
            Frame names, destination first.

        Returns
        -------
        RigidTransform
            ``T_dst_src``.
        """
        return cls(np.eye(4), dst, src)

    @property
    def rotation(self) -> FloatArray:
        """(3, 3) rotation, det +1."""
        return self.matrix[:3, :3]

    @property
    def translation(self) -> FloatArray:
        """(3,) translation, mm: where the origin of `src` lies in `dst`."""
        return self.matrix[:3, 3]

    def apply(self, points: ArrayLike) -> FloatArray:
        """Transform points from `src` to `dst`.

        Parameters
        ----------
        points : (N, 3) array_like, mm
            Points in frame `src`; rows of NaN (missing) stay missing.

        Returns
        -------
        (N, 3) array, mm
            Points in frame `dst`.
        """
        moved: FloatArray = as_points(points, "points", missing_allowed=True) @ self.rotation.T
        moved += self.translation
        return moved

    def apply_vector(self, vectors: ArrayLike) -> FloatArray:
        """Rotate vectors from `src` to `dst`.

        Parameters
        ----------
        vectors : (..., 3) array_like
            Vectors in frame `src`.

        Returns
        -------
        (..., 3) array
            Vectors in frame `dst`.
        """
        turned: FloatArray = as_vectors(vectors, "vectors") @ self.rotation.T
        return turned

    def inverse(self) -> RigidTransform:
        """Return the inverse transform.

        Returns
        -------
        RigidTransform
            ``T_src_dst``.
        """
        turned_back = self.rotation.T
        return RigidTransform.from_parts(
            turned_back, -turned_back @ self.translation, dst=self.src, src=self.dst
        )

    @checks_arguments
    def __matmul__(self, other: RigidTransform) -> RigidTransform:
        """Compose ``T_a_b @ T_b_c``.

        Raises
        ------
        FrameError
            The inner frames differ.
        """
        if self.src != other.dst:
            raise FrameError(
                f"T_{self.dst}_{self.src} cannot follow T_{other.dst}_{other.src}: "
                f"{self.src!r} and {other.dst!r} are different frames"
            )
        return RigidTransform(self.matrix @ other.matrix, self.dst, other.src)


def mirror_x(points: ArrayLike) -> FloatArray:
    """Mirror points in x: the explicit step between a right side and the stored left one.

    Parameters
    ----------
    points : (N, 3) array_like, mm
        Points; rows of NaN (missing) stay missing.

    Returns
    -------
    (N, 3) array, mm
        Mirrored points.
    """
    mirrored: FloatArray = as_points(points, "points", missing_allowed=True) * np.array([-1.0, 1.0, 1.0])
    return mirrored


def cross_matrix(vector: FloatArray) -> FloatArray:
    """Return the matrix that maps v to ``vector × v``.

    Parameters
    ----------
    vector : (3,) array
        Any vector.

    Returns
    -------
    (3, 3) array
        Skew-symmetric.
    """
    x, y, z = vector.tolist()
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def angle_between_deg(first: FloatArray, second: FloatArray) -> FloatArray:
    """Return the angles between vectors, accurate for small angles too.

    Parameters
    ----------
    first, second : (..., 3) arrays
        Vectors, not zero.

    Returns
    -------
    (...,) array
        Angles, degrees.
    """
    sine = np.linalg.norm(np.cross(first, second), axis=-1)
    cosine = np.sum(first * second, axis=-1)
    angle: FloatArray = np.degrees(np.arctan2(sine, cosine))
    return angle


def quaternion_xyzw(rotation: FloatArray) -> FloatArray:
    """Return a rotation matrix as a unit quaternion, in the order of ROS and SciPy.

    Parameters
    ----------
    rotation : (3, 3) array
        With determinant +1.

    Returns
    -------
    (4,) array
        x, y, z, w with w >= 0.

    Examples
    --------
    >>> quaternion_xyzw(np.eye(3)).tolist()
    [0.0, 0.0, 0.0, 1.0]
    """
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = rotation.tolist()
    # each row is the quaternion times four times one of its elements; the longest is the best conditioned
    rows = np.array(
        [
            [1 + xx - yy - zz, xy + yx, xz + zx, zy - yz],
            [xy + yx, 1 - xx + yy - zz, yz + zy, xz - zx],
            [xz + zx, yz + zy, 1 - xx - yy + zz, yx - xy],
            [zy - yz, xz - zx, yx - xy, 1 + xx + yy + zz],
        ]
    )
    best = rows[int(np.argmax(np.diag(rows)))]
    quaternion: FloatArray = best / np.linalg.norm(best) * (-1.0 if best[3] < 0 else 1.0)
    return quaternion + 0.0  # no negative zeros
