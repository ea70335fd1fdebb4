"""One body in every kind of image file: the same surface to 0.1 voxel, or a question that names file, tag."""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Callable
from functools import partial
from pathlib import Path

import imagecodecs
import numpy as np
import pytest
import tifffile
from bodies import LEVEL, SIZE, SPACING, affine, off_by, surface_of, voxels
from PIL import Image
from scipy.spatial import cKDTree

from gp_labeler.imaging.readers import VolumeError, inspect_volume, read_volume
from gp_labeler.imaging.volume import Volume

GRID = affine()
GRID[:3, 3] = 0  # image files have no origin
X, Y, Z = SPACING.tolist()
GIVEN = {"spacing": SPACING.tolist()}


def surface_points(volume: Volume, level: float = LEVEL) -> np.ndarray:
    return surface_of(volume, level).points.astype(float)


def body(dtype: str = "uint16") -> np.ndarray:
    return voxels(GRID, dtype)


def is_right(path: Path, level: float = LEVEL, **options: object) -> bool:
    return off_by(path, GRID, level, **options) < 0.1


Writer = Callable[[Path], object]


def tif(array: np.ndarray | None = None, **how: object) -> Writer:
    """Write all pages of the body, or of an array."""

    def write(path: Path) -> None:
        pages = body() if array is None else array
        how.setdefault("photometric", "minisblack")
        tifffile.imwrite(path, pages, **{"metadata": None, **how})

    return write


def imagej(
    unit: str = "mm", factor: float = 1.0, more: str = "", shape: str = "slices", end: str = "\n"
) -> Writer:
    """Write as ImageJ: lengths of the unit are `factor` of a mm."""
    nz = SIZE[2]
    lines = [
        "ImageJ=1.54f",
        f"images={nz}",
        f"{shape}={nz}",
        f"unit={unit}",
        more or f"spacing={Z * factor}",
        "loop=false",
        "",
    ]

    def write(path: Path) -> None:
        how = {"resolution": (1 / X / factor, 1 / Y / factor), "resolutionunit": 1}
        tifffile.imwrite(path, body(), description=end.join(lines), metadata=None, **how)

    return write


def imagej_in_one_ifd(path: Path) -> None:
    """Write one page that is followed by the values of all others."""
    values = body().astype(">u2")
    nz = SIZE[2]
    text = f"ImageJ=1.54f\nimages={nz}\nslices={nz}\nunit=mm\nspacing={Z}\n"
    with tifffile.TiffWriter(path, byteorder=">") as writer:
        writer.write(values[0], description=text, metadata=None, resolution=(1 / X, 1 / Y), photometric=1)
    with tifffile.TiffFile(path) as file:
        offset = file.pages[0].dataoffsets[0]
    path.write_bytes(path.read_bytes()[:offset] + values.tobytes())


def ome(x: float, y: float, z: float, units: tuple[str, str, str] = ("mm",) * 3) -> dict[str, object]:
    sizes = {f"PhysicalSize{axis}": size for axis, size in zip("XYZ", (x, y, z), strict=True)}
    return {"axes": "ZYX"} | sizes | {f"PhysicalSize{a}Unit": u for a, u in zip("XYZ", units, strict=True)}


def ome_file(unit: str, factor: float) -> Writer:
    return tif(ome=True, metadata=ome(X * factor, Y * factor, Z * factor, (unit,) * 3))


def ome_overview_first(path: Path, n: int = 5) -> None:
    with tifffile.TiffWriter(path, ome=True) as writer:
        small = body()[17, ::n, ::n]
        writer.write(small, metadata=ome(X * n, Y * n, 1) | {"axes": "YX", "Name": "overview"})
        writer.write(body(), metadata=ome(X, Y, Z) | {"Name": "volume"})


def ome_pyramid(path: Path) -> None:
    with tifffile.TiffWriter(path, ome=True) as writer:
        writer.write(body(), subifds=1, tile=(16, 16), metadata=ome(X, Y, Z))
        writer.write(body()[:, ::2, ::2], subfiletype=1, tile=(16, 16))


def ome_order(axes: str) -> Writer:
    """Two channels and three times: the first of both is the body, the others are not."""
    sizes = {"T": 3, "C": 2, "Z": SIZE[2]}
    stack = np.zeros([sizes[a] for a in axes[:3]] + [SIZE[1], SIZE[0]], np.uint16)
    stack[tuple(slice(None) if a == "Z" else 0 for a in axes[:3])] = body()
    return tif(stack, ome=True, metadata=ome(X, Y, Z) | {"axes": axes})


def ome_of_several_files(path: Path, lose: str = "") -> None:
    """Write each half of the slices into a file; the description of both names both."""
    nz, half = SIZE[2], SIZE[2] // 2
    names = [path.name, path.name.replace(".ome", "_b.ome")]
    data = "".join(
        f'<TiffData FirstZ="{half * n}" IFD="0" PlaneCount="{half}">'
        f'<UUID FileName="{name}">urn:uuid:{n}</UUID></TiffData>'
        for n, name in enumerate(names)
    )
    for n, name in enumerate(names):
        text = (
            '<?xml version="1.0"?><OME xmlns="http://www.openmicroscopy.org/Schemas/OME/2016-06" '
            f'UUID="urn:uuid:{n}"><Image ID="Image:0"><Pixels ID="Pixels:0" DimensionOrder="XYZCT" '
            f'Type="uint16" SizeX="{SIZE[0]}" SizeY="{SIZE[1]}" SizeZ="{nz}" SizeC="1" SizeT="1" '
            f'PhysicalSizeX="{X}" PhysicalSizeXUnit="mm" PhysicalSizeY="{Y}" PhysicalSizeYUnit="mm" '
            f'PhysicalSizeZ="{Z}" PhysicalSizeZUnit="mm"><Channel ID="Channel:0:0" SamplesPerPixel="1"/>'
            f"{data}</Pixels></Image></OME>"
        )
        if name != lose:
            pages = body()[half * n : half * (n + 1)]
            tifffile.imwrite(
                path.with_name(name), pages, description=text.encode(), metadata=None, photometric=1
            )


def ome_with_companion(path: Path, keep: bool = True) -> None:
    text = (
        '<OME xmlns="http://www.openmicroscopy.org/Schemas/OME/2016-06"><Image ID="Image:0"><Pixels ID="P:0" '
        f'DimensionOrder="XYZCT" Type="uint16" SizeX="{SIZE[0]}" SizeY="{SIZE[1]}" SizeZ="{SIZE[2]}" '
        f'SizeC="1" SizeT="1" PhysicalSizeX="{X * 1000}" PhysicalSizeY="{Y * 1000}" '
        f'PhysicalSizeZ="{Z * 1000}"/></Image></OME>'
    )
    binary = (
        '<OME xmlns="http://www.openmicroscopy.org/Schemas/OME/2016-06" UUID="urn:uuid:1">'
        '<BinaryOnly MetadataFile="a.companion.ome" UUID="urn:uuid:2"/></OME>'
    )
    if keep:
        (path.parent / "a.companion.ome").write_text(text)
    tifffile.imwrite(path, body(), description=binary, metadata=None, photometric=1)


RIGHT: dict[str, tuple[str, Writer]] = {
    "imagej um": ("a.tif", imagej("um", 1000)),
    "imagej escaped um": ("a.tif", imagej("\\u00B5m", 1000)),
    "imagej nm": ("a.tif", imagej("nm", 1e6)),
    "imagej cm": ("a.tif", imagej("cm", 0.1)),
    "imagej inch": ("a.tif", imagej("inch", 1 / 25.4)),
    "imagej Microns": ("a.tif", imagej("Microns", 1000)),
    "imagej zunit": ("a.tif", imagej("mm", 1, f"zunit=cm\nspacing={Z / 10}")),
    "imagej zunit um": ("a.tif", imagej("cm", 0.1, f"yunit=cm\nzunit=um\nspacing={Z * 1000}")),
    "imagej negative spacing": ("a.tif", imagej("mm", 1, f"spacing=-{Z}")),
    "imagej CRLF": ("a.tif", imagej(end="\r\n")),
    "imagej in one IFD": ("a.tif", imagej_in_one_ifd),
    "ome um": ("a.ome.tif", ome_file("µm", 1000)),
    "ome nm": ("a.ome.tif", ome_file("nm", 1e6)),
    "ome angstrom": ("a.ome.tif", ome_file("Å", 1e7)),
    "ome cm": ("a.ome.tif", ome_file("cm", 0.1)),
    "ome inch": ("a.ome.tif", ome_file("in", 1 / 25.4)),
    "ome foot": ("a.ome.tif", ome_file("ft", 1 / 304.8)),
    "ome point": ("a.ome.tif", ome_file("pt", 72 / 25.4)),
    "ome kilometre": ("a.ome.tif", ome_file("km", 1e-6)),
    "ome femtometre": ("a.ome.tif", ome_file("fm", 1e12)),
    "ome mixed": ("a.ome.tif", tif(ome=True, metadata=ome(X, Y * 1000, Z * 1e6, ("mm", "µm", "nm")))),
    "ome overview first": ("a.ome.tif", ome_overview_first),
    "ome pyramid": ("a.ome.tif", ome_pyramid),
    "ome TCZ": ("a.ome.tif", ome_order("TCZYX")),
    "ome CTZ": ("a.ome.tif", ome_order("CTZYX")),
    "ome ZCT": ("a.ome.tif", ome_order("ZCTYX")),
    "ome of several files": ("a.ome.tif", ome_of_several_files),
    "ome with a companion": ("a.ome.tif", ome_with_companion),
}


@pytest.mark.parametrize("name", RIGHT)
def test_files_that_say_their_voxel_size_give_the_body(name: str, tmp_path: Path) -> None:
    file, write = RIGHT[name]
    write(tmp_path / file)
    assert is_right(tmp_path / file)
    assert not inspect_volume(tmp_path / file).sides_known


def colours(planar: str) -> Writer:
    grey = np.stack([body("uint8")] * 3, axis=1 if planar == "separate" else -1)
    return tif(grey, photometric="rgb", planarconfig=planar)


def with_thumbnails(path: Path, first: bool = False) -> None:
    with tifffile.TiffWriter(path) as writer:
        for plane in body():
            kinds = [(plane, 0), (plane[::4, ::4], 1)]
            for page, kind in reversed(kinds) if first else kinds:
                writer.write(page, subfiletype=kind, metadata=None, photometric="minisblack")


CODECS = ("lzw", "deflate", "adobe_deflate", "zstd", "lzma", "packbits", "jpeg2000", "jpegxl", "png")
PACKED = {name: tif(compression=name) for name in CODECS if name != "adobe_deflate"}
PACKED |= {f"{name}, predictor": tif(compression=name, predictor=2) for name in ("lzw", "deflate", "zstd")}
PACKED |= {f"{name}, tiles": tif(compression=name, tile=(16, 32)) for name in ("lzw", "zstd")}
PACKED |= {
    "float predictor": tif(body("float32"), compression="lzw", predictor=3),
    "tiles": tif(tile=(32, 16)),
    "strips": tif(rowsperstrip=7),
    "BigTIFF": tif(bigtiff=True),
    "big-endian LZW": tif(compression="lzw", byteorder=">"),
    "volume in one page": tif(volumetric=True, tile=(16, 16, 16)),
    "thumbnails": with_thumbnails,
    "thumbnails first": partial(with_thumbnails, first=True),
}
TYPES = ("int16", "int32", "uint32", "int64", "uint64", "float16", "float32", "float64")
PACKED |= {dtype: tif(body(dtype)) for dtype in TYPES}
PACKED |= {f"{dtype} LZW": tif(body(dtype), compression="lzw") for dtype in ("int16", "uint32", "float64")}
PACKED |= {
    "white is low": tif((65535 - body()).astype(np.uint16), photometric="miniswhite"),
    "white is low, LZW": tif((65535 - body()).astype(np.uint16), photometric="miniswhite", compression="lzw"),
    "white is low, int32": tif(-1 - body("int32"), photometric="miniswhite"),
    "white is low, float": tif(-body("float32"), photometric="miniswhite"),
}


@pytest.mark.parametrize("name", PACKED)
def test_every_packing_and_type_gives_the_body(name: str, tmp_path: Path) -> None:
    path = tmp_path / "a.tif"
    PACKED[name](path)
    assert is_right(path, **GIVEN)


BYTES = {
    "uint8": tif(body("uint8")),
    "contiguous colours": colours("contig"),
    "separate colours": colours("separate"),
    "JPEG": tif(body("uint8"), compression="jpeg", compressionargs={"level": 100}),
}


@pytest.mark.parametrize("name", BYTES)
def test_eight_bits_give_the_body(name: str, tmp_path: Path) -> None:
    path = tmp_path / "a.tif"
    BYTES[name](path)
    expected = surface_points(Volume(body("uint8"), GRID), LEVEL * 250 / 1900)
    found = surface_points(read_volume(path, **GIVEN), LEVEL * 250 / 1900)
    assert cKDTree(expected).query(found)[0].max() < 0.1 * SPACING.min() * (7 if name == "JPEG" else 1)


@pytest.mark.parametrize("offset", [2.0**40, -(2.0**52), 1e15])
@pytest.mark.parametrize("dtype", ["int64", "float64"])
def test_large_values_that_differ_by_little_are_kept(dtype: str, offset: float, tmp_path: Path) -> None:
    tifffile.imwrite(
        tmp_path / "a.tif", (body(dtype) + np.array(offset, dtype)), photometric=1, metadata=None
    )
    volume = read_volume(tmp_path / "a.tif", **GIVEN)
    found = surface_points(volume, float(LEVEL + offset))
    assert cKDTree(surface_points(Volume(body(), GRID))).query(found)[0].max() < 0.1 * SPACING.min()


@pytest.mark.parametrize("kind", ["pages", "first page", "files"])
@pytest.mark.parametrize("packing", [None, "deflate", "lzw"])
@pytest.mark.parametrize("orientation", range(1, 9))
def test_orientation_is_obeyed_whatever_the_packing(
    orientation: int, packing: str | None, kind: str, tmp_path: Path
) -> None:
    """The stored rows are made from the picture as TIFF 6.0 words it, not with the code under test."""
    row_0, column_0 = {1: "tl", 2: "tr", 3: "br", 4: "bl", 5: "lt", 6: "rt", 7: "rb", 8: "lb"}[orientation]
    stored = body()
    if row_0 in "lr":  # stored rows are columns of the picture
        stored = stored.transpose(0, 2, 1)
    ends = {"t": 1, "l": 1, "b": -1, "r": -1}
    stored = np.ascontiguousarray(stored[:, :: ends[row_0], :: ends[column_0]])
    tag = [(274, 3, 1, orientation, kind == "first page")]
    how = {"compression": packing, "extratags": tag, "metadata": None, "photometric": "minisblack"}
    if kind != "files":
        path = tmp_path / "a.tif"
        tifffile.imwrite(path, stored, **how)
    else:
        path = tmp_path
        for k, plane in enumerate(stored):
            tifffile.imwrite(tmp_path / f"s{k:03d}.tif", plane, **how)
    assert is_right(path, **GIVEN)
    said = [problem.text for problem in inspect_volume(path).warnings if problem.code == "orientation"]
    assert said == (
        []
        if orientation == 1
        else [f"rows and columns are oriented as the tag Orientation ({orientation}) says"]
    )


def test_the_orientation_of_photographs_is_obeyed(tmp_path: Path) -> None:
    exif = Image.Exif()
    exif[274] = 6
    for k, plane in enumerate(body("uint8")):
        stored = Image.fromarray(np.ascontiguousarray(np.rot90(plane)))
        stored.save(tmp_path / f"s{k:03d}.jpg", quality=100, exif=exif)
    found = surface_points(read_volume(tmp_path, **GIVEN), LEVEL * 250 / 1900)
    expected = surface_points(Volume(body("uint8"), GRID), LEVEL * 250 / 1900)
    assert cKDTree(expected).query(found)[0].max() < 0.5 * SPACING.min()


SLICES: dict[str, tuple[str, Callable[[Path, np.ndarray], object]]] = {
    "png": ("png", lambda p, a: Image.fromarray(a).save(p)),
    "png, colours": ("png", lambda p, a: p.write_bytes(imagecodecs.png_encode(np.stack([a] * 3, -1)))),
    "png, alpha": (
        "png",
        lambda p, a: p.write_bytes(imagecodecs.png_encode(np.stack([a, a * 0 + 65535], -1))),
    ),
    "jp2": ("jp2", lambda p, a: p.write_bytes(imagecodecs.jpeg2k_encode(a, level=0, reversible=True))),
    "lzw": ("tif", lambda p, a: tifffile.imwrite(p, a, compression="lzw", metadata=None)),
    "zstd": ("tif", lambda p, a: tifffile.imwrite(p, a, compression="zstd", metadata=None)),
    "float16": ("tif", lambda p, a: tifffile.imwrite(p, a.astype(np.float16), metadata=None)),
}


@pytest.mark.parametrize("name", SLICES)
def test_stacks_give_the_body(name: str, tmp_path: Path) -> None:
    suffix, write = SLICES[name]
    for k, plane in enumerate(body()):
        write(tmp_path / f"s{k:03d}.{suffix}", plane)
    assert is_right(tmp_path, **GIVEN)


@pytest.mark.parametrize("n", [12, SIZE[2]])
def test_slices_with_a_thumbnail_of_their_own_are_slices(n: int, tmp_path: Path) -> None:
    for k, plane in enumerate(body()[:n]):
        with tifffile.TiffWriter(tmp_path / f"s{k:03d}.tif") as writer:
            writer.write(plane, metadata=None)
            writer.write(plane[::4, ::4], subfiletype=1, metadata=None)
    np.testing.assert_array_equal(read_volume(tmp_path, **GIVEN, accept=["extent"]).array, body()[:n])


# Questions and refusals ----------------------------------------------------------------------------


def cmyk(path: Path) -> None:
    inks = np.stack([body("uint8")] * 4, axis=-1)
    tifffile.imwrite(path, inks, photometric="separated", metadata=None)


def two_volumes(path: Path) -> None:
    with tifffile.TiffWriter(path, ome=True) as writer:
        writer.write(body(), metadata=ome(X, Y, Z) | {"Name": "left"})
        writer.write(body()[:, ::2, ::2], metadata=ome(2 * X, 2 * Y, Z) | {"Name": "right"})


def odd_page(path: Path, odd: np.ndarray) -> None:
    with tifffile.TiffWriter(path) as writer:
        for k, plane in enumerate(body()):
            writer.write(odd if k == 15 else plane, metadata=None, photometric="minisblack")


def turned_differently(path: Path) -> None:
    with tifffile.TiffWriter(path) as writer:
        for k, plane in enumerate(body()):
            tags = [(274, 3, 1, 3 if k > 20 else 1, False)]
            writer.write(plane, metadata=None, photometric="minisblack", extratags=tags)


ASKED: dict[str, tuple[str, Writer, str]] = {
    "imagej pixel": ("a.tif", imagej("pixel"), "voxel size is not in the file"),
    "imagej frames": (
        "a.tif",
        imagej(shape="frames"),
        "not the distance between slices.*--spacing 0.25",
    ),
    "imagej zunit pixel": ("a.tif", imagej("mm", 1, "zunit=pixel\nspacing=1"), "slice distance in 'pixel'"),
    "imagej no spacing": ("a.tif", imagej("mm", 1, "x=0"), "not the distance between slices"),
    "ome pixel": ("a.ome.tif", ome_file("pixel", 4), "voxel size in pixel, which is not a length"),
    "ome film": (
        "a.ome.tif",
        tif(ome=True, metadata=ome(X, Y, Z) | {"axes": "TYX"}),
        "its OME description gives pixels of .*, but not the distance",
    ),
    "ome frame": ("a.ome.tif", ome_file("reference frame", 4), "in reference frame, which is not a length"),
    "ome z in pixels": (
        "a.ome.tif",
        tif(ome=True, metadata=ome(X, Y, 1, ("mm", "mm", "pixel"))),
        "voxel size in pixel.*--spacing 0.25",
    ),
    "two volumes": (
        "a.ome.tif",
        two_volumes,
        r"holds 2 scans: left \(46 x 40 x 34\), right \(23 x 20 x 34\)",
    ),
    "lost file": (
        "a.ome.tif",
        partial(ome_of_several_files, lose="a_b.ome.tif"),
        "slices into files that are not there: a_b.ome.tif",
    ),
    "lost companion": ("a.ome.tif", partial(ome_with_companion, keep=False), "in the file a.companion.ome"),
    "inks": ("a.tif", cmyk, r"PhotometricInterpretation is SEPARATED \(5\)"),
    "page of another size": (
        "a.tif",
        lambda p: odd_page(p, body()[3, ::2]),
        r"page 16 \(46 x 20 uint16\).*--accept slice-size",
    ),
    "page of another type": (
        "a.tif",
        lambda p: odd_page(p, body("uint8")[3]),
        r"page 16 \(46 x 40 uint8\).*--accept slice-size",
    ),
    "resolution without a unit": (
        "a.tif",
        tif(resolution=(1 / X, 1 / Y), resolutionunit=1),
        "not in the file",
    ),
    "resolution in cm": (
        "a.tif",
        tif(resolution=(10 / X, 10 / Y), resolutionunit=3),
        "the resolution tag gives pixels of 0.25 mm.*--spacing 0.25",
    ),
    "resolution in inches": (
        "a.tif",
        tif(resolution=(25.4 / X, 25.4 / Y), resolutionunit=2),
        "the resolution tag gives pixels of 0.25 mm.*--spacing 0.25",
    ),
    "pages turned differently": ("a.tif", turned_differently, "pages have the tag Orientation 1, 3"),
}


@pytest.mark.parametrize("name", ASKED)
def test_what_a_file_does_not_say_is_asked_with_its_name(
    name: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    file, write, question = ASKED[name]
    write(tmp_path / file)
    with pytest.raises(VolumeError, match=rf"{file}: .*{question}") as refused:
        read_volume(tmp_path / file)
    assert refused.value.remedy
    assert "\n" not in str(refused.value)
    assert capfd.readouterr() == ("", "")


def test_a_page_that_is_odd_can_be_stood_in_for(tmp_path: Path) -> None:
    odd_page(tmp_path / "a.tif", body("uint8")[3])
    array = read_volume(tmp_path / "a.tif", **GIVEN, accept=["slice-size"]).array
    np.testing.assert_array_equal(np.delete(array, 15, axis=0), np.delete(body(), 15, axis=0))
    np.testing.assert_array_equal(array[15], body()[14])


def test_a_volume_of_several_can_be_chosen(tmp_path: Path) -> None:
    two_volumes(tmp_path / "a.ome.tif")
    assert is_right(tmp_path / "a.ome.tif", series="left")
    assert read_volume(tmp_path / "a.ome.tif", series="right").spacing == pytest.approx((0.5, 0.5, 0.3))


def test_a_slice_distance_of_files_in_steps_is_asked(tmp_path: Path) -> None:
    for k, plane in enumerate(body()):
        tifffile.imwrite(
            tmp_path / f"s{2 * k:03d}.ome.tif", plane, ome=True, metadata=ome(X, Y, Z) | {"axes": "YX"}
        )
    with pytest.raises(VolumeError, match=r"slices 0.3 mm apart, but their numbers run in steps of 2.*0.6"):
        read_volume(tmp_path)
    assert is_right(tmp_path, **GIVEN)
    assert "the numbers of the slices run in steps of 2" in read_volume(tmp_path, **GIVEN).notes


# SkyScan and Scanco --------------------------------------------------------------------------------


def skyscan(folder: Path, planes: np.ndarray, log: str, first: int = 0, step: int = 1) -> Path:
    for k, plane in enumerate(planes):
        Image.fromarray(plane).save(folder / f"head_rec{first + step * k:08d}.bmp")
    (folder / "head_rec.log").write_text(f"[Reconstruction]\n{log}Filename Prefix=head_rec\n", "latin-1")
    return folder


def said(
    first: int, last: int, step: int = 1, pixel: str = "Pixel Size (um)=250", width: int = SIZE[0]
) -> str:
    return (
        f"First Section={first}\nLast Section={last}\nSection to Section Step={step}\n"
        f"Result Image Width (pixels)={width}\n"
        f"Result Image Height (pixels)={width * SIZE[1] // SIZE[0]}\n{pixel}\n"
    )


LOGS = {
    "all sections": (said(0, 33), 0, 1, 0.25),
    "numbers from elsewhere": (said(100, 133), 100, 1, 0.25),
    "every second, by section": (said(0, 66, 2), 0, 2, 0.5),
    "every second, numbered again": (said(10, 76, 2), 0, 1, 0.5),
    "every second kept": (said(0, 66), 0, 2, 0.5),
    "micro sign": (said(0, 33, pixel="Pixel Size (µm)=250"), 0, 1, 0.25),
    "millimetres": (said(0, 33, pixel="Pixel Size (mm)=0.25"), 0, 1, 0.25),
    "image pixel size": (said(0, 33, pixel="Image Pixel Size (um)=250,0"), 0, 1, 0.25),
}


@pytest.mark.parametrize("name", LOGS)
def test_a_skyscan_log_gives_the_voxel_size(name: str, tmp_path: Path) -> None:
    log, first, step, z = LOGS[name]
    plan = inspect_volume(skyscan(tmp_path, body("uint8"), log, first, step))
    assert plan.errors == ()
    assert plan.spacing == pytest.approx((0.25, 0.25, z))


LOGS_ASKED = {
    "made smaller": (said(0, 33, width=2 * SIZE[0]), 0, 1, "92 x 80 pixels.*--spacing 0.5"),
    "some were kept, numbered again": (said(0, 66), 0, 1, "every 1. section from 0 to 66.*0.25 0.25 0.5"),
    "step against numbers": (said(0, 99, 3), 5, 2, "every 3. section from 0 to 99; there are 34.*--spacing"),
    "size of the projections": (
        said(0, 33, pixel="x=0") + "[Acquisition]\nImage Pixel Size (um)=30\n[Reconstruction]\n",
        0,
        1,
        "only that of the projections.*--spacing 0.03",
    ),
}


@pytest.mark.parametrize("name", LOGS_ASKED)
def test_a_skyscan_log_that_does_not_fit_is_asked_about(name: str, tmp_path: Path) -> None:
    log, first, step, question = LOGS_ASKED[name]
    with pytest.raises(VolumeError, match=question):
        read_volume(skyscan(tmp_path, body("uint8"), log, first, step))


@pytest.mark.parametrize("step_um", [0, 300, 301, 150])
def test_a_scanco_header_that_contradicts_itself_is_asked_about(step_um: int, tmp_path: Path) -> None:
    x, y, z = SIZE
    head = bytearray(512)
    head[:16] = b"CTDATA-HEADER_V1"
    head[44:76] = struct.pack("<8i", x, y, z, 250 * x, 250 * y, 300 * z, 300, step_um)
    (tmp_path / "a.isq").write_bytes(bytes(head) + body("int16").tobytes())
    if step_um == 150:
        with pytest.raises(VolumeError, match=r"slices 0.15 mm apart, but 34 of them in 10.2 mm.*0.15"):
            read_volume(tmp_path / "a.isq")
    else:
        assert is_right(tmp_path / "a.isq")


@pytest.mark.parametrize("packing", ["lzw", "deflate", "zstd"])
def test_each_page_is_decoded_once(packing: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Pillow walked from the first page on for each of them, which is quadratic."""
    tifffile.imwrite(tmp_path / "a.tif", body(), compression=packing, metadata=None, photometric=1)
    asked: list[int] = []
    unpacked = tifffile.TiffPage.asarray

    def counted(page: tifffile.TiffPage, **how: object) -> np.ndarray:
        asked.append(page.index)
        return unpacked(page, **how)

    monkeypatch.setattr(tifffile.TiffPage, "asarray", counted)
    read_volume(tmp_path / "a.tif", **GIVEN)
    assert sorted(asked) == list(range(SIZE[2]))


# Costs ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("size", [(1400, 1400, 1400), (100, 100, 10**6)])
def test_a_few_packed_bytes_that_claim_gigabytes_are_refused(
    size: tuple[int, int, int], tmp_path: Path
) -> None:
    packed = io.BytesIO()
    head = f"NRRD0004\ntype: uint8\ndimension: 3\nsizes: {' '.join(map(str, size))}\nspace: LPS\n"
    head += "space directions: (0.1,0,0) (0,0.1,0) (0,0,0.1)\nencoding: gzip\n\n"
    squeeze = zlib.compressobj(9, zlib.DEFLATED, 31)
    packed.write(head.encode() + squeeze.compress(bytes(50_000)) + squeeze.flush())
    (tmp_path / "bomb.nrrd").write_bytes(packed.getvalue())
    with pytest.raises(VolumeError, match=r"bomb.nrrd.* holds .* bytes.* it is incomplete"):
        read_volume(tmp_path / "bomb.nrrd", spacing=0.05)


@pytest.mark.parametrize("packing", [None, "deflate", "lzw"])
def test_a_few_bytes_that_claim_a_huge_page_are_refused(packing: str | None, tmp_path: Path) -> None:
    path = tmp_path / "bomb.tif"
    tifffile.imwrite(path, body()[:4], compression=packing, metadata=None, photometric="minisblack")
    raw = bytearray(path.read_bytes())
    for page in range(4):
        with tifffile.TiffFile(path) as file:
            for tag in ("ImageWidth", "ImageLength", "RowsPerStrip"):
                at = file.pages[page].tags[tag].valueoffset
                wide = file.pages[page].tags[tag].dtype == 4
                raw[at : at + (4 if wide else 2)] = (60_000).to_bytes(4 if wide else 2, "little")
    path.write_bytes(bytes(raw))
    with pytest.raises(
        VolumeError, match=r"bomb.tif: a page of it holds .* bytes, too few for 7,200,000,000"
    ):
        read_volume(path, spacing=0.001)
