"""What one window works on: the document, the models of scan, bone, labels, atlas, pose, tracker, and jobs.

It knows no Qt and draws nothing. The window, the offscreen script and plain Python all drive it, on one
thread; results of long work come back through the dispatcher it was given.
"""

from __future__ import annotations

from os import PathLike
from pathlib import Path
from typing import Any

from gp_core.atlas.atlas import Atlas
from gp_core.errors import GpError
from gp_labeler.document.atlas_memory import AtlasMemory
from gp_labeler.document.labelling_edits import BeginLabelling, NameObserver, OpenLabelling
from gp_labeler.document.labelling_error_memory import LabellingErrorMemory
from gp_labeler.document.observer_memory import ObserverMemory
from gp_labeler.document.recent_files import RecentFiles
from gp_labeler.document.specimen_document import SpecimenDocument
from gp_labeler.document.specimen_file import SUFFIX
from gp_labeler.imaging.thumbnail import thumbnail
from gp_labeler.jobs.runner import Dispatcher, Jobs, Task
from gp_labeler.models.added_meshes import AddedMeshesModel
from gp_labeler.models.anatomical_planes import AnatomicalPlanesModel
from gp_labeler.models.atlas import AtlasModel, is_atlas_file
from gp_labeler.models.bone import BoneModel
from gp_labeler.models.first_labels import FirstLabelsModel
from gp_labeler.models.head import HeadModel
from gp_labeler.models.interaction import InteractionModel
from gp_labeler.models.labels import LabelsModel
from gp_labeler.models.measure import MeasureModel
from gp_labeler.models.messages import Messages
from gp_labeler.models.pose import PoseModel
from gp_labeler.models.reference_points import ReferencePointsModel
from gp_labeler.models.reliability import ReliabilityModel
from gp_labeler.models.scan import ScanModel
from gp_labeler.models.specimen_list import SpecimenListModel
from gp_labeler.models.suggestion_pages import SuggestionPagesModel
from gp_labeler.models.tracker import TrackerModel
from gp_labeler.models.view import ViewModel

__all__ = ["Workspace"]


class Workspace:
    """The document and all models, put together; see the module.

    Parameters
    ----------
    directory : Path, optional
        State directory; None keeps no journal, no list of recent files, and does not remember the atlas.
    dispatcher : callable, optional
        Brings results of jobs to this thread.
    atlas : Atlas, optional
        Behind ghosts, problems and poses; by default the one chosen last, loaded as a job by `atlas.load`.
    author : str, optional
        Who labels; by default who said so before, as the state directory remembers it.
    """

    def __init__(
        self,
        directory: Path | None = None,
        dispatcher: Dispatcher | None = None,
        *,
        atlas: Atlas | None = None,
        author: str | None = None,
    ) -> None:
        self.directory = directory
        self.recent = RecentFiles(directory) if directory else None
        self.jobs, self.messages = Jobs(dispatcher), Messages()
        self._observers = ObserverMemory(directory) if directory else None
        if author is None and self._observers is not None:
            author = self._observers.recall()
        self.document = document = SpecimenDocument(directory=directory, author=author)
        document.loaded.connect(self._on_loaded)
        self.jobs.failed.connect(self._on_failed)
        jobs, messages = self.jobs, self.messages
        self.view = ViewModel(document)
        self.scan = ScanModel(document, self.view, jobs, messages, self.recent)
        memory = AtlasMemory(directory) if directory else None
        errors = LabellingErrorMemory(directory) if directory else None
        self.atlas = AtlasModel(document, jobs, messages, memory, atlas, errors)
        self.labels = LabelsModel(document, self.view, self.scan, self.atlas, jobs, messages)
        self.interaction = InteractionModel(document, self.labels, self.view, messages)
        self.measure = MeasureModel(document, self.interaction, self.labels, self.view, messages)
        self.bone = BoneModel(document, self.scan, self.labels, jobs, messages)
        self.head = HeadModel(document, self.view, self.scan, jobs, messages)
        self.first_labels = FirstLabelsModel(
            document, self.scan, self.labels, self.head, self.atlas, jobs, messages, directory
        )
        self.pages = SuggestionPagesModel(document, self.view, self.scan, self.labels, jobs, messages)
        document.picture = self._thumbnail
        self.pose = PoseModel(document, self.atlas, self.view, jobs, messages)
        self.planes = AnatomicalPlanesModel(self.labels, self.pose, self.view)
        self.tracker = TrackerModel(document, self.pose, messages)
        self.references = ReferencePointsModel(document, self.scan, messages)
        self.reliability = ReliabilityModel(document, self.atlas, self.references, jobs, messages)
        self.specimens = SpecimenListModel(document, self.atlas, jobs, messages, directory)
        self.meshes = AddedMeshesModel(document, self.scan, jobs, messages)

    def open(self, path: str | PathLike[str], **options: Any) -> None:
        """Open a specimen file, an atlas file, or a scan as a new specimen."""
        if Path(path).name.endswith(SUFFIX):
            self.open_specimen(path)
        elif is_atlas_file(path):
            self.atlas.open(path)
        else:
            self.scan.open(path, **options)

    def open_specimen(
        self, path: str | PathLike[str], *, unsaved: str = "ask", as_copy: bool = False
    ) -> None:
        """Open a specimen file, and its scan; see `open_specimen` for arguments and errors."""
        self.document.open(path, unsaved=unsaved, as_copy=as_copy)
        if self.recent is not None:
            self.recent.add(path)

    def set_observer(self, name: str) -> None:
        """Take down who labels, from now on and at the next start; raises `GpError` for an empty name.

        A labelling that has no observer yet is theirs.
        """
        if not name.strip():
            raise GpError("the observer needs a name or initials", remedy="For example AB.")
        self.document.author = name
        if self._observers is not None:
            self._observers.remember(self.document.author)
        if self.document.state.landmarks and not self.document.state.labeller:
            self.document.do(NameObserver(self.document.author))

    def label_again(self, observer: str = "", *, blind: bool = True) -> None:
        """Begin another labelling of the specimen, with the views as they are for a new one.

        Parameters
        ----------
        observer : str
            Who labels; by default the one who labels now.
        blind : bool
            Whether the observer shall not go back to the other labellings by undo.
        """
        who = observer or self.document.author
        if observer and observer != self.document.author:
            self.set_observer(observer)
        if self.document.do(BeginLabelling(who, blind=blind)):
            self._forget_where()

    def open_labelling(self, observer: str, number: int) -> None:
        """Take up a labelling of the specimen that was made before."""
        self.document.do(OpenLabelling(observer, number))

    def _forget_where(self) -> None:
        """Put the crosshair into the middle of the scan: where it was tells where a point was."""
        self.references.clear()
        volume = self.scan.volume
        if volume is not None:
            self.view.set_crosshair(volume.extent.mean(axis=0))
        self.view.reset_asked.emit()

    def _thumbnail(self) -> bytes | None:
        """Draw the small picture for lists of specimens; none before bone is there."""
        return thumbnail(self.bone.surfaces)

    def begin_labelling(self) -> None:
        """Let a click place points; who labels shall not see where an estimate wants the cochlea."""
        self.pose.draw(visible=False)
        self.interaction.begin_labelling()

    def begin_looking(self) -> None:
        """Let clicks look, not place."""
        self.interaction.begin_looking()

    def begin_judging(self) -> None:
        """Show the estimate, and let no click that is meant to look at it move a landmark."""
        self.pose.prepare()
        self.pose.draw(visible=True)
        self.interaction.begin_looking(keep_touching=True)

    def say(self, text: str, level: str = "info") -> None:
        """Tell the user something."""
        self.messages.say(text, level)

    def close(self, *, discard: bool = False) -> None:
        """Stop all work and release journal and locks; see `SpecimenDocument.close`."""
        self.jobs.close()
        self.tracker.close()
        self.document.close(discard=discard)
        self.labels.release()
        self.bone.release()

    def _on_loaded(self, notices: tuple[str, ...]) -> None:
        for text in notices:
            self.say(text, "warning")

    def _on_failed(self, task: Task[Any]) -> None:
        self.say(task.message, "error")
