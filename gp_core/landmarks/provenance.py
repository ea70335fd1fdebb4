"""What is known of a label beside its place: who placed it, when, how, how sure, and what was noted."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from types import MappingProxyType
from typing import Any

from gp_core.errors import GpError

__all__ = ["Certainty", "LabelProvenance", "described", "without_description"]


class Certainty(str, Enum):
    """How sure the observer was of a label."""

    SURE = "sure"
    FAIR = "fair"
    GUESS = "guess"


_TEXTS = {"how": "how", "observer": "by", "time": "time", "note": "note", "checked_by": "checked_by"}
"""Fields and the keys under which a file keeps them."""

_BLOCK = re.compile(r"\s*\[((?:certainty|observer|round|time|checked by|note): .*)\]\s*$", re.DOTALL)
_ENTRY = re.compile(r"(certainty|observer|round|time|checked by|note): (.*)", re.DOTALL)
_UNNAMED = "unnamed"
"""Used in a description for a person who gave no name."""


@dataclass(frozen=True)
class LabelProvenance:
    """What is known of one label beside its position.

    Parameters
    ----------
    how : str
        How it came to be: ``mesh``, ``slice``, ``confirmed suggestion``, ``imported``, ...
    observer : str
        Who placed it.
    time : str
        When, ISO 8601, UTC.
    certainty : Certainty or str, optional
        ``sure``, ``fair`` or ``guess``; None where the observer did not say.
    note : str
        What was seen: broken bulla, fluid, artefact, ...
    checked : bool
        Whether a person looked at it again and found it right.
    checked_by : str
        Who that was.
    more : mapping
        What else the file says of the label, in plain JSON values, kept as it is.

    Raises
    ------
    GpError
        Another certainty, or a text that is none.
    """

    how: str = ""
    observer: str = ""
    time: str = ""
    certainty: Certainty | None = None
    note: str = ""
    checked: bool = False
    checked_by: str = ""
    more: Mapping[str, Any] = field(default_factory=lambda: MappingProxyType({}))

    def __post_init__(self) -> None:
        for name in _TEXTS:
            value = getattr(self, name)
            if not isinstance(value, str):
                raise GpError(f"its {name.replace('_', ' ')} must be text, got {value!r:.40}")
            object.__setattr__(self, name, " ".join(value.split()))
        if self.certainty is not None:
            object.__setattr__(self, "certainty", _certainty(self.certainty))
        object.__setattr__(self, "checked", bool(self.checked or self.checked_by))
        object.__setattr__(self, "more", MappingProxyType(dict(self.more)))

    def __reduce__(self) -> tuple[object, ...]:
        """Let pickle carry it, though it cannot carry a read-only mapping."""
        texts = (self.how, self.observer, self.time, self.certainty, self.note)
        return LabelProvenance, (*texts, self.checked, self.checked_by, dict(self.more))

    def as_json(self) -> dict[str, Any]:
        """Return the provenance for a file; unknown items have no key.

        Returns
        -------
        dict
            Plain values for JSON.
        """
        texts = {key: value for name, key in _TEXTS.items() if (value := getattr(self, name))}
        found = {**self.more, **texts}
        if self.certainty is not None:
            found["certainty"] = self.certainty.value
        return found | ({"checked": True} if self.checked else {})

    @classmethod
    def from_json(cls, content: Mapping[str, Any]) -> LabelProvenance:
        """Build the provenance from the content of a file.

        Parameters
        ----------
        content : mapping
            As `as_json` returns it.

        Returns
        -------
        LabelProvenance
            The provenance.

        Raises
        ------
        GpError
            A value is not what it should be.
        """
        texts = {name: content[key] for name, key in _TEXTS.items() if content.get(key) is not None}
        known = {*_TEXTS.values(), "certainty", "checked"}
        more = {key: value for key, value in content.items() if key not in known}
        checked = content.get("checked", False)
        if not isinstance(checked, bool):
            raise GpError(f"its checked must be true or false, got {checked!r:.40}")
        return cls(**texts, certainty=content.get("certainty"), checked=checked, more=more)


def described(text: str, provenance: LabelProvenance | None, observer: str = "", round_: int = 1) -> str:
    """Return a description for 3D Slicer, which stores nothing else about a label.

    Parameters
    ----------
    text : str
        Plain description.
    provenance : LabelProvenance or None
        What is known of the label.
    observer : str
        Of the whole side, where the label has none of its own.
    round_ : int
        Which of the observer's labellings, from 1.

    Returns
    -------
    str
        The text, followed by the provenance in brackets.

    Examples
    --------
    >>> described("Cochlea apex", LabelProvenance(observer="AB", certainty="fair", note="broken bulla"))
    'Cochlea apex [certainty: fair; observer: AB; note: broken bulla]'
    """
    known = provenance or LabelProvenance()
    words = {
        "certainty": known.certainty.value if known.certainty else "",
        "observer": known.observer or observer,
        "round": str(round_) if round_ > 1 else "",
        "time": known.time,
        "checked by": (known.checked_by or _UNNAMED) if known.checked else "",
        "note": known.note,  # the last one, since it may contain anything
    }
    told = "; ".join(f"{key}: {_plain(key, value)}" for key, value in words.items() if value)
    return f"{text} [{told}]" if told else text


def without_description(text: str) -> tuple[str, LabelProvenance | None, int]:
    """Split a description that `described` made.

    A text without such brackets is returned as it is, with None and round 1.

    Parameters
    ----------
    text : str
        A description.

    Returns
    -------
    text : str
        Plain description.
    provenance : LabelProvenance or None
        What is known of the label.
    round_ : int
        Which of the observer's labellings.
    """
    match = _BLOCK.search(text)
    if match is None:
        return text, None, 1
    found: dict[str, str] = {}
    rest = match[1]
    while entry := _ENTRY.fullmatch(rest):
        key, value = entry[1], entry[2]
        value, _, rest = (value, "", "") if key == "note" else value.partition("; ")
        found[key] = value
    if rest:
        return text, None, 1
    certainty = found.get("certainty", "").strip().lower()
    who = found.get("checked by", "")
    number = found.get("round", "")
    provenance = LabelProvenance(
        observer=found.get("observer", ""),
        time=found.get("time", ""),
        certainty=Certainty(certainty) if certainty in {each.value for each in Certainty} else None,
        note=found.get("note", ""),
        checked="checked by" in found,
        checked_by="" if who == _UNNAMED else who,
    )
    return text[: match.start()], provenance, int(number) if number.isdecimal() and len(number) < 5 else 1


def _plain(key: str, value: str) -> str:
    return value if key == "note" else value.replace(";", ",")


def _certainty(value: object) -> Certainty:
    try:
        return Certainty(value)
    except ValueError:
        allowed = ", ".join(each.value for each in Certainty)
        raise GpError(f"its certainty must be one of {allowed}, got {value!r:.40}") from None
