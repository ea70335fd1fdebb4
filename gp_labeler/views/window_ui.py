"""What actions ask of the window: files, folders, what becomes of unsaved edits, what the screen shows."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from gp_core.errors import GpError
from gp_core.landmarks.features import FEATURES, feature
from gp_core.validation import FloatArray
from gp_labeler.document.lock import InUseError
from gp_labeler.document.opening import UnsavedEditsError
from gp_labeler.document.recovery import Recovery
from gp_labeler.document.specimen_document import VolumeChangedError
from gp_labeler.document.specimen_file import SUFFIX
from gp_labeler.imaging.mesh_files import MESH_SUFFIXES
from gp_labeler.imaging.readers import ImportPlan
from gp_labeler.imaging.volume import Volume
from gp_labeler.models.atlas import is_atlas_file
from gp_labeler.models.typed_position import typed_position
from gp_labeler.models.view import CUTS
from gp_labeler.models.workspace import Workspace
from gp_labeler.views.atlas_ui import AtlasUi
from gp_labeler.views.canvas_ui import ask_canvas
from gp_labeler.views.first_labels_ui import FirstLabelsUi
from gp_labeler.views.fonts import nearest_text_size
from gp_labeler.views.measure_ui import MeasureUi
from gp_labeler.views.panels.label.export_dialog import ExportDialog
from gp_labeler.views.panels.label.labellings_dialog import LabellingsDialog
from gp_labeler.views.panels.label.landmark_import_dialog import LandmarkImportDialog
from gp_labeler.views.panels.scan.import_dialog import ImportDialog
from gp_labeler.views.panels.scan.recover_dialog import RecoverDialog
from gp_labeler.views.panels.scan.specimen_list_dialog import SpecimenListDialog
from gp_labeler.views.pictures import grab, write_picture
from gp_labeler.views.pose_ui import PoseUi
from gp_labeler.views.prompts import Prompts
from gp_labeler.views.questions import ask_about, export_asking, import_asking
from gp_labeler.views.recorder import Recorder
from gp_labeler.views.shortcuts_sheet import ShortcutsSheet
from gp_labeler.views.status_line import where_text
from gp_labeler.views.view_grid import CLOSE_MM

if TYPE_CHECKING:
    from gp_labeler.views.main_window import MainWindow

__all__ = ["WindowUi"]

_SCANS = (
    "Scans and specimens (*.nrrd *.nhdr *.mha *.mhd *.nii *.nii.gz *.tif *.tiff *.bmp *.png *.jpg *.dcm "
    "*.isq *.ISQ *.log *.gpspecimen.json);;All files (*)"
)
_POINTS = "Landmarks (*.mrk.json *.json *.fcsv *.csv *.dat);;All files (*)"
_OPEN_MM = 16.0
"""Across the 3D view once bone is cut open at a feature."""

_MESHES = "PLY (*.ply);;STL (*.stl);;VTP (*.vtp);;OBJ (*.obj);;glTF (*.glb *.gltf)"


class WindowUi(AtlasUi, PoseUi, MeasureUi, FirstLabelsUi):
    """The answers that a main window gives to actions.

    Parameters
    ----------
    window : MainWindow
        The window.
    workspace : Workspace
        What it works on.
    prompts : Prompts
        Who asks the user.
    """

    def __init__(self, window: MainWindow, workspace: Workspace, prompts: Prompts) -> None:
        self._window, self._workspace, self.prompts = window, workspace, prompts

    # Files

    def open_path(self, path: Path) -> None:
        """Open a scan or specimen, once unsaved edits are saved or given up; an atlas at once."""
        goes_on = is_atlas_file(path) or (
            self._workspace.document.lacks_scan and not path.name.endswith(SUFFIX)
        )
        if not goes_on and not self.resolve_unsaved():
            return
        self._remember_folder(path)
        try:
            self._workspace.open(path)
        except UnsavedEditsError as error:
            self._open_unsaved(path, error)
        except InUseError as error:
            if self.prompts.choose(
                "Open elsewhere", error.problem, ["Open a copy"], detail=error.remedy or ""
            ):
                self._workspace.open_specimen(path, as_copy=True)
        except GpError as error:
            self._workspace.say(str(error), "error")

    def begin(self) -> None:
        """Begin a new specimen without a scan, once unsaved edits are saved or given up."""
        if self.resolve_unsaved():
            self._workspace.document.begin()
            self._window.set_step("pose")

    def ask_open_file(self) -> None:
        """Ask for a scan or specimen file, and open it."""
        for path in self.prompts.open_files("Open a scan or specimen", self._folder, _SCANS):
            self.open_path(path)

    def ask_open_folder(self) -> None:
        """Ask for a folder of slices, and open it."""
        path = self.prompts.folder("Open a folder of slices", self._folder)
        if path is not None:
            self.open_path(path)

    def ask_find_scan(self) -> None:
        """Ask where the scan of this specimen is now."""
        for path in self.prompts.open_files("Where is the scan now?", self._folder, _SCANS):
            self._workspace.scan.find(path)

    def open_demo(self) -> None:
        """Open the phantom, once unsaved edits are saved or given up."""
        if self.resolve_unsaved():
            self._workspace.scan.open_demo()

    def save(self, *, ask: bool = False) -> bool:
        """Save the specimen, asking where it has no file yet; return whether it is saved."""
        document = self._workspace.document
        path: Path | None = None
        if ask or document.path is None:
            suggestion = Path(self._folder) / f"{document.state.specimen}{SUFFIX}"
            path = self.prompts.save_file("Save the specimen", str(suggestion), f"Specimens (*{SUFFIX})")
            if path is None:
                return False
        try:
            saved = document.save(path, overwrite=path is not None)
        except GpError as error:
            self._workspace.say(str(error), "error")
            return False
        self._remember_folder(saved)
        if self._workspace.recent is not None:
            self._workspace.recent.add(saved)
        self._workspace.say(f"Saved {saved.name}")
        return True

    def resolve_unsaved(self) -> bool:
        """Ask what becomes of unsaved edits before something else is opened; return whether to go on."""
        document = self._workspace.document
        if not document.dirty:
            return True
        text = f"Save the changes to {document.state.specimen}?"
        detail = "Otherwise they are lost when this specimen is closed."
        answer = self.prompts.choose("Not saved", text, ["Save", "Do not save"], detail=detail)
        self.discarded = answer == "Do not save"
        if self.discarded:
            self._workspace.document.abandon()
        return self.discarded or (answer == "Save" and self.save())

    discarded = False

    def ask_import(self) -> None:
        """Ask for landmark files, and take them over."""
        files = self.prompts.open_files("Import landmarks", self._folder, _POINTS, many=True)
        if files:
            self._remember_folder(files[0])
            if self._has_dialogs:
                workspace = self._workspace
                LandmarkImportDialog(
                    workspace, files, workspace.scan.near_bone, self.prompts, self._window
                ).open()
            else:
                import_asking(self._workspace, files, self.prompts)

    def ask_references(self) -> None:
        """Ask for landmark lists, and show their points as reference points."""
        files = self.prompts.open_files("Show reference points", self._folder, _POINTS, many=True)
        if files:
            self._remember_folder(files[0])
            self._workspace.references.show(*files)

    def ask_add_mesh(self) -> None:
        """Ask for mesh files, and draw them with the bone."""
        wanted = f"Meshes ({' '.join('*' + suffix for suffix in MESH_SUFFIXES)})"
        for path in self.prompts.open_files("Add a mesh", self._folder, wanted, many=True):
            self._remember_folder(path)
            self._workspace.meshes.open(path)

    def ask_export(self) -> None:
        """Ask for a folder, and write the landmarks of both sides into it."""
        if self._has_dialogs:
            ExportDialog(self._workspace, self._folder, parent=self._window).open()
            return
        folder = self.prompts.folder("Export landmarks into this folder", self._folder)
        if folder is not None:
            export_asking(self._workspace, folder, self.prompts)

    def show_specimens(self) -> None:
        """Show the list of specimens, beside the window, where it can stay open."""
        dialog = self._window.findChild(SpecimenListDialog)
        if dialog is None:
            dialog = SpecimenListDialog(self._workspace, self.prompts, self._folder, self._window)
            dialog.open_asked.connect(self.open_path)
        dialog.show()
        dialog.raise_()

    def open_next_specimen(self) -> None:
        """Open the next specimen of the list with something left to do."""
        self.open_path(self._workspace.specimens.next_unfinished().path)

    def show_labellings(self) -> None:
        """Show who labels, and all labellings of the specimen."""
        LabellingsDialog(self._workspace, self._window).open()

    def ask_save_mesh(self) -> None:
        """Ask where, and write the bone surface."""
        name = f"{self._workspace.document.state.specimen}.ply"
        path = self.prompts.save_file("Save the bone surface", str(Path(self._folder) / name), _MESHES)
        if path is not None and self._workspace.bone.surfaces:
            self._workspace.bone.save_mesh(path)

    def ask_screenshot(self) -> None:
        """Ask where, and write a picture of the window."""
        name = f"{self._workspace.document.state.specimen}.png"
        path = self.prompts.save_file(
            "Save a picture of the window", str(Path(self._folder) / name), "PNG (*.png)"
        )
        if path is None:
            return
        write_picture(grab(self._window), path)
        self._workspace.say(f"Wrote {path.name}")
        self._workspace.messages.wrote.emit("picture", path)

    # Questions of the workspace

    def take_recoveries(self, recoveries: tuple[Recovery, ...]) -> None:
        """Offer what programs that were killed left unsaved."""
        if recoveries and self._has_dialogs:
            dialog = RecoverDialog(recoveries, self._window)
            dialog.recover_asked.connect(self._workspace.document.recover)
            dialog.open()
            return
        for recovery in recoveries:
            answer = self.prompts.choose(
                "Unsaved work was found",
                recovery.text,
                ["Recover", "Later", "Delete it"],
                detail="The program ended before this was saved. Nothing is lost.",
            )
            if answer == "Recover":
                self._workspace.document.recover(recovery)
                return
            if answer == "Delete it":
                recovery.discard()

    def take_plan(self, plan: ImportPlan) -> None:
        """Ask what a scan's files do not say, then read it."""
        if self._has_dialogs:
            ImportDialog(self._workspace, plan, parent=self._window).open()
            return
        answered = ask_about(plan, self.prompts)
        if answered is not None:
            self._workspace.scan.read(answered)

    def take_other_scan(self, error: VolumeChangedError, volume: Volume) -> None:
        """Ask whether to go on with a scan that is not the one that was labelled."""
        detail = f"{'; '.join(error.differences).capitalize()}. {error.remedy or ''}"
        if self.prompts.choose(
            "Another scan?", error.problem, ["Use it anyway"], detail=detail, kind="warning"
        ):
            self._workspace.scan.accept(volume)

    def ask_swap(self) -> None:
        """Ask with which other point of the side the active one shall be exchanged."""
        active = self._workspace.labels.active
        if active.code is None:
            return
        others = [f for f in FEATURES if not (f.computed or f.shared or f.code == active.code)]
        if feature(active.code).shared:
            raise GpError(f"{active.code} is shared by both sides and cannot be exchanged")
        text = f"Exchange {active.code} {active.side.word} with"
        chosen = self.prompts.item("Exchange", text, [f"{f.code}  {f.name}" for f in others])
        if chosen:
            self._workspace.labels.swap(active.side, active.code, chosen.split()[0])

    # The screen

    def close_window(self) -> None:
        """Close the window."""
        self._window.close()

    def reset_views(self) -> None:
        """Show everything in every view."""
        self._window.grid.reset()

    def zoom_to_point(self) -> None:
        """Look closely at the chosen point, or at where it is expected."""
        workspace, active = self._workspace, self._workspace.labels.active
        if active.code is not None:
            workspace.labels.go_to(active.side, active.code)
        for view in self._window.grid.views:
            view.zoom_to(workspace.view.crosshair, CLOSE_MM)

    def look_closely(self, position: FloatArray | None) -> None:
        """Look closely at a (3,) scan position in the slices; at nothing where it is None."""
        if position is not None:
            for view in self._window.grid.slice_views.values():
                view.zoom_to(position, CLOSE_MM)

    def ask_reopen_mirrored(self) -> None:
        """Ask whether to read the scan again with its slices in reverse order, as a new specimen."""
        volume = self._workspace.scan.volume
        if volume is None or volume.path is None:
            raise GpError("only a scan in a file can be read again", remedy="Mirror it where it was made.")
        reverse = not volume.choices.get("reverse", False)
        text = "Read the scan again, mirrored?"
        detail = (
            "Its slices are taken in reverse order, which exchanges left and right. It is opened as a new "
            "specimen: labels that were placed on the mirrored head do not fit it. Positions are then those "
            "of the mirrored scan."
        )
        if self.prompts.choose("Left and right", text, ["Read it mirrored"], detail=detail) and (
            self.resolve_unsaved()
        ):
            self._workspace.scan.open(volume.path, **{**volume.choices, "reverse": reverse})

    def reset_view_here(self) -> None:
        """Show everything in the view under the pointer, and leave the others as they are."""
        grid = self._window.grid
        grid.frames[grid.name_here].view.reset()

    def ask_position(self) -> None:
        """Ask for a scan position, and bring it into every view."""
        view, volume = self._workspace.view, self._workspace.scan.volume
        here = where_text(view.crosshair).removesuffix(" mm")
        text = self.prompts.text("Go to", "Position, mm (LPS)", here)
        if text is None or volume is None:
            return
        position = typed_position(text)
        if not volume.contains(position[None])[0]:
            low, high = (where_text(corner) for corner in volume.extent)
            problem = f"{where_text(position)} lies outside the scan"
            raise GpError(problem, remedy=f"It reaches from {low} to {high}.")
        view.show_point(position)

    def cut_open(self) -> None:
        """Cut the bone open so that the active point, or where it is expected, is seen."""
        active, labels = self._workspace.labels.active, self._workspace.labels
        where = None if active.code is None else labels.place_of(active.side, active.code)
        if active.code is None or where is None:
            raise GpError(
                "the position of the feature is not known yet", remedy="Place it, or three others first."
            )
        best = feature(active.code).view.lower()
        self._window.grid.scene_view.cut_open(where, best if best in CUTS else "view", _OPEN_MM)

    def look_from(self, letter: str) -> None:
        """Look at the bone from ``A``, ``P``, ``L``, ``R``, ``S`` or ``I``."""
        self._window.grid.scene_view.view_from(letter)

    def cut(self, plane: str) -> None:
        """Cut the bone open by a plane through the crosshair."""
        self._window.grid.scene_view.cut(plane)

    def toggle_theme(self) -> None:
        """Change between dark and light."""
        self._window.set_theme("light" if self._window.theme_name == "dark" else "dark")

    def ask_canvas(self) -> None:
        """Ask which canvas the 3D view shall have from the next start on."""
        ask_canvas(self._window, self.prompts)

    def change_text_size(self, step: int) -> None:
        """Draw text larger (1) or smaller (-1), or as large as the desktop's (0)."""
        size = nearest_text_size(self._window.text_size, step=step) if step else 100
        self._window.set_text_size(size)

    def toggle_projection(self) -> None:
        """Change between parallel and perspective."""
        view = self._window.grid.scene_view
        view.scene.camera.parallel = not view.scene.camera.parallel
        view.redraw()

    def show_shortcuts(self) -> None:
        """Show what keys and mouse do."""
        ShortcutsSheet(self._window).open()

    def toggle_recording(self) -> None:
        """Begin to write down what is done, or ask where to, and write it."""
        recorder = self._window.findChild(Recorder)
        if recorder is None:
            Recorder(self._window)
            self._workspace.say("Recording. Choose Help > Record script once more to end it.")
            return
        path = self.prompts.save_file(
            "Save the script", str(Path(self._folder) / "script.toml"), "Scripts (*.toml *.json)"
        )
        if path is not None:
            recorder.save(path)
            self._workspace.say(f"Wrote {path.name}, {len(recorder.tables)} steps")
        recorder.setParent(None)
        recorder.deleteLater()

    def show_about(self) -> None:
        """Say what this program is."""
        from gp_labeler.document.specimen_file import application

        self.prompts.tell(
            "About gp-labeler",
            f"{application()}\n\nLabels guinea-pig heads in micro-CT, and estimates the pose of the cochlea "
            "from a few touched points.\n\nCoordinates are LPS, mm. No usage data are collected.",
        )

    @property
    def _has_dialogs(self) -> bool:
        """Whether a person answers, in dialogs that show more than a question; scripts are asked in words."""
        return isinstance(self.prompts, Prompts)

    def _open_unsaved(self, path: Path, error: UnsavedEditsError) -> None:
        answer = self.prompts.choose(
            "Unsaved work was found", error.recovery.text, ["Recover these edits", "Open as saved"]
        )
        if answer:
            self._workspace.open_specimen(
                path, unsaved="recover" if answer.startswith("Recover") else "leave"
            )
