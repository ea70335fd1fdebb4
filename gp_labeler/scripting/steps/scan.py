"""Steps on the scan: open, spacing, threshold, mesh."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from gp_core.errors import GpError
from gp_labeler.document.specimen_file import SUFFIX
from gp_labeler.document.volume_reference import VolumeReference
from gp_labeler.imaging.readers import inspect_volume
from gp_labeler.scripting.step import Ranges, Step, Triple
from gp_labeler.scripting.window_driver import WindowDriver

__all__ = ["Mesh", "Open", "Spacing", "Threshold"]


@dataclass(frozen=True)
class Open(Step):
    """Open a scan, a folder of slices, a specimen file, or the phantom.

    Parameters
    ----------
    path : str, optional
        The file or folder.
    phantom : int, optional
        Seed of the phantom to open instead.
    empty : bool
        Begin a specimen without a scan instead, such as one that is only touched.
    spacing : float or three, optional
        Voxel size, mm: of the scan where its file does not say, or of the phantom.
    series : str, optional
        Which scan of several.
    channel : int, optional
        Which colour, from 0; without it colours become luminance.
    reverse : bool
        Whether the slices run the other way.
    stride : int
        Keep every n-th voxel along each axis.
    region : three pairs of int, optional
        Voxels to keep along i, j, k: from the first up to, but without, the second.
    accept : text or texts
        Codes of problems that are knowingly accepted.
    labels : str, optional
        A specimen file whose labels, notes and threshold go onto the scan.
    discard : bool
        Drop edits of what was open that no step saved.
    """

    do: ClassVar[str] = "open"
    says: ClassVar[tuple[str, ...]] = ("path", "phantom")
    path: str | None = None
    phantom: int | None = None
    empty: bool = False
    spacing: float | Triple | None = None
    series: str | None = None
    channel: int | None = None
    reverse: bool = False
    stride: int = 1
    region: Ranges | None = None
    accept: tuple[str, ...] = ()
    labels: str | None = None
    discard: bool = False

    def run(self, driver: WindowDriver) -> str:  # noqa: D102
        if [self.path is not None, self.phantom is not None, self.empty].count(True) != 1:
            raise GpError("open needs a path, phantom = a seed, or empty = true: one of them")
        if driver.workspace.document.dirty and not self.discard:
            raise GpError(
                "the open specimen has unsaved edits",
                remedy="Add a save step before it, or give discard = true.",
            )
        driver.workspace.document.abandon()
        if self.empty:
            return self._begin(driver)
        if self.phantom is not None:
            driver.workspace.scan.open_demo(
                self.phantom, self.spacing if isinstance(self.spacing, float) else 0.2
            )
        else:
            self._open(driver, driver.to_read(self.path or ""))
        driver.wait_until_idle()
        volume = driver.workspace.scan.volume
        if volume is None:
            raise GpError(driver.trouble(0) or "no scan was opened")
        if self.labels is not None:
            _take_labels(driver, driver.to_read(self.labels))
        return f"{volume.name}, {' x '.join(str(n) for n in volume.size)} voxels"

    def _begin(self, driver: WindowDriver) -> str:
        if self.labels is None:
            driver.workspace.document.begin()
        else:
            driver.workspace.open_specimen(driver.to_read(self.labels))
        driver.wait_until_idle()
        return f"{driver.workspace.document.state.specimen}, without a scan"

    def _open(self, driver: WindowDriver, path: Path) -> None:
        if not path.exists():
            raise GpError("does not exist", file=path, remedy="Paths of inputs are relative to the script.")
        if path.name.endswith(SUFFIX):
            driver.workspace.open_specimen(path)
            return
        plan = inspect_volume(path, **self._options(driver))
        if plan.errors:
            text = " ".join(f"{problem.text}. {problem.remedy} [{problem.code}]" for problem in plan.errors)
            raise GpError(text, file=path)
        for problem in plan.problems:
            driver.workspace.say(problem.text, "warning")
        driver.workspace.scan.read(plan)

    def _options(self, driver: WindowDriver) -> dict[str, Any]:
        spacing = driver.spacing if self.spacing is None else self.spacing
        names = ("series", "channel", "reverse", "stride", "region", "accept")
        options: dict[str, Any] = {name: getattr(self, name) for name in names}
        return options if spacing is None else options | {"spacing": spacing}


def _take_labels(driver: WindowDriver, file: Path) -> None:
    """Lay what a specimen file holds onto the scan that is open, wherever that scan was then."""
    workspace, truth, since = driver.workspace, driver.workspace.scan.truth, len(driver.messages)
    volume = workspace.scan.volume
    assert volume is not None
    workspace.open_specimen(file)
    workspace.jobs.cancel("open")  # the scan need not be read once more
    del driver.messages[since:]
    reference = workspace.document.state.volume
    if reference is not None and (differences := reference.differences(VolumeReference.of(volume))):
        raise GpError(f"belongs to another scan: {'; '.join(differences)}", file=file)
    workspace.scan.accept(volume)
    workspace.scan.truth = truth
    driver.wait_until_idle()


@dataclass(frozen=True)
class Spacing(Step):
    """Say the voxel size of the scans that are opened from now on.

    Parameters
    ----------
    mm : float or three
        Along x, y and z.
    """

    do: ClassVar[str] = "spacing"
    says: ClassVar[tuple[str, ...]] = ("mm",)
    mm: float | Triple

    def run(self, driver: WindowDriver) -> None:  # noqa: D102
        driver.spacing = self.mm


@dataclass(frozen=True)
class Threshold(Step):
    """Set the grey value at which bone begins, and mesh again.

    Parameters
    ----------
    value : float
        The grey value.
    """

    do: ClassVar[str] = "threshold"
    says: ClassVar[tuple[str, ...]] = ("value",)
    value: float

    def run(self, driver: WindowDriver) -> None:  # noqa: D102
        _ = driver.voxel  # a scan must be there
        driver.workspace.scan.set_threshold(self.value)
        driver.wait_until_idle()


@dataclass(frozen=True)
class Mesh(Step):
    """Mesh the ears at full resolution, and write the bone where asked.

    Parameters
    ----------
    half_mm : float, optional
        Half the edge of the boxes around the ears.
    save : str, optional
        File for the whole surface at full resolution: .ply, .stl, .vtp, .obj, .gltf or .glb.
    """

    do: ClassVar[str] = "mesh"
    half_mm: float | None = None
    save: str | None = None

    def run(self, driver: WindowDriver) -> str:  # noqa: D102
        _ = driver.voxel
        driver.workspace.bone.mesh_ears(self.half_mm)
        if self.save is not None:
            file = driver.to_write(self.save)
            driver.workspace.bone.save_mesh(file)
            driver.wrote(file)
        driver.wait_until_idle()
        return f"{sum(part.n_triangles for part in driver.workspace.bone.surfaces)} triangles"
