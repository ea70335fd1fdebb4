"""What an OME description says of the images in a TIFF file."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass
from pathlib import Path

from gp_labeler.imaging.readers.spacing import unit_in_mm

__all__ = ["OmeImage", "ome_images"]

_UNIT_BY_DEFAULT = "µm"
_MOST_BYTES = 1 << 26


@dataclass(frozen=True)
class OmeImage:
    """One image of an OME description.

    Parameters
    ----------
    name : str
        What its writer called it; may be empty.
    sizes : dict
        Pixels along ``X``, ``Y``, ``Z``, and how many channels ``C`` and times ``T``.
    pixel_mm : tuple of float or None
        Pixel size along X, Y, Z, mm; None where it is not given as a length.
    units : tuple of str
        Units along X, Y, Z that are no lengths, such as ``pixel``.
    files : tuple of str
        Files that hold its planes, as it names them.
    """

    name: str
    sizes: dict[str, int]
    pixel_mm: tuple[float | None, float | None, float | None]
    units: tuple[str, ...]
    files: tuple[str, ...]


def ome_images(text: str, folder: Path) -> tuple[tuple[OmeImage, ...], str]:
    """Read the images of a description, and the name of the companion file that holds it in its place.

    Parameters
    ----------
    text : str
        OME-XML.
    folder : Path
        Where the TIFF file is: a description that is kept in a companion file is looked for there.

    Returns
    -------
    images : tuple of OmeImage
        Empty where there is no readable description.
    companion : str
        Name of the companion file; empty where the description is in the TIFF file itself.
    """
    root = _parsed(text)
    if root is None:
        return (), ""
    companion = next((e.get("MetadataFile", "") for e in root if _is(e, "BinaryOnly")), "")
    if companion:
        file = folder / Path(companion).name
        root = _parsed(_head(file)) if file.is_file() else None
        if root is None:
            return (), companion
    images = [
        _image(image.get("Name") or "", pixels)
        for image in root
        if _is(image, "Image")
        for pixels in image
        if _is(pixels, "Pixels")
    ]
    return tuple(images), companion


def _head(file: Path) -> bytes:
    with file.open("rb") as stream:
        return stream.read(_MOST_BYTES)


def _parsed(text: str | bytes) -> ElementTree.Element | None:
    try:
        return ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError):
        return None


def _is(element: ElementTree.Element, name: str) -> bool:
    return element.tag.rpartition("}")[2] == name


def _image(name: str, pixels: ElementTree.Element) -> OmeImage:
    units = [pixels.get(f"PhysicalSize{axis}Unit", _UNIT_BY_DEFAULT) for axis in "XYZ"]
    x, y, z = (_length(pixels.get(f"PhysicalSize{a}"), unit) for a, unit in zip("XYZ", units, strict=True))
    return OmeImage(
        name,
        {axis: int(pixels.get(f"Size{axis}", "1")) for axis in "XYZCT"},
        (x, y, z),
        tuple(dict.fromkeys(unit for unit in units if unit_in_mm(unit) is None)),
        tuple(dict.fromkeys(e.get("FileName", "") for e in pixels.iter() if _is(e, "UUID"))),
    )


def _length(text: str | None, unit: str) -> float | None:
    mm = unit_in_mm(unit)
    try:
        value = float(text or "")
    except ValueError:
        return None
    return value * mm if mm is not None and value > 0 else None
