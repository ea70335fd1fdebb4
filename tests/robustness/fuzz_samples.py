"""A good file of every kind that the program reads, small, made here: what a fuzz run begins with."""

from __future__ import annotations

import itertools
import json
import shutil
import sys
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType

import numpy as np

from gp_core import CODES, PROBE, Atlas, estimate_pose, read_touches
from gp_core.atlas.sampling import draw_animal
from gp_core.io import write_csv, write_fcsv, write_markups
from gp_core.io.file_names import landmark_file_name
from gp_core.landmarks.provenance import LabelProvenance
from gp_core.landmarks.sets import LandmarkSet

__all__ = ["make_samples"]

SIDE = "L"
REMEMBERED = {
    "host": "localhost",
    "port": 18944,
    "probe": "StylusToTracker",
    "reference": "",
    "button": "",
    "tip": "0 0 1",
    "may stand still": True,
    "largest region sent": [1.0, 10.0],
}


def make_samples(folder: Path) -> dict[str, list[Path]]:
    """Write the samples and return them by kind; each a file, or a folder that belongs together."""
    rng = np.random.default_rng(0)
    folder.mkdir(parents=True, exist_ok=True)
    samples = _landmarks(folder / "landmarks", rng)
    samples |= _tables(folder / "tables", rng)
    samples |= _sessions(folder / "sessions")
    samples["scan"] = _scans(folder / "scans", rng)
    samples["mesh"] = _meshes(folder / "meshes")
    return samples


def _landmarks(folder: Path, rng: np.random.Generator) -> dict[str, list[Path]]:
    atlas = Atlas.published()
    animals = folder / "animals"
    animals.mkdir(parents=True)
    for name in "ABCD":
        animal = draw_animal(atlas, rng=rng)
        for side in "LR":
            write_markups(animals / f"{name}_{side}.mrk.json", animal.side(side), specimen=name)
    labellings = folder / "labellings"
    labellings.mkdir()
    for name, observer, round_ in itertools.product("EF", ("AB", "CD"), (1, 2)):
        side = draw_animal(atlas, rng=rng).side(SIDE)
        known = {"CA": LabelProvenance("mesh", observer, certainty="fair", note="-1+2")}
        told = replace(side, provenance=known, observer=observer, round=round_)
        file = landmark_file_name(name, told.side, observer=observer, round_=round_)
        write_markups(labellings / file, told, specimen=name)
    one = draw_animal(atlas, rng=rng).side(SIDE)
    skull = {f"S{i}": rng.normal(scale=15, size=3) for i in range(1, 9)}
    with_skull = LandmarkSet(one.points, one.side, one.frame, extra=MappingProxyType(skull))
    write_markups(folder / "one_L.mrk.json", with_skull, specimen="one")
    write_fcsv(folder / "one_L.fcsv", with_skull)
    write_csv(folder / "one_L.csv", with_skull)
    touched = [f"{code},{','.join(repr(float(x)) for x in one[code])}" for code in PROBE]
    touched += [f"{name},{','.join(repr(float(x)) for x in p + 0.1)}" for name, p in skull.items()]
    (folder / "touches.csv").write_text("name,x,y,z\n" + "\n".join(touched) + "\n")
    (folder / "touches.tsv").write_text("name\tx\ty\tz\n" + "\n".join(touched).replace(",", "\t") + "\n")
    unseen = np.full(3, -1000.0)
    rows = [one[code] if code else unseen for code in ("CL", "MN", "OS", "", "RWA", "RWP", "LLI", "")]
    np.savetxt(folder / "touches.dat", [*rows, *(place + 0.1 for place in skull.values())], delimiter="\t")
    marks = [folder / f"one_L{suffix}" for suffix in (".mrk.json", ".fcsv", ".csv")]
    touches = [folder / f"touches{suffix}" for suffix in (".csv", ".tsv", ".dat")]
    atlas.save(folder / "atlas.json")
    estimate_pose(read_touches(touches[0], SIDE, unknown="extra"), SIDE).save(folder / "pose.json")
    return {
        "landmarks": marks,
        "touches": touches,
        "animals": [animals],
        "labellings": [labellings],
        "atlas": [folder / "atlas.json"],
        "pose": [folder / "pose.json"],
    }


def _tables(folder: Path, rng: np.random.Generator) -> dict[str, list[Path]]:
    from scipy.io import savemat
    from scipy.spatial.transform import Rotation

    folder.mkdir()
    turns = Rotation.random(40, random_state=rng).as_matrix()
    poses = np.tile(np.eye(4), (40, 1, 1))
    poses[:, :3, :3] = turns
    poses[:, :3, 3] = turns @ np.array([0.0, 0.0, 100.0])
    np.savetxt(folder / "poses.csv", poses.reshape(-1, 16), delimiter=",")
    np.savetxt(folder / "poses.txt", poses[:, :3].reshape(-1, 12))
    _recordings(folder, poses)
    (folder / "tip.json").write_text(json.dumps({"tip_offset_mm": [0.0, 0.0, 100.0], "rms_mm": 0.1}))
    (folder / "names.csv").write_text("their name,our code\nApex,CA\nBase,CB\n\nBolt,\n")
    (folder / "names.json").write_text(json.dumps({"Apex": "CA", "Base": "CB"}))
    angle = np.linspace(0, 9, 60)
    spiral = np.stack([0.2 * angle, 1.5 * np.cos(angle), 1.5 * np.sin(angle)], axis=1)
    np.savetxt(folder / "path.csv", spiral, delimiter=",")
    sets = {f"cc_{side}": rng.normal(scale=3, size=(len(CODES), 3, 3)) for side in "LR"}
    savemat(folder / "sets.mat", sets, do_compression=True)
    savemat(folder / "plain.mat", sets)
    corners = rng.normal(size=(20, 3, 3))
    record = np.zeros(20, np.dtype([("n", "<f4", 3), ("c", "<f4", (3, 3)), ("a", "<u2")]))
    record["c"] = corners
    (folder / "bone.stl").write_bytes(bytes(80) + np.uint32(20).tobytes() + record.tobytes())
    lines = [f"vertex {a} {b} {c}" for a, b, c in corners.reshape(-1, 3).tolist()]
    (folder / "words.stl").write_text("solid x\nfacet\n" + "\n".join(lines) + "\nendsolid\n")
    row = {"registration": "icp", "method": "jrmpc", "e_co_mm": 0.5, "e_ma_deg": 4.0}
    (folder / "physical.json").write_text(json.dumps({"rows": [row, row]}))
    (folder / "checkpoint.json").write_text(json.dumps({"gpCheckpoint": 1, "key": "0" * 32, "results": {}}))
    return {
        "poses": [folder / "poses.csv", folder / "poses.txt"],
        "recording": [folder / name for name in ("a.igs.mha", "a.igs.nrrd", "quaternions.csv")],
        "tip": [folder / "tip.json"],
        "names": [folder / "names.csv", folder / "names.json"],
        "path": [folder / "path.csv"],
        "mat": [folder / "sets.mat", folder / "plain.mat"],
        "stl": [folder / "bone.stl", folder / "words.stl"],
        "physical": [folder / "physical.json"],
        "checkpoint": [folder / "checkpoint.json"],
    }


def _recordings(folder: Path, poses: np.ndarray) -> None:
    """Write tracked poses as PLUS and 3D Slicer keep them, and as a table of quaternions."""
    from scipy.spatial.transform import Rotation

    for name, mark in (("a.igs.mha", " = "), ("a.igs.nrrd", ":=")):
        lines = []
        for k, pose in enumerate(poses):
            frame = f"Seq_Frame{k:04d}_"
            lines += [f"{frame}StylusToTrackerTransform{mark}{' '.join(f'{x:.6f}' for x in pose.ravel())}"]
            lines += [f"{frame}StylusToTrackerTransformStatus{mark}OK", f"{frame}Timestamp{mark}{k / 20:.3f}"]
        fields, n = "\n".join(lines) + "\n", len(poses)
        head = f"ObjectType = Image\nNDims = 3\nDimSize = 4 4 {n}\nElementType = MET_UCHAR\n"
        if mark == " = ":
            text = f"{head}{fields}ElementDataFile = LOCAL\n"
        else:
            sizes = f"dimension: 3\nsizes: 4 4 {n}\nencoding: raw\n"
            text = f"NRRD0004\ntype: unsigned char\n{sizes}{fields}\n"
        (folder / name).write_bytes(text.encode() + bytes(16 * n))
    turns = Rotation.from_matrix(poses[:, :3, :3]).as_quat()[:, [3, 0, 1, 2]]
    rows = np.column_stack([np.arange(len(poses)) / 20, turns, poses[:, :3, 3]])
    np.savetxt(folder / "quaternions.csv", rows, delimiter=",", header="t,qw,qx,qy,qz,tx,ty,tz", comments="")


def _sessions(folder: Path) -> dict[str, list[Path]]:
    from gp_labeler.document.opening import new_specimen
    from gp_labeler.document.specimen_edits import SetNotes, SetThreshold
    from gp_labeler.document.touching import load_skull, load_touches, record_touch

    folder.mkdir()
    from gp_labeler.document.specimen_document import SpecimenDocument

    document = SpecimenDocument(new_specimen(folder / "state", specimen="GP-014"))
    for value in range(5):
        document.do(SetThreshold(value))
    document.do(SetNotes("notes"))
    load_touches(document, folder.parent / "landmarks" / "touches.dat", SIDE)
    load_skull(document, folder.parent / "landmarks" / "one_L.csv")
    record_touch(document, "R", "OS", (1, 2, 3))
    saved = document.save(folder / "GP-014")
    document.do(SetNotes("more"))
    document.undo()
    document.do(SetThreshold(9))
    (journal,) = (folder / "state" / "journals").glob("*.jsonl")
    shutil.copy(journal, folder / "journal.jsonl")
    document.close(discard=True)
    (folder / "script.toml").write_text(
        'specimens = ["a"]\n[[step]]\ndo = "open"\npath = "{specimen}.nrrd"\n[[step]]\ndo = "place"\n'
        'feature = "CA"\nside = "L"\nat = [1.0, 2, 3]\n[[step]]\ndo = "save"\n'
    )
    (folder / "script.json").write_text(json.dumps([{"do": "open", "phantom": 0}, {"do": "export"}]))
    (folder / "window.json").write_text(json.dumps({"tracker": REMEMBERED}))
    (folder / "settings.toml").write_text('workers = 2\nverbose = false\ncanvas = "painted"\n')
    (folder / "recent.json").write_text(json.dumps({"files": ["/a", "/b"]}))
    return {
        "specimen": [saved],
        "journal": [folder / "journal.jsonl"],
        "script": [folder / "script.toml", folder / "script.json"],
        "state": [folder / "recent.json"],
        "tracker": [folder / "window.json"],
        "settings": [folder / "settings.toml"],
    }


def _scans(folder: Path, rng: np.random.Generator) -> list[Path]:
    sys.path.append(str(Path(__file__).resolve().parents[1] / "labeler" / "imaging"))
    import dicom_makers
    import SimpleITK
    import tifffile
    from PIL import Image

    folder.mkdir()
    voxels = (200 * (rng.random((10, 12, 14)) > 0.4) + 20 * rng.random((10, 12, 14))).astype(np.uint16)
    image = SimpleITK.GetImageFromArray(voxels)
    image.SetSpacing((0.1, 0.1, 0.2))
    found = []
    for name in ("a.nrrd", "a.mha", "a.nii", "a.nii.gz", "a.vtk", "a.gipl"):
        SimpleITK.WriteImage(image, str(folder / name), useCompression=name in ("a.nrrd", "a.nii.gz"))
        found.append(folder / name)
    words = " ".join(map(str, voxels.ravel().tolist()))
    about = "# vtk DataFile Version 3.0\nscan\nASCII\nDATASET STRUCTURED_POINTS\nDIMENSIONS 14 12 10\n"
    about += "ORIGIN 0 0 0\nSPACING 0.1 0.1 0.2\nPOINT_DATA 1680\nSCALARS grey int 1\nLOOKUP_TABLE default\n"
    (folder / "words.vtk").write_text(about + words + "\n")
    found.append(folder / "words.vtk")
    for name in ("b.nhdr", "b.mhd", "b.hdr"):
        pair = folder / name.replace(".", "_")
        pair.mkdir()
        SimpleITK.WriteImage(image, str(pair / name))
        found.append(pair)
    tifffile.imwrite(folder / "pages.tif", voxels, imagej=True, resolution=(10, 10), metadata={"unit": "mm"})
    tifffile.imwrite(folder / "o.ome.tif", voxels, metadata={"axes": "ZYX", "PhysicalSizeX": 100.0})
    found += [folder / "pages.tif", folder / "o.ome.tif"]
    for suffix in ("png", "bmp", "jpg", "tif"):
        stack = folder / f"stack_{suffix}"
        stack.mkdir()
        for n, plane in enumerate(voxels.astype(np.uint8)):
            Image.fromarray(plane).save(stack / f"s{n:03d}.{suffix}")
        (stack / "scan.log").write_text("[System]\nScanner=SkyScan1172\n[Acquisition]\nPixel Size (um)=100\n")
        found.append(stack)
    dicom = folder / "dicom"
    dicom.mkdir()
    found += [dicom_makers.write(dicom, dicom_makers.slices()[:4]), folder / "many.dcm", folder / "a.isq"]
    dicom_makers.enhanced().save_as(folder / "many.dcm", enforce_file_format=True)
    head = bytearray(512)
    head[:16] = b"CTDATA-HEADER_V1"
    head[16:20] = np.int32(3).tobytes()
    head[44:68] = np.array([14, 12, 10, 1400, 1200, 2000], "<i4").tobytes()
    (folder / "a.isq").write_bytes(bytes(head) + voxels.astype("<i2").tobytes())
    return found


def _meshes(folder: Path) -> list[Path]:
    import pyvista

    folder.mkdir()
    made = []
    for name in ("a.ply", "a.stl", "a.vtp"):
        pyvista.Sphere(theta_resolution=8, phi_resolution=8).save(folder / name)
        made.append(folder / name)
    corners = "".join(f"v {x} {y} {z}\n" for x, y, z in ((0, 0, 0), (1, 0, 0), (0, 1, 0)))
    (folder / "a.obj").write_text(f"{corners}f 1 2 3\n")
    return [*made, folder / "a.obj"]
