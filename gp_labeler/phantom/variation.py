"""How one synthetic head and its scan differ from the plain ones: switches, each by itself, each by seed."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass, fields, replace
from typing import Any

import numpy as np

from gp_core.errors import GpError
from gp_core.validation import check_option

__all__ = ["SWITCHES", "USUAL", "HeadVariation", "Switch", "generator_of"]

_FACES = ("L", "R", "A", "P", "S", "I")
_HOLDERS = ("tube", "cradle", "rod")
_STORAGES = ("grid", "silent")
_SIDES = ("L", "R")
_LARGEST_TURN_DEG = 180.0


@dataclass(frozen=True)
class HeadVariation:
    """What differs in one phantom; every default is the plain phantom's.

    Parameters
    ----------
    size : float
        Factor of all lengths of the animal, 0.7 to 1.3.
    bone_thickness : float
        Factor of the walls of braincase and bullae, 0.5 to 2. Landmarks stay on the surface of bone.
    bone_density : float
        Factor of how far bone and teeth are brighter than soft tissue, 0.4 to 1.6.
    marrow : float
        Contrast of marrow spaces in thick bone, 0 to 1.
    asymmetry : float
        Root mean square of a smooth displacement that differs between left and right, 0 to 1 mm.
    soft_tissue : float
        Contrast between fat and muscle, 0 to 1.
    dry : bool
        A dry skull: air instead of soft tissue.
    broken_bulla : str
        Side, ``L`` or ``R``, of a bulla with a hole in its wall, blood and a chip of bone; or empty.
    electrode : str
        Side, ``L`` or ``R``, of a metal wire through the ear canal to the round window; or empty.
    clip : bool
        A metal clip in the skin of the neck.
    holder : str
        As bright as bone: ``tube`` around the head, ``cradle`` below it, ``rod`` through the mouth; or empty.
    turn : (float, float, float)
        Rotation vector of the head in its scan, degrees, LPS axes.
    crop : (float, str)
        Fraction of the bone beyond the edge of the scan, 0 to 0.8, and at which face: L, R, A, P, S or I.
    mirrored : str
        ``grid``: stored with a left-handed grid, as the file says. ``silent``: the voxels are mirrored and
        the file does not say so. Empty: neither.
    beam_hardening : float
        Share of its brightness that the densest part loses, 0 to 0.5.
    rings : float
        Standard deviation of rings around the axis of the scanner, grey values, 0 to 5000.
    partial_volume : float
        Edge of the cube that each voxel is a mean of, voxels, 1 to 4.
    circle : float
        Radius of the scanner's circle over half the shorter edge of a slice, 0.5 to 1.4; voxels outside it
        hold one fill value. 0: no circle.

    Examples
    --------
    >>> HeadVariation.drawn(3, ["marrow", "turn"]).names
    ('marrow', 'turn')
    """

    size: float = 1.0
    bone_thickness: float = 1.0
    bone_density: float = 1.0
    marrow: float = 0.0
    asymmetry: float = 0.0
    soft_tissue: float = 0.0
    dry: bool = False
    broken_bulla: str = ""
    electrode: str = ""
    clip: bool = False
    holder: str = ""
    turn: tuple[float, float, float] = (0.0, 0.0, 0.0)
    crop: tuple[float, str] = (0.0, "L")
    mirrored: str = ""
    beam_hardening: float = 0.0
    rings: float = 0.0
    partial_volume: float = 1.0
    circle: float = 0.0

    def __post_init__(self) -> None:
        for name, (low, high) in _RANGES.items():
            _check_range(getattr(self, name), name, low, high)
        for name, allowed in (
            ("broken_bulla", _SIDES),
            ("electrode", _SIDES),
            ("holder", _HOLDERS),
            ("mirrored", _STORAGES),
        ):
            if getattr(self, name) != "":
                check_option(getattr(self, name), name, allowed)
        if len(self.turn) != 3 or not np.isfinite(self.turn).all():
            raise GpError(f"turn must be three numbers in degrees, got {self.turn!r}")
        _check_range(self.crop[0], "crop", 0.0, 0.8)
        check_option(self.crop[1], "crop", _FACES)
        if self.circle and not 0.5 <= self.circle <= 1.4:
            raise GpError(f"circle must be 0, or 0.5 to 1.4, got {self.circle!r}")

    @classmethod
    def drawn(cls, seed: int, names: Iterable[str]) -> HeadVariation:
        """Draw the named switches; each depends on the seed and its own name alone.

        Raises
        ------
        GpError
            There is no such switch.
        """
        values = {}
        for name in names:
            check_option(name, "variation", tuple(SWITCHES))
            values[name] = SWITCHES[name].draw(generator_of(seed, name))
        return cls(**values)

    @property
    def names(self) -> tuple[str, ...]:
        """The switches that are not at the plain phantom's value."""
        plain = HeadVariation()
        return tuple(
            f.name for f in fields(self) if _is_on(f.name, getattr(self, f.name), getattr(plain, f.name))
        )

    def as_json(self) -> dict[str, Any]:
        """Return the values of all switches as JSON values."""
        return {name: list(v) if isinstance(v, tuple) else v for name, v in asdict(self).items()}

    def having(self, values: Mapping[str, Any]) -> HeadVariation:
        """Return a copy with some switches set."""
        return replace(self, **values)


def _is_on(name: str, value: object, plain: object) -> bool:
    if name == "crop":
        return isinstance(value, tuple) and bool(value[0])
    return value != plain


_RANGES = {
    "size": (0.7, 1.3),
    "bone_thickness": (0.5, 2.0),
    "bone_density": (0.4, 1.6),
    "marrow": (0.0, 1.0),
    "asymmetry": (0.0, 1.0),
    "soft_tissue": (0.0, 1.0),
    "beam_hardening": (0.0, 0.5),
    "rings": (0.0, 5000.0),
    "partial_volume": (1.0, 4.0),
}


def _check_range(value: float, name: str, low: float, high: float) -> None:
    if not low <= value <= high:
        raise GpError(f"{name} must be {low:g} to {high:g}, got {value!r}")


def generator_of(seed: int, name: str) -> np.random.Generator:
    """Return a source of random numbers that depends on a seed and a name, and on nothing else."""
    return np.random.default_rng([seed, *name.encode()])


@dataclass(frozen=True)
class Switch:
    """One way in which heads differ.

    Parameters
    ----------
    draw : callable
        Of a numpy generator, gives a value.
    parse : callable
        Of a text, gives a value.
    values : str
        What may be given, for help.
    help : str
        What it does, one line.
    """

    draw: Callable[[np.random.Generator], Any]
    parse: Callable[[str], Any]
    values: str
    help: str


def _number(low: float, high: float) -> Callable[[np.random.Generator], float]:
    return lambda rng: round(float(rng.uniform(low, high)), 3)


def _one_of(*values: Any) -> Callable[[np.random.Generator], Any]:
    return lambda rng: values[int(rng.integers(len(values)))]


def _drawn_turn(rng: np.random.Generator) -> tuple[float, float, float]:
    """Draw one of all rotations, evenly."""
    from scipy.spatial.transform import Rotation

    x, y, z = np.degrees(Rotation.random(random_state=rng).as_rotvec()).round(2).tolist()
    return x, y, z


def _parsed_turn(text: str) -> tuple[float, float, float]:
    x, y, z = (float(part) for part in text.split(","))
    return x, y, z


def _drawn_crop(rng: np.random.Generator) -> tuple[float, str]:
    return round(float(rng.uniform(0.1, 0.3)), 3), str(rng.choice(_FACES))


def _parsed_crop(text: str) -> tuple[float, str]:
    fraction, _, face = text.partition(":")
    return float(fraction), face or "A"


def _parsed_flag(text: str) -> bool:
    check_option(text, "dry or clip", ("yes", "no"))
    return text == "yes"


SWITCHES: Mapping[str, Switch] = {
    "size": Switch(_number(0.85, 1.15), float, "0.7-1.3", "factor of all lengths"),
    "bone_thickness": Switch(
        _number(0.7, 1.4), float, "0.5-2", "factor of the walls of braincase and bullae"
    ),
    "bone_density": Switch(_number(0.7, 1.25), float, "0.4-1.6", "factor of how bright bone is"),
    "marrow": Switch(_number(0.4, 1.0), float, "0-1", "contrast of marrow spaces in thick bone"),
    "asymmetry": Switch(_number(0.1, 0.35), float, "mm", "how far left and right differ"),
    "soft_tissue": Switch(_number(0.3, 1.0), float, "0-1", "contrast between fat and muscle"),
    "dry": Switch(_one_of(True), _parsed_flag, "yes|no", "a dry skull"),
    "broken_bulla": Switch(_one_of(*_SIDES), str, "L|R", "a hole in the wall of one bulla"),
    "electrode": Switch(_one_of(*_SIDES), str, "L|R", "a metal wire to the round window of one side"),
    "clip": Switch(_one_of(True), _parsed_flag, "yes|no", "a metal clip in the skin of the neck"),
    "holder": Switch(_one_of(*_HOLDERS), str, "|".join(_HOLDERS), "a holder as bright as bone"),
    "turn": Switch(_drawn_turn, _parsed_turn, "X,Y,Z", "rotation vector of the head in its scan, degrees"),
    "crop": Switch(_drawn_crop, _parsed_crop, "FRACTION:FACE", "bone beyond the L, R, A, P, S or I face"),
    "mirrored": Switch(
        _one_of(*_STORAGES), str, "grid|silent", "stored mirrored; the file says so (grid) or not"
    ),
    "beam_hardening": Switch(_number(0.1, 0.3), float, "0-0.5", "share of brightness lost in dense parts"),
    "rings": Switch(_number(300.0, 1500.0), float, "GREY", "strength of ring artefacts"),
    "partial_volume": Switch(_number(1.5, 3.0), float, "VOXELS", "edge of the cube that a voxel averages"),
    "circle": Switch(_number(0.8, 1.1), float, "0.5-1.4", "radius of the scanner's circle; fill outside"),
}
"""Every switch by its name, a field of `HeadVariation`."""

USUAL = (
    "size",
    "bone_thickness",
    "bone_density",
    "marrow",
    "asymmetry",
    "soft_tissue",
    "beam_hardening",
    "rings",
    "partial_volume",
)
"""The switches in which good scans of healthy animals differ."""
