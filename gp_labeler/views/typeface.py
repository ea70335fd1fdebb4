"""The font that all text of the program is drawn in, on every machine.

Source Sans Pro (SIL Open Font License 1.1) comes from the package ``font-source-sans-pro``: plain font files
in a wheel, with no code that runs and nothing to build. It was chosen because its digits are all equally
wide, so that changing numbers stand still; because it is narrow for its height, so that panels are; and
because it holds the signs used here (degree, plus-minus, micro, minus, arrows, superscripts, comparisons).
"""

from __future__ import annotations

from functools import cache
from importlib.util import find_spec
from pathlib import Path

__all__ = ["FAMILY", "font_file", "font_files"]

FAMILY = "Source Sans Pro"

_PACKAGE = "font_source_sans_pro"
_STYLES = ("Regular", "It", "Semibold", "Bold")


@cache
def font_files() -> tuple[Path, ...]:
    """Return the files of the styles in use; none where the package is missing."""
    found = (font_file(style) for style in _STYLES)
    return tuple(path for path in found if path is not None)


@cache
def font_file(style: str) -> Path | None:
    """Return the file of a style: ``Regular``, ``It``, ``Semibold`` or ``Bold``; None where it is missing."""
    spec = find_spec(_PACKAGE)  # found, not imported: the package is data
    if spec is None or spec.origin is None:
        return None
    path = Path(spec.origin).parent / "files" / f"SourceSansPro-{style}.ttf"
    return path if path.is_file() else None
