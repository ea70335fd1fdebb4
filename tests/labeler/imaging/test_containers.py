"""The same body, whatever container its voxels came in: the same surface to 0.1 voxel, or one question."""

from __future__ import annotations

import bz2
import gzip
import os
import struct
import subprocess
import sys
import zlib
from collections.abc import Callable
from pathlib import Path

import nibabel
import nrrd
import numpy as np
import pytest
import SimpleITK
from bodies import LEVEL, ORIGIN, SIZE, SPACING, affine, middle, off_by, outside, surface_of, voxels
from scipy.io import savemat
from scipy.spatial.transform import Rotation

from gp_labeler.imaging.readers import VolumeError, inspect_volume, read_volume
from gp_labeler.imaging.volume import Volume

RAW = voxels()
TURNED = affine(Rotation.from_euler("xyz", [20, -35, 50], degrees=True).as_matrix())
RAS = np.diag([-1.0, -1.0, 1.0, 1.0])
SIZES = " ".join(map(str, SIZE))
Write = Callable[[Path], Path]


def vector(values: np.ndarray) -> str:
    return f"({','.join(repr(float(v)) for v in values)})"


# NRRD ---------------------------------------------------------------------------------------------


def nrrd_text(
    *more: str, space: str = "left-posterior-superior", flips: tuple[float, ...] = (1, 1, 1), **other: str
) -> str:
    fields = {
        "type": "uint16",
        "dimension": "3",
        "space": space,
        "sizes": SIZES,
        "space directions": " ".join(vector(axis * flips) for axis in np.diag(SPACING)),
        "endian": "little",
        "encoding": "raw",
        "space origin": vector(ORIGIN * flips),
    } | {name.replace("_", " "): value for name, value in other.items()}
    return (
        "\n".join(["NRRD0005", *(f"{name}: {text}" for name, text in fields.items() if text), *more]) + "\n"
    )


def attached(body: bytes, *more: str, **other: object) -> Write:
    return lambda folder: written(folder / "a.nrrd", nrrd_text(*more, **other).encode() + b"\n" + body)


def detached(body: bytes, *more: str, **other: object) -> Write:
    def write(folder: Path) -> Path:
        written(folder / "voxels.bin", body)
        return written(folder / "a.nhdr", nrrd_text(*more, "data file: voxels.bin", **other).encode())

    return write


def written(path: Path, content: bytes) -> Path:
    path.write_bytes(content)
    return path


def nrrd_of_slices(how: str) -> Write:
    def write(folder: Path) -> Path:
        for n, plane in enumerate(RAW):
            written(folder / f"s{n + 1:03d}.raw", b"head\n" + plane.tobytes())
        said = {
            "list": "data file: LIST\n" + "\n".join(f"s{n + 1:03d}.raw" for n in range(len(RAW))),
            "list 2": "data file: LIST 2\n" + "\n".join(f"s{n + 1:03d}.raw" for n in range(len(RAW))),
            "pattern": f"data file: s%03d.raw 1 {len(RAW)} 1",
        }[how]
        return written(folder / "a.nhdr", nrrd_text("line skip: 1", said).encode())

    return write


def pynrrd(**header: object) -> Write:
    def write(folder: Path) -> Path:
        head = {"space": "LPS", "space directions": np.diag(SPACING), "space origin": ORIGIN, **header}
        nrrd.write(str(folder / "a.nrrd"), RAW.T, head, index_order="F")
        return folder / "a.nrrd"

    return write


PLAIN = RAW.tobytes()
HEX = "\n".join(PLAIN[n : n + 40].hex() for n in range(0, len(PLAIN), 40)).encode()
NRRDS: dict[str, Write] = {
    "raw": attached(PLAIN),
    "big endian": attached(RAW.astype(">u2").tobytes(), endian="big"),
    "RAS": attached(PLAIN, space="right-anterior-superior", flips=(-1, -1, 1)),
    "LAS": attached(PLAIN, space="left-anterior-superior", flips=(1, -1, 1)),
    "LAS, short, capitals": attached(PLAIN, space="LAS", flips=(1, -1, 1)),
    "3D-right-handed": attached(PLAIN, space="3D-right-handed"),
    "scanner-xyz": attached(PLAIN, space="scanner-xyz"),
    "space dimension": attached(PLAIN, "space dimension: 3", space=""),
    "gzip": attached(gzip.compress(PLAIN), encoding="gzip"),
    "bzip2": attached(bz2.compress(PLAIN), encoding="bz2"),
    "gzip, byte skip of the unpacked": attached(
        gzip.compress(b"x" * 77 + PLAIN), "byte skip: 77", encoding="gz"
    ),
    "gzip, line skip of the packed": detached(
        b"one line\n" + gzip.compress(PLAIN), "line skip: 1", encoding="gz"
    ),
    "text": attached(" ".join(map(str, RAW.ravel())).encode(), encoding="txt", endian=""),
    "text, commas between": attached(" , ".join(map(str, RAW.ravel())).encode(), encoding="ascii", endian=""),
    "hex": attached(HEX, encoding="hex"),
    "byteskip": detached(b"J" * 1024 + PLAIN, "byteskip: 1024"),
    "byte skip -1": detached(b"J" * 1024 + PLAIN, "byte skip: -1"),
    "byteskip -5": detached(b"J" * 9 + PLAIN + b"tail", "byteskip: -5"),
    "attached, byte skip -1": attached(b"J" * 9 + PLAIN, "byte skip: -1"),
    "lineskip": detached(b"a line\nand one\n" + PLAIN, "lineskip: 2"),
    "lines, then bytes": detached(b"a line\n12345" + PLAIN, "line skip: 1", "byte skip: 5"),
    "data file, one word": lambda folder: written(
        folder / "a.nhdr",
        nrrd_text(f"datafile: {written(folder / 'd.raw', PLAIN).name}").encode(),
    ),
    "list of slices": nrrd_of_slices("list"),
    "list of slices, 2D": nrrd_of_slices("list 2"),
    "pattern of slices": nrrd_of_slices("pattern"),
    "windows line ends": lambda folder: written(
        folder / "a.nrrd", nrrd_text().replace("\n", "\r\n").encode() + b"\r\n" + PLAIN
    ),
    "micrometres": attached(
        PLAIN,
        'space units: "um" "um" "um"',
        space_directions=" ".join(vector(axis * 1000) for axis in np.diag(SPACING)),
        space_origin=vector(ORIGIN * 1000),
    ),
    "micrometres along the grid": attached(
        PLAIN,
        'units: "um" "um" "um"',
        space_directions=" ".join(vector(axis * 1000) for axis in np.diag(SPACING)),
        space_origin=vector(ORIGIN * 1000),
    ),
    "no direction is (nan, nan, nan)": attached(
        np.stack([RAW, RAW // 3]).tobytes(),
        dimension="4",
        sizes=f"{SIZES} 2",
        space_directions=" ".join(vector(axis) for axis in np.diag(SPACING)) + " (nan,nan,nan)",
    ),
    "a unit for each axis": attached(
        PLAIN,
        'space units: "mm" "mm" "cm"',
        space_directions=" ".join(vector(axis * (1, 1, 0.1)) for axis in np.diag(SPACING)),
        space_origin=vector(ORIGIN * (1, 1, 0.1)),
    ),
    **{
        f"with time, {space}": attached(
            np.stack([RAW, RAW // 3]).tobytes() if n > 1 else PLAIN,
            'space units: "mm" "mm" "mm" "s"',
            space=space,
            dimension="4",
            sizes=f"{SIZES} {n}",
            space_directions=" ".join(vector([*axis * flips, 0]) for axis in np.diag(SPACING)) + " (0,0,0,2)",
            space_origin=vector([*ORIGIN * flips, 5.0]),
        )
        for space, flips, n in (
            ("left-posterior-superior-time", (1, 1, 1), 1),
            ("RAST", (-1, -1, 1), 2),
            ("LAST", (1, -1, 1), 1),
        )
    },
    "interleaved list, the first": attached(
        np.stack([RAW, RAW // 3], axis=-1).tobytes(),
        "kinds: list domain domain domain",
        dimension="4",
        sizes=f"2 {SIZES}",
        space_directions="none " + " ".join(vector(axis) for axis in np.diag(SPACING)),
    ),
    "volumes in a row, the first": attached(
        np.stack([RAW, RAW // 3]).tobytes(),
        "kinds: domain domain domain time",
        dimension="4",
        sizes=f"{SIZES} 2",
        space_directions=" ".join(vector(axis) for axis in np.diag(SPACING)) + " none",
    ),
    "lines of two channels": attached(
        np.stack([RAW, RAW // 3], axis=2).tobytes(),
        "kinds: domain list domain domain",
        dimension="4",
        sizes=f"{SIZE[0]} 2 {SIZE[1]} {SIZE[2]}",
        space_directions=" none ".join([vector(np.diag(SPACING)[0]), ""])
        + " ".join(vector(axis) for axis in np.diag(SPACING)[1:]),
    ),
    "pynrrd": pynrrd(),
    "pynrrd gzip": pynrrd(encoding="gzip"),
    "pynrrd ascii": pynrrd(encoding="ascii"),
    "pynrrd thicknesses": pynrrd(thicknesses=[np.nan, np.nan, 0.6]),
}


def test_the_body_is_what_its_voxels_show() -> None:
    points = surface_of(Volume(RAW, affine())).points
    assert np.abs(outside(points, middle(affine()))).max() < 0.12 * SPACING.min()
    assert len(points) > 2500


@pytest.mark.parametrize("name", NRRDS)
def test_nrrd(name: str, tmp_path: Path) -> None:
    path = NRRDS[name](tmp_path)
    assert off_by(path) < 0.1
    known = not any(word in name for word in ("handed", "scanner", "dimension"))
    assert inspect_volume(path).sides_known is known


@pytest.mark.parametrize(
    ("write", "words"),
    [
        (attached(PLAIN, "thicknesses: nan nan 0.6", "spacings: 0.25 0.25 nan", space="", space_directions="",
                  space_origin=""), "neither spacings nor space directions.*--spacing"),
        (attached(PLAIN, 'space units: "furlong" "furlong" "furlong"'), "unit.*'furlong'.*--spacing"),
        (attached(PLAIN, endian=""), "byte order.*endian: little, or big"),
        (attached(" ".join(f"{v},5" for v in RAW.ravel()).encode(), encoding="txt"), "not numbers"),
        (attached(PLAIN, encoding="zrl"), "encoding is 'zrl'"),
        (attached(PLAIN, type="block"), "type is 'block'"),
        (attached(gzip.compress(PLAIN), "byte skip: -1", encoding="gzip"), "byte skip -1"),
        (attached(PLAIN, sizes="46 40"), "sizes, 46 40"),
        (attached(PLAIN, sizes="46 40 -34"), "sizes, 46 40 -34"),
        (attached(PLAIN, space_origin="(0,nan,0)"), "origin"),
        (attached(PLAIN, space_directions="(1,0,0) (0,1,0) (0,0,0)"), "space directions"),
        (attached(PLAIN, kinds="domain domain list"), "2 axes of space"),
        (detached(PLAIN, "line skip: 100000"), "lines to skip"),
        (attached(gzip.compress(PLAIN), sizes="46000 40000 34", encoding="gzip"), "incomplete"),
    ],
)  # fmt: skip
def test_nrrd_that_cannot_be_read_as_it_stands(write: Write, words: str, tmp_path: Path) -> None:
    assert_asked(write(tmp_path), words)


def assert_asked(path: Path, words: str) -> None:
    with pytest.raises(VolumeError, match=words) as refused:
        read_volume(path)
    assert Path(refused.value.file).parent == path.parent
    assert "\n" not in str(refused.value)


# MetaImage ----------------------------------------------------------------------------------------


def meta(local: bool = True, raw: bytes = PLAIN, name: str = "a", **other: object) -> Write:
    def write(folder: Path) -> Path:
        data = "LOCAL" if local else other.get("ElementDataFile", "d.raw")
        fields = {
            "ObjectType": "Image",
            "NDims": 3,
            "TransformMatrix": "1 0 0 0 1 0 0 0 1",
            "Offset": " ".join(map(repr, ORIGIN.tolist())),
            "ElementSpacing": " ".join(map(repr, SPACING.tolist())),
            "DimSize": SIZES,
            "ElementType": "MET_USHORT",
            **{key: value for key, value in other.items() if key != "ElementDataFile"},
            "ElementDataFile": data,
        }
        text = "".join(f"{key} = {value}\n" for key, value in fields.items() if value is not None)
        if local:
            return written(folder / f"{name}.mha", text.encode() + raw)
        written(folder / "d.raw", raw)
        return written(folder / f"{name}.mhd", text.encode())

    return write


def meta_of_slices(said: str) -> Write:
    def write(folder: Path) -> Path:
        for n, plane in enumerate(RAW):
            written(folder / f"my slice {n + 1:03d}.raw", b"header" + plane.tobytes())
        return meta(local=False, ElementDataFile=said, HeaderSize=6)(folder)

    return write


def itk(name: str, grid: np.ndarray | None = None, *, compress: bool = False) -> Write:
    def write(folder: Path) -> Path:
        grid_ = affine() if grid is None else grid
        image = SimpleITK.GetImageFromArray(voxels(grid_))
        image.SetSpacing(SPACING.tolist())
        image.SetOrigin(grid_[:3, 3].tolist())
        image.SetDirection((grid_[:3, :3] / SPACING).ravel().tolist())
        SimpleITK.WriteImage(image, str(folder / name), useCompression=compress)
        return folder / name

    return write


METAS: dict[str, Write] = {
    "local": meta(),
    "detached": meta(local=False),
    "Position, Orientation": meta(
        Offset=None,
        Position=" ".join(map(repr, ORIGIN.tolist())),
        TransformMatrix=None,
        Orientation="1 0 0 0 1 0 0 0 1",
    ),
    "Origin, Rotation": meta(
        Offset=None,
        Origin=" ".join(map(repr, ORIGIN.tolist())),
        TransformMatrix=None,
        Rotation="1 0 0 0 1 0 0 0 1",
    ),
    "big endian": meta(raw=RAW.astype(">u2").tobytes(), BinaryDataByteOrderMSB="True"),
    "big endian, old word": meta(raw=RAW.astype(">u2").tobytes(), ElementByteOrderMSB="True"),
    "compressed": meta(raw=zlib.compress(PLAIN), CompressedData="True"),
    "compressed, detached": meta(local=False, raw=zlib.compress(PLAIN), CompressedData="True"),
    "text": meta(raw=" ".join(map(str, RAW.ravel())).encode(), BinaryData="False"),
    "HeaderSize": meta(local=False, raw=b"J" * 100 + PLAIN, HeaderSize=100),
    "HeaderSize -1": meta(local=False, raw=b"J" * 100 + PLAIN, HeaderSize=-1),
    "HeaderSize -1, local": meta(raw=b"J" * 10 + PLAIN, HeaderSize=-1),
    "a slice thickness in ElementSize": meta(ElementSize="0.25 0.25 0.6"),
    "micrometres": meta(
        ElementSpacing=" ".join(map(repr, (SPACING * 1000).tolist())),
        Offset=" ".join(map(repr, (ORIGIN * 1000).tolist())),
        DistanceUnits="um",
    ),
    "long": meta(raw=RAW.astype("<i4").tobytes(), ElementType="MET_LONG"),
    "channels": meta(raw=np.stack([RAW, RAW // 2], axis=-1).tobytes(), ElementNumberOfChannels=2),
    "volumes": meta(
        raw=np.stack([RAW, RAW // 2]).tobytes(),
        NDims=4,
        DimSize=f"{SIZES} 2",
        Offset=" ".join(map(repr, [*ORIGIN.tolist(), 0.0])),
        ElementSpacing=" ".join(map(repr, [*SPACING.tolist(), 1.0])),
        TransformMatrix=" ".join(map(str, np.eye(4).ravel())),
    ),
    "list": meta_of_slices("LIST\n" + "\n".join(f"my slice {n + 1:03d}.raw" for n in range(len(RAW)))),
    "pattern": meta_of_slices(f"my slice %03d.raw 1 {len(RAW)} 1"),
    "pattern alone": meta_of_slices("my slice %03d.raw"),
    "a name like a pattern": lambda folder: (
        written(folder / "head%20d.raw", PLAIN) and meta(local=False, ElementDataFile="head%20d.raw")(folder)
    ),
    "an array of one value a voxel": meta(ElementType="MET_USHORT_ARRAY"),
    "SimpleITK": itk("a.mha"),
    "SimpleITK, detached, packed": itk("a.mhd", compress=True),
}


@pytest.mark.parametrize("name", METAS)
def test_metaimage(name: str, tmp_path: Path) -> None:
    path = METAS[name](tmp_path)
    assert off_by(path) < 0.1
    assert inspect_volume(path).sides_known


@pytest.mark.parametrize(
    ("write", "words"),
    [
        (meta(NDims=-3), "NDims is -3"),
        (meta(NDims=1000000), "NDims is 1000000"),
        (meta(NDims="3.5"), "NDims is '3.5'"),
        (meta(DimSize="46 40"), "DimSize is '46 40', where 3 whole numbers"),
        (meta(DimSize="46 -40 34"), "DimSize"),
        (meta(ElementSpacing="0,25 0,25 0,3"), "ElementSpacing is '0,25 0,25 0,3'"),
        (meta(ElementSpacing=None, ElementSize="0.25 0.25 0.6"), "ElementSize.*--spacing 0.25 0.25 0.6"),
        (meta(ElementSpacing=None), "no ElementSpacing.*--spacing"),
        (meta(ElementSpacing="nan 0.25 0.3"), "--spacing"),
        (meta(Offset="nan 0 0"), "origin"),
        (meta(Offset="inf 0 0"), "origin"),
        (meta(TransformMatrix="1 0 0 0 1 0 0 0 nan"), "axes"),
        (meta(DistanceUnits="parsec"), "unit.*parsec"),
        (meta(ElementNumberOfChannels=0), "DimSize|Channels"),
        (meta(ElementNumberOfChannels=-2), "DimSize|Channels"),
        (meta(HeaderSize=-7), "HeaderSize is -7"),
        (meta(BinaryDataByteOrderMSB="False", ElementByteOrderMSB="True"), "ByteOrderMSB contradict"),
        (meta(Kinds="domain domain list"), "sequence of 2-D images"),
        (meta(Seq_Frame0000_Timestamp="0.0"), "sequence of 2-D images"),
        (meta(local=False, ElementDataFile="../nothing.raw"), "nothing.raw, which is not there"),
        (meta(raw=RAW.astype("<u8").tobytes(), ElementType="MET_ULONG"), "2 times as many.*--accept rest"),
        (meta(local=False, ElementType="MET_UCHAR"), "d.raw holds .* 2 times as many.*--accept rest"),
        (meta(local=False, ElementDataFile="s%03d.raw 1 100000000 1"), "names 100000000 files"),
        (meta(DimSize="46000 40000 34000", CompressedData="True"), "incomplete"),
    ],
)
def test_metaimage_that_cannot_be_read_as_it_stands(write: Write, words: str, tmp_path: Path) -> None:
    assert_asked(write(tmp_path), words)


def test_metaimage_says_where_letters_and_matrix_contradict_each_other(tmp_path: Path) -> None:
    assert not inspect_volume(meta(AnatomicalOrientation="RAI")(tmp_path)).warnings
    (warning,) = inspect_volume(meta(AnatomicalOrientation="LAS")(tmp_path)).warnings
    assert "AnatomicalOrientation, LAS, contradicts its TransformMatrix" in warning.text
    assert not inspect_volume(meta(TransformMatrix=None)(tmp_path)).sides_known


def test_bytes_behind_the_voxels_are_said(tmp_path: Path) -> None:
    path = attached(PLAIN + b"x" * 1000)(tmp_path)
    assert off_by(path) < 0.1
    (warning,) = inspect_volume(path).warnings
    assert "1,000 bytes more than its voxels need; they are left out" in warning.text
    first = meta(raw=np.stack([RAW, RAW // 3]).tobytes())(tmp_path)
    assert off_by(first, accept=["rest"]) < 0.1


# NIfTI and Analyze --------------------------------------------------------------------------------


def nifti(
    name: str = "a.nii",
    array: np.ndarray = RAW,
    grid: np.ndarray | None = None,
    kind: type = nibabel.Nifti1Image,
    unit: str = "mm",
    **fields: object,
) -> Write:
    def write(folder: Path) -> Path:
        image = kind(array.T, RAS @ (affine() if grid is None else grid), dtype=array.dtype)
        image.set_qform(image.affine, 1)
        image.set_sform(image.affine, 1)
        image.header.set_xyzt_units(unit)
        nibabel.save(image, folder / name)
        return patched(folder / name, **fields) if fields else folder / name

    return write


def patched(path: Path, **fields: object) -> Path:
    """Write fields of a NIfTI-1 header over those of a file, by their bytes."""
    places = {
        "intent_code": (68, "<h"),
        "datatype": (70, "<h"),
        "qfac": (76, "<f"),
        "pixdim": (80, "<3f"),
        "vox_offset": (108, "<f"),
        "scl_slope": (112, "<f"),
        "scl_inter": (116, "<f"),
        "qform_code": (252, "<h"),
        "sform_code": (254, "<h"),
        "srow_x": (280, "<4f"),
    }
    raw = bytearray(path.read_bytes())
    for name, value in fields.items():
        at, form = places[name]
        struct.pack_into(form, raw, at, *(value if isinstance(value, tuple) else (value,)))
    path.write_bytes(raw)
    return path


def with_forms(sform: np.ndarray, sform_code: int, qform: np.ndarray, qform_code: int) -> Write:
    def write(folder: Path) -> Path:
        image = nibabel.Nifti1Image(RAW.T, RAS @ affine())
        image.header.set_xyzt_units("mm")
        image.set_sform(RAS @ sform, sform_code)
        image.set_qform(RAS @ qform, qform_code)
        nibabel.save(image, folder / "a.nii")
        return folder / "a.nii"

    return write


def mirrored() -> np.ndarray:
    flipped = affine()
    flipped[0, 0] *= -1
    flipped[0, 3] += (SIZE[0] - 1) * SPACING[0]
    return flipped


def shifted() -> np.ndarray:
    moved = affine()
    moved[:3, 3] += 5
    return moved


NIFTIS: dict[str, Write] = {
    "NIfTI-1": nifti(),
    "NIfTI-2": nifti(kind=nibabel.Nifti2Image),
    "NIfTI-2, packed": nifti("a.nii.gz", kind=nibabel.Nifti2Image),
    "pair": nifti("a.hdr", kind=nibabel.Nifti1Pair),
    "pair, its image given": lambda folder: image_of_pair(folder),
    "NIfTI-2 pair": nifti("a.hdr", kind=nibabel.Nifti2Pair),
    "packed pair": nifti("a.hdr.gz", kind=nibabel.Nifti1Pair),
    "big endian": nifti(array=RAW.astype(">u2")),
    "int64": nifti(array=RAW.astype("int64"), kind=nibabel.Nifti2Image),
    "uint32": nifti(array=RAW.astype("uint32")),
    "uint64": nifti(array=RAW.astype("uint64")),
    "float64": nifti(array=RAW.astype("float64")),
    "no qform": nifti(qform_code=0),
    "no sform": nifti(sform_code=0),
    "qfac 0": nifti(sform_code=0, qfac=0.0),
    "micrometres": nifti(
        grid=np.diag([1e3, 1e3, 1e3, 1]) @ affine(), array=RAW, unit="micron"
    ),
    "metres": nifti(grid=np.diag([1e-3, 1e-3, 1e-3, 1]) @ affine(), unit="meter"),
    "slope 0": nifti(scl_slope=0.0),
    "slope NaN": nifti(scl_slope=float("nan")),
    "intercept NaN": nifti(scl_inter=float("nan")),
    "vox_offset 0": nifti(vox_offset=0.0),
    "4D": nifti(array=np.stack([RAW, RAW // 3])),
    "a vector's components": nifti(array=np.stack([RAW, RAW // 3])[:, None], intent_code=1007),
    "sform right, qform mirrored": with_forms(affine(), 2, mirrored(), 1),
    "sform right, qform moved": with_forms(affine(), 1, shifted(), 1),
    "sform of no code, qform right": with_forms(shifted(), 0, affine(), 1),
    "sform no placement, qform right": nifti(srow_x=(0.0, 0.0, 0.0, 0.0)),
    "SimpleITK": itk("a.nii.gz"),
}  # fmt: skip


@pytest.mark.filterwarnings("ignore::UserWarning")
@pytest.mark.parametrize("name", NIFTIS)
def test_nifti(name: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    path = NIFTIS[name](tmp_path)
    capfd.readouterr()
    assert off_by(path) < 0.1
    plan = inspect_volume(path)
    assert plan.format == "NIfTI"
    assert plan.sides_known is (name != "sform right, qform mirrored")
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("write", "words"),
    [
        (NIFTIS["sform right, qform mirrored"], "sform (code 2) and its qform (code 1) are mirror images"),
        (NIFTIS["sform right, qform moved"], "place the voxels up to 8.66 mm apart; the sform is used"),
        (
            NIFTIS["sform no placement, qform right"],
            "its sform (code 1) is not a valid transform, and was ignored",
        ),
        (nifti(qform_code=0, pixdim=(0.5, 0.5, 0.5)), "pixdim says voxels of 0.5 x 0.5 x 0.5, its sform"),
        (NIFTIS["slope NaN"], "scl_slope is nan"),
        (NIFTIS["intercept NaN"], "scl_inter nan"),
        (NIFTIS["vox_offset 0"], "vox_offset is 0"),
        (nifti(vox_offset=float("nan")), "vox_offset is nan"),
        (NIFTIS["4D"], "holds 2 volumes; the first is taken"),
    ],
)
def test_nifti_says_what_it_makes_of_a_doubtful_header(write: Write, words: str, tmp_path: Path) -> None:
    assert words in " ".join(problem.text for problem in inspect_volume(write(tmp_path)).warnings)


@pytest.mark.parametrize(
    ("write", "words"),
    [
        (nifti(scl_slope=float("inf")), "scl_slope is inf.*--accept scaling"),
        (nifti(scl_inter=float("-inf")), "scl_inter -inf.*--accept scaling"),
        (lambda folder: packed_without_offset(folder), "vox_offset is 0.*--accept vox-offset"),
        (nifti(datatype=1536), "data code 1536 not supported"),
        (nifti(datatype=32), "not plain numbers"),
        (lambda folder: remove(image_of_pair(folder)), "a.img is not"),
    ],
)  # fmt: skip
def test_nifti_that_cannot_be_read_as_it_stands(write: Write, words: str, tmp_path: Path) -> None:
    assert_asked(write(tmp_path), words)


def image_of_pair(folder: Path) -> Path:
    return nifti("a.hdr", kind=nibabel.Nifti1Pair)(folder).with_suffix(".img")


def packed_without_offset(folder: Path) -> Path:
    return written(folder / "b.nii.gz", gzip.compress(NIFTIS["vox_offset 0"](folder).read_bytes()))


def remove(path: Path) -> Path:
    path.unlink()
    return path.with_suffix(".hdr")


def test_what_nifti_asks_can_be_answered(tmp_path: Path) -> None:
    assert off_by(nifti(scl_slope=float("inf"))(tmp_path), accept=["scaling"]) < 0.1
    assert off_by(packed_without_offset(tmp_path), accept=["vox-offset"]) < 0.1


def test_analyze_knows_no_sides(tmp_path: Path) -> None:
    image = nibabel.AnalyzeImage(RAW.astype("int16").T, np.diag([*SPACING, 1]))
    nibabel.save(image, tmp_path / "a.hdr")
    plan = inspect_volume(tmp_path / "a.hdr")
    assert (plan.format, plan.sides_known) == ("Analyze", False)
    at_home = np.diag([*SPACING, 1.0])
    assert off_by(tmp_path / "a.hdr", at_home) < 0.1


MOVED = np.array([[1.0, 0, 0, 4], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])


def spm_matrix(path: Path, affine_: np.ndarray, version: str = "5", name: str = "mat") -> None:
    savemat(path, {name: affine_ @ np.linalg.inv(FROM_ONE)}, format=version)


FROM_ONE = np.eye(4)
FROM_ONE[:3, 3] = 1  # SPM counts voxels from 1


@pytest.mark.parametrize("kind", [nibabel.Spm99AnalyzeImage, nibabel.Spm2AnalyzeImage])
def test_analyze_is_placed_by_the_matrix_of_spm_as_nibabel_does(kind: type, tmp_path: Path) -> None:
    nibabel.save(kind(RAW.astype("int16").T, RAS @ affine()), tmp_path / "a.img")
    assert (tmp_path / "a.mat").exists()
    for given in ("a.img", "a.hdr"):
        assert off_by(tmp_path / given) < 0.1
        assert inspect_volume(tmp_path / given).sides_known


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes here")
@pytest.mark.parametrize("kind", [nibabel.Nifti1Pair, nibabel.Spm99AnalyzeImage])
@pytest.mark.parametrize("suffix", [".hdr", ".img", ".mat"])
def test_a_pipe_in_the_place_of_one_of_a_pair_is_not_waited_for(
    kind: type, suffix: str, tmp_path: Path
) -> None:
    nibabel.save(kind(RAW.astype("int16").T, RAS @ affine()), tmp_path / "a.img")
    (tmp_path / f"a{suffix}").unlink(missing_ok=True)
    os.mkfifo(tmp_path / f"a{suffix}")
    if suffix == ".mat":
        inspect_volume(tmp_path / "a.img")
    else:
        with pytest.raises(VolumeError, match=rf"one of a pair, and a\{suffix} is not there"):
            inspect_volume(tmp_path / {".hdr": "a.img", ".img": "a.hdr"}[suffix])


@pytest.mark.parametrize("version", ["4", "5"])
def test_the_oldest_matrix_of_spm_mirrors_and_leaves_the_sides_unknown(version: str, tmp_path: Path) -> None:
    nibabel.save(nibabel.AnalyzeImage(RAW.astype("int16").T, np.diag([*SPACING, 1])), tmp_path / "a.img")
    unmirrored = np.diag([-1.0, 1, 1, 1]) @ RAS @ affine()
    spm_matrix(tmp_path / "a.mat", unmirrored, version, "M")
    assert off_by(tmp_path / "a.img") < 0.1
    assert not inspect_volume(tmp_path / "a.img").sides_known
    np.testing.assert_allclose(nibabel.load(tmp_path / "a.img").affine, RAS @ affine(), atol=1e-9)


@pytest.mark.parametrize("name", ["a.nii", "a.nii.gz"])
def test_nifti_is_not_moved_by_the_matrix_of_spm_but_says_so(name: str, tmp_path: Path) -> None:
    path = nifti(name)(tmp_path)
    spm_matrix(tmp_path / "a.mat", RAS @ affine())
    assert not inspect_volume(path).warnings
    spm_matrix(tmp_path / "a.mat", MOVED @ RAS @ affine())
    assert off_by(path) < 0.1
    (warning,) = inspect_volume(path).warnings
    assert "a.mat beside it, which only SPM obeys, places the voxels up to 4 mm elsewhere" in warning.text
    spm_matrix(tmp_path / "a.mat", RAS @ mirrored())
    assert "mirrors the voxels" in inspect_volume(path).warnings[0].text
    assert not inspect_volume(path).sides_known


@pytest.mark.parametrize("content", [b"", b"\0" * 300, b"MATLAB 5.0" + bytes(range(256))])
def test_another_mat_file_beside_a_scan_does_not_count(content: bytes, tmp_path: Path) -> None:
    written(tmp_path / "a.mat", content)
    assert off_by(nifti()(tmp_path)) < 0.1
    savemat(tmp_path / "a.mat", {"cc_L": np.zeros((20, 3, 2)), "mat": np.eye(3)})
    assert not inspect_volume(tmp_path / "a.nii").warnings


# GIPL and VTK: what ITK reads without a word ------------------------------------------------------


def vtk(lines: str = "SCALARS s short 1\nLOOKUP_TABLE default\n", data: str = "POINT_DATA") -> bytes:
    head = f"# vtk DataFile Version 3.0\nx\nBINARY\nDATASET STRUCTURED_POINTS\nDIMENSIONS {SIZES}\n"
    head += "SPACING 0.25 0.25 0.3\nORIGIN -4.1 3.3 12.7\n"
    return (head + f"{data} {RAW.size}\n{lines}").encode()


BIG = RAW.astype(">i2").tobytes()


@pytest.mark.parametrize("name", ["a.gipl", "a.vtk", "b.vtk"])
def test_gipl_and_vtk(name: str, tmp_path: Path) -> None:
    path = itk(name)(tmp_path) if name[0] == "a" else written(tmp_path / name, vtk() + BIG)
    assert off_by(path) < 0.1
    assert not inspect_volume(path).sides_known
    path.write_bytes(path.read_bytes()[:-100])
    assert_asked(path, "it is incomplete")


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (vtk("VECTORS s short\n") + BIG, "it is incomplete"),
        (vtk(data="CELL_DATA") + BIG, "CELL_DATA"),
        (vtk().replace(b"\n", b"\r\n") + BIG, "line ends of Windows"),
        (vtk().replace(b"BINARY", b"ASCII") + b"1 2 3 " * 50, "it is incomplete"),
        (vtk().replace(b"BINARY", b"ASCII") + b"1000 " * (RAW.size - 9), "values.*it is incomplete"),
    ],
)
def test_vtk_that_cannot_be_read_as_it_stands(content: bytes, words: str, tmp_path: Path) -> None:
    assert_asked(written(tmp_path / "a.vtk", content), words)


# All of them --------------------------------------------------------------------------------------


@pytest.mark.parametrize("suffix", ["nrrd", "mha", "nii", "nii.gz", "hdr"])
@pytest.mark.parametrize("mirror", [False, True])
def test_turned_and_mirrored_grids(suffix: str, mirror: bool, tmp_path: Path) -> None:
    grid = TURNED @ np.diag([1, 1, -1 if mirror else 1, 1])
    path = itk(f"a.{suffix}", grid)(tmp_path)
    assert off_by(path, grid) < 0.1
    assert read_volume(path).is_mirrored is mirror


NAMES = [b"h\xe9t\xe9", "höhle-Ω".encode(), b"a\xff\xfe b"]


@pytest.mark.skipif(sys.platform != "linux", reason="other systems have no such names")
@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("suffix", ["nrrd", "mha", "mhd", "nii", "nii.gz", "hdr", "vtk"])
def test_names_that_are_not_utf_8(name: bytes, suffix: str, tmp_path: Path) -> None:
    plain = tmp_path / "plain"
    plain.mkdir()
    itk(f"scan.{suffix}")(plain)
    folder = Path(os.fsdecode(os.fsencode(tmp_path) + b"/" + name))
    plain.rename(folder)
    if suffix not in ("mhd", "hdr"):
        scan = folder / f"scan.{suffix}"
        scan = scan.rename(Path(os.fsdecode(os.fsencode(folder) + b"/" + name + f".{suffix}".encode())))
    else:
        scan = folder / f"scan.{suffix}"
    assert off_by(scan) < 0.1
    mesh = folder / f"{os.fsdecode(name)}.ply"
    command = [sys.executable, "-m", "gp_labeler", "mesh", scan, "-o", mesh, "--threshold", str(LEVEL)]
    if suffix == "nrrd":
        done = subprocess.run(command, capture_output=True, check=False)
        assert (done.returncode, done.stderr) == (0, b"")
        assert mesh.stat().st_size > 10_000
