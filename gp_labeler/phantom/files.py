"""A phantom on disk: the scan, and the truth beside it."""

from __future__ import annotations

import json
import os
from os import PathLike
from pathlib import Path
from typing import Any

from gp_core.disk import FREE_SPACE, all_or_none, atomic_file, write_text
from gp_core.errors import GpError
from gp_core.io.markups import write_markups
from gp_core.landmarks.features import Side
from gp_core.terminal import silent_libraries
from gp_labeler.imaging.volume import Volume
from gp_labeler.phantom.phantom import Phantom

__all__ = ["save_phantom", "scan_name", "write_phantom"]

_FORMATS = (".nrrd", ".nii.gz", ".nii", ".mha")


def write_phantom(phantom: Phantom, directory: str | PathLike[str]) -> tuple[Path, Path, Path]:
    """Write a phantom into a folder, by its own name, with its landmarks; see `save_phantom`.

    Returns
    -------
    volume, left, right : Path
        ``<name>.nrrd``, ``<name>_L.mrk.json``, ``<name>_R.mrk.json``; beside them ``<name>.truth.json``.

    Raises
    ------
    GpError
        The folder cannot be written to.
    """
    volume, _, left, right = save_phantom(
        phantom, Path(directory) / f"{phantom.specimen.name}.nrrd", labelled=True
    )
    return volume, left, right


def save_phantom(phantom: Phantom, path: str | PathLike[str], *, labelled: bool = False) -> tuple[Path, ...]:
    """Write a phantom's scan, with the truth beside it.

    Parameters
    ----------
    phantom : Phantom
    path : path
        ``.nrrd``, ``.nii.gz``, ``.nii`` or ``.mha``; folders are made.
    labelled : bool
        Also write the true landmarks as landmark JSON, one file a side, as if a person had labelled the scan.

    Returns
    -------
    tuple of Path
        The scan, ``<name>.truth.json``, and if labelled ``<name>_L.mrk.json`` and ``<name>_R.mrk.json``.

    Raises
    ------
    GpError
        The format is not known, or a file cannot be written.
    """
    scan = Path(path)
    ending = next((e for e in _FORMATS if scan.name.lower().endswith(e)), None)
    if ending is None:
        raise GpError(
            f"a phantom is written as {', '.join(_FORMATS)}", file=scan, remedy="Change the ending."
        )
    name = scan.name[: -len(ending)]
    try:
        scan.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise GpError(f"cannot be made ({error.strerror})", file=scan.parent) from None
    truth = scan.with_name(f"{name}.truth.json")
    about = _about(phantom.volume, scan)
    landmarks = {scan.with_name(f"{name}_{side.value}.mrk.json"): side for side in Side if labelled}
    with all_or_none():
        _write_volume(phantom.volume, scan)
        write_text(truth, json.dumps(_truth(phantom, about), indent=1) + "\n")
        for file, side in landmarks.items():
            write_markups(file, phantom.specimen.side(side), specimen=name, volume=about)
    return scan, truth, *landmarks


def scan_name(path: Path) -> str:
    """Return the name of a scan without its ending.

    Raises
    ------
    GpError
        No phantom is written in this format.
    """
    ending = next((e for e in _FORMATS if path.name.lower().endswith(e)), None)
    if ending is None:
        raise GpError(
            f"a phantom is written as {', '.join(_FORMATS)}", file=path, remedy="Change the ending."
        )
    return path.name[: -len(ending)]


def _about(volume: Volume, path: Path) -> dict[str, Any]:
    return {
        "name": path.name,
        "size": list(volume.size),
        "spacing": list(volume.spacing),
        "checksum": volume.checksum,
    }


def _truth(phantom: Phantom, about: dict[str, Any]) -> dict[str, Any]:
    """Return what is known of the phantom as JSON values."""
    T_head_scan = phantom.T_head_scan
    normal = T_head_scan.rotation[0]
    return {
        "schema": "gp-labeler phantom truth",
        "version": 1,
        "volume": about,
        "seed": phantom.seed,
        "varied": list(phantom.variation.names),
        "variation": phantom.variation.as_json(),
        "T_head_scan": T_head_scan.matrix.tolist(),
        "midPlane": {"normal": normal.tolist(), "offset": -float(T_head_scan.translation[0])},
        "mirroredSilently": phantom.variation.mirrored == "silent",
        "landmarks": {
            side.value: {code: landmarks[code].tolist() for code in landmarks.placed}
            for side, landmarks in phantom.specimen.sides.items()
        },
    }


def _write_volume(volume: Volume, path: Path) -> None:
    import SimpleITK

    image: Any = SimpleITK.GetImageFromArray(volume.array)
    image.SetSpacing(volume.spacing)
    image.SetOrigin(volume.origin.tolist())
    image.SetDirection(volume.direction.ravel().tolist())
    with atomic_file(path) as draft, silent_libraries():
        try:
            SimpleITK.WriteImage(image, str(draft), useCompression=True)
            _require_space(draft)
        except (RuntimeError, OSError):
            raise GpError("the scan cannot be written whole", file=path, remedy=FREE_SPACE) from None


def _require_space(draft: Path) -> None:
    """Raise OSError where the disk takes not one byte more; not every format of ITK says that."""
    size = draft.stat().st_size
    with draft.open("ab") as file:
        file.write(b"\0")
    os.truncate(draft, size)
