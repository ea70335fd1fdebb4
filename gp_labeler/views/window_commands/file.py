"""What the menu File asks: what to open and where to save, and what becomes of unsaved edits."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

from gp_core.errors import GpError
from gp_labeler.document.lock import InUseError
from gp_labeler.document.opening import UnsavedEditsError
from gp_labeler.document.specimen_file import SUFFIX
from gp_labeler.imaging.mesh_files import MESH_SUFFIXES
from gp_labeler.models.atlas import is_atlas_file
from gp_labeler.models.workspace import Workspace
from gp_labeler.views.panels.label.export_dialog import ExportDialog
from gp_labeler.views.panels.label.landmark_import_dialog import LandmarkImportDialog
from gp_labeler.views.panels.scan.specimen_list_dialog import SpecimenListDialog
from gp_labeler.views.pictures import grab, write_picture
from gp_labeler.views.prompts import Prompts
from gp_labeler.views.questions import export_asking, import_asking
from gp_labeler.views.window_commands.command import Asking, WindowCommand

if TYPE_CHECKING:
    from gp_labeler.views.main_window import MainWindow

__all__ = ["FILE_COMMANDS", "POINTS", "open_demo", "open_path", "resolve_unsaved", "save"]

_SCANS = (
    "Scans and specimens (*.nrrd *.nhdr *.mha *.mhd *.nii *.nii.gz *.tif *.tiff *.bmp *.png *.jpg *.dcm "
    "*.isq *.ISQ *.log *.gpspecimen.json);;All files (*)"
)
_SPECIMENS = f"Specimens (*{SUFFIX})"
_MESHES = "PLY (*.ply);;STL (*.stl);;VTP (*.vtp);;OBJ (*.obj);;glTF (*.glb *.gltf)"
POINTS = "Landmarks (*.mrk.json *.json *.fcsv *.csv *.dat);;All files (*)"
"""Files of landmarks, as a file dialog lists them."""


# Opening


def open_path(workspace: Workspace, prompts: Prompts, path: Path) -> None:
    """Open a scan or specimen, once unsaved edits are saved or given up; an atlas at once."""
    goes_on = is_atlas_file(path) or (workspace.document.lacks_scan and not path.name.endswith(SUFFIX))
    if not goes_on and not resolve_unsaved(workspace, prompts):
        return
    prompts.remember(path)
    try:
        workspace.open(path)
    except UnsavedEditsError as error:
        _open_unsaved(workspace, prompts, path, error)
    except InUseError as error:
        if prompts.choose("Open elsewhere", error.problem, ["Open a copy"], detail=error.remedy or ""):
            workspace.open_specimen(path, as_copy=True)
    except GpError as error:
        workspace.say(str(error), "error")


def _open_unsaved(workspace: Workspace, prompts: Prompts, path: Path, error: UnsavedEditsError) -> None:
    recover = "Recover these edits"
    answer = prompts.choose("Unsaved work was found", error.recovery.text, [recover, "Open as saved"])
    if answer:
        workspace.open_specimen(path, unsaved="recover" if answer == recover else "leave")


def begin(window: MainWindow) -> None:
    """Begin a new specimen without a scan, once unsaved edits are saved or given up."""
    if resolve_unsaved(window.workspace, window.prompts):
        window.workspace.document.begin()
        window.set_step("pose")


def open_demo(workspace: Workspace, prompts: Prompts) -> None:
    """Open the phantom, once unsaved edits are saved or given up."""
    if resolve_unsaved(workspace, prompts):
        workspace.scan.open_demo()


def ask_open_file(workspace: Workspace, prompts: Prompts) -> None:
    """Ask for a scan or specimen file, and open it."""
    for path in prompts.open_files("Open a scan or specimen", _SCANS):
        open_path(workspace, prompts, path)


def ask_open_folder(workspace: Workspace, prompts: Prompts) -> None:
    """Ask for a folder of slices, and open it."""
    path = prompts.folder("Open a folder of slices")
    if path is not None:
        open_path(workspace, prompts, path)


def ask_find_scan(workspace: Workspace, prompts: Prompts) -> None:
    """Ask where the scan of this specimen is now."""
    for path in prompts.open_files("Where is the scan now?", _SCANS):
        workspace.scan.find(path)


def show_specimens(window: MainWindow) -> None:
    """Show the list of specimens, beside the window, where it can stay open."""
    workspace = window.workspace
    dialog = window.findChild(SpecimenListDialog)
    if dialog is None:
        dialog = SpecimenListDialog(workspace, window.prompts, window)
        dialog.open_asked.connect(lambda path: open_path(workspace, window.prompts, path))
    dialog.show()
    dialog.raise_()


def open_next_specimen(workspace: Workspace, prompts: Prompts) -> None:
    """Open the next specimen of the list with something left to do."""
    open_path(workspace, prompts, workspace.specimens.next_unfinished().path)


# Saving


def save(workspace: Workspace, prompts: Prompts, *, ask: bool = False) -> bool:
    """Save the specimen, asking where it has no file yet; return whether it is saved."""
    document = workspace.document
    path: Path | None = None
    if ask or document.path is None:
        path = prompts.save_file("Save the specimen", f"{document.state.specimen}{SUFFIX}", _SPECIMENS)
        if path is None:
            return False
    try:
        saved = document.save(path, overwrite=path is not None)
    except GpError as error:
        workspace.say(str(error), "error")
        return False
    prompts.remember(saved)
    if workspace.recent is not None:
        workspace.recent.add(saved)
    workspace.say(f"Saved {saved.name}")
    return True


def resolve_unsaved(workspace: Workspace, prompts: Prompts) -> bool:
    """Ask what becomes of unsaved edits before something else is opened; return whether to go on."""
    document = workspace.document
    if not document.dirty:
        return True
    text = f"Save the changes to {document.state.specimen}?"
    detail = "Otherwise they are lost when this specimen is closed."
    answer = prompts.choose("Not saved", text, ["Save", "Do not save"], detail=detail)
    if answer == "Do not save":
        document.abandon()
        return True
    return answer == "Save" and save(workspace, prompts)


# Exchange with other programs


def ask_import(window: MainWindow) -> None:
    """Ask for landmark files, and take them over."""
    workspace, prompts = window.workspace, window.prompts
    files = prompts.open_files("Import landmarks", POINTS, many=True)
    if files and prompts.in_dialogs:
        LandmarkImportDialog(workspace, files, workspace.scan.near_bone, prompts, window).open()
    elif files:
        import_asking(workspace, files, prompts)


def ask_export(window: MainWindow) -> None:
    """Ask for a folder, and write the landmarks of both sides into it."""
    workspace, prompts = window.workspace, window.prompts
    if prompts.in_dialogs:
        ExportDialog(workspace, prompts.last_folder, parent=window).open()
        return
    folder = prompts.folder("Export landmarks into this folder")
    if folder is not None:
        export_asking(workspace, folder, prompts)


def ask_save_mesh(workspace: Workspace, prompts: Prompts) -> None:
    """Ask where, and write the bone surface."""
    name = f"{workspace.document.state.specimen}.ply"
    path = prompts.save_file("Save the bone surface", name, _MESHES)
    if path is not None and workspace.bone.surfaces:
        workspace.bone.save_mesh(path)


def ask_screenshot(window: MainWindow) -> None:
    """Ask where, and write a picture of the window."""
    workspace = window.workspace
    name = f"{workspace.document.state.specimen}.png"
    path = window.prompts.save_file("Save a picture of the window", name, "PNG (*.png)")
    if path is not None:
        write_picture(grab(window), path)
        workspace.say(f"Wrote {path.name}")
        workspace.messages.wrote.emit("picture", path)


def ask_references(workspace: Workspace, prompts: Prompts) -> None:
    """Ask for landmark lists, and show their points as reference points."""
    files = prompts.open_files("Show reference points", POINTS, many=True)
    if files:
        workspace.references.show(*files)


def ask_add_mesh(workspace: Workspace, prompts: Prompts) -> None:
    """Ask for mesh files, and draw them with the bone."""
    wanted = f"Meshes ({' '.join('*' + suffix for suffix in MESH_SUFFIXES)})"
    for path in prompts.open_files("Add a mesh", wanted, many=True):
        workspace.meshes.open(path)


FILE_COMMANDS: Mapping[str, WindowCommand] = MappingProxyType(
    {
        "file.new": begin,
        "file.open": Asking(ask_open_file),
        "file.open_folder": Asking(ask_open_folder),
        "file.demo": Asking(open_demo),
        "file.specimens": show_specimens,
        "file.next_specimen": Asking(open_next_specimen),
        "file.find_scan": Asking(ask_find_scan),
        "file.save": Asking(save),
        "file.save_as": lambda window: save(window.workspace, window.prompts, ask=True),
        "file.import": ask_import,
        "file.export": ask_export,
        "file.save_mesh": Asking(ask_save_mesh),
        "file.screenshot": ask_screenshot,
        "file.show_references": Asking(ask_references),
        "file.add_mesh": Asking(ask_add_mesh),
        "file.close": lambda window: window.close(),
    }
)
