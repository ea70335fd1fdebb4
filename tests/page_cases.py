"""Shared by the tests of the pages: which pages there are, and the files that they take for given."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from labeler.small_heads import save_markups, save_volume, small_head

from gp_core import LandmarkSet, Measurement, Side, read_landmarks, write_markups, write_measurements
from gp_core.cli import main
from gp_labeler.document.edits import PlacePoint
from gp_labeler.document.specimen_document import SpecimenDocument
from gp_labeler.document.state import How, Provenance
from gp_labeler.imaging.readers import read_volume
from gp_labeler.imaging.volume import Volume
from gp_labeler.phantom import make_phantom, save_phantom

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
PAGES = [ROOT / "README.md", *sorted(DOCS.glob("*.md")), *sorted((DOCS / "howto").glob("*.md"))]
TUTORIALS = sorted((DOCS / "tutorials").glob("*.md"))


def make_animals(here: Path) -> None:
    """Make animals, labelled twice by each of two observers; a ruler; a mesh; a labelled head."""
    (here / "docs").symlink_to(DOCS)
    drawn = ["draw", "-n", "3", "-o", str(here / "labelled"), "--observers", "AB", "CD", "--rounds", "2"]
    main([*drawn, "--label-error", "0.1"])
    main(["reliability", str(here / "labelled"), "--json", str(here / "reliability.json")])
    main(["draw", "-n", "1", "-o", str(here / "one")])
    side = read_landmarks(here / "one" / "drawn01_L.mrk.json")
    placed = {code: side[code] for code in side.placed if code not in ("CO", "MN")}  # MN is predicted
    for name in ("GP01", "GP-014"):
        landmarks = LandmarkSet.from_mapping(placed, "L", frame="scan")
        write_markups(here / f"{name}_L.mrk.json", landmarks, specimen=name)
    write_measurements(here, [Measurement("bulla width", [[1, 0, 0], [0, 0, 0]])], specimen="GP-014")
    (here / "scans").symlink_to(here / "labelled")
    mesh = pytest.importorskip("pyvista").Sphere()
    mesh.save(here / "implant.stl")
    save_phantom(make_phantom(7, spacing=0.4), here / "head.nrrd", labelled=True)


def make_small_heads(here: Path) -> None:
    """Make a library of three labelled heads, and one to label, that are quick to register."""
    (here / "library").mkdir()
    for seed in range(3):
        volume, points = small_head(seed)
        save_volume(here / "library" / f"small-{seed}.nrrd", volume)
        save_markups(here / "library" / f"small-{seed}.mrk.json", points)
    (here / "labelled").symlink_to(here / "library")
    save_volume(here / "head.nrrd", small_head(7)[0])


def make_scans(here: Path) -> None:
    """Make a labelled head, its specimen file in ``scans/`` too, two scripts, and two heads in one scan."""
    save_phantom(make_phantom(7, spacing=0.4), here / "head.nrrd", labelled=True)
    head = read_volume(here / "head.nrrd")
    (here / "scans").mkdir()
    for folder in (here, here / "scans"):
        _write_specimen(folder / "GP-014.gpspecimen.json", head, here)
    for side in "LR":
        (here / f"head_{side}.mrk.json").rename(here / f"GP-014_{side}.mrk.json")
    save_volume(here / "two-heads.nrrd", _beside_itself(head))
    for name, scan in (("script", "head"), ("batch", "{specimen}")):
        text = f'[[step]]\ndo = "open"\npath = "{scan}.nrrd"\n'
        (here / f"{name}.toml").write_text(text, encoding="utf-8")
    for specimen in ("GP-01", "GP-02", "GP-03"):
        (here / f"{specimen}.nrrd").symlink_to(here / "head.nrrd")


def _write_specimen(file: Path, head: Volume, labels: Path) -> None:
    document = SpecimenDocument()
    document.attach_volume(head)
    for side in Side:
        points = read_landmarks(labels / f"head_{side.value}.mrk.json")
        for code in ("CA", "CB", "RWA", "RWP"):
            document.do(PlacePoint(side, code, points[code], Provenance(How.SLICE)))
    document.save(file)


def _beside_itself(head: Volume) -> Volume:
    return Volume(np.concatenate([head.array] * 2, axis=2), head.T_scan_voxel, name="two-heads")


def make_stacks(here: Path) -> None:
    """Make a small scan as one file, as a DICOM series, and as slices that do not state their size."""
    import SimpleITK
    import tifffile

    volume, writer = small_head(7)[0], SimpleITK.ImageFileWriter()
    writer.KeepOriginalImageUIDOn()
    save_volume(here / "head.nrrd", volume)
    (here / "dicom").mkdir()
    (here / "slices").mkdir()
    for n, plane in enumerate(volume.array.astype(np.int16)):
        tifffile.imwrite(here / "slices" / f"head_{n:04}.tif", plane)
        image = SimpleITK.GetImageFromArray(plane[None])
        image.SetSpacing(volume.spacing)
        place = (*volume.origin[:2], volume.origin[2] + n * volume.spacing[2])
        image.SetMetaData("0020|000e", "1.2.3.4")
        image.SetMetaData("0020|0037", "1\\0\\0\\0\\1\\0")
        image.SetMetaData("0020|0032", "\\".join(map(str, place)))
        writer.SetFileName(str(here / "dicom" / f"{n:04}.dcm"))
        writer.Execute(image)
