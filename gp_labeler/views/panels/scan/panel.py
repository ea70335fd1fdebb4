"""The panel of the step Scan: the scan, its window and level, where bone begins, and its mesh."""

from __future__ import annotations

from qtpy.QtCore import Qt
from qtpy.QtWidgets import QVBoxLayout, QWidget

from gp_labeler.imaging.volume import Volume
from gp_labeler.models.workspace import Workspace
from gp_labeler.views.formatting import TIMES, bytes_text, sentence, size_text, spacing_text
from gp_labeler.views.layouts import in_column
from gp_labeler.views.panels.action_button import Actions
from gp_labeler.views.panels.parts import Card, Facts, Notice, emptied, scrolled, text_label
from gp_labeler.views.panels.scan.bone_card import BoneCard
from gp_labeler.views.panels.scan.head_card import HeadCard
from gp_labeler.views.panels.scan.mesh_card import MeshCard
from gp_labeler.views.panels.scan.notes_card import NotesCard
from gp_labeler.views.panels.scan.slab_card import SlabCard
from gp_labeler.views.panels.scan.window_level_card import WindowLevelCard
from gp_labeler.views.signals import follow

__all__ = ["ScanPanel", "facts_of"]

_N_NOTES = 6
_NONE = "Open a scan: a file, a folder of slices or a DICOM folder."


class ScanPanel(QWidget):
    """Shows the scan.

    Parameters
    ----------
    workspace : Workspace
        Whose scan it shows.
    actions : mapping of str to QAction
        What its buttons do.
    """

    def __init__(self, workspace: Workspace, actions: Actions, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._workspace = workspace
        self.setAttribute(Qt.WidgetAttribute.WA_StyledBackground)
        self.setProperty("role", "panel")
        self.facts = Facts()
        self._notes = QVBoxLayout()
        self._notes.setSpacing(6)
        self._empty = text_label("", "hint", wrap=True)
        about = Card("Scan")
        about.add(self._empty)
        about.add(self.facts)
        about.add(self._notes)
        self.grey, self.bone, self.mesh = (
            WindowLevelCard(workspace),
            BoneCard(workspace),
            MeshCard(workspace, actions),
        )
        content = QWidget()
        content.setProperty("role", "panel")
        column = QVBoxLayout(content)
        column.setContentsMargins(4, 8, 8, 8)
        column.setSpacing(6)
        self.notes, self.head = NotesCard(workspace), HeadCard(workspace, actions)
        self.slab = SlabCard(workspace)
        for card in (about, self.bone, self.head, self.grey, self.slab, self.mesh, self.notes):
            column.addWidget(card)
        column.addStretch(1)
        in_column(scrolled(content), margins=0, of=self)
        self.setFocusProxy(self.bone.slider)
        follow(self, workspace.scan.opened, self._refresh)
        follow(self, workspace.document.reset, self._refresh)
        self._refresh()

    def _refresh(self, *_: object) -> None:
        volume = self._workspace.scan.volume
        self._empty.setVisible(volume is None)
        lost = self._workspace.document.volume_is_lost
        self._empty.setText("The scan was not found. Locate it with File > Find scan." if lost else _NONE)
        self.facts.setVisible(volume is not None)
        self.facts.show_facts({} if volume is None else facts_of(volume))
        emptied(self._notes)
        notes = () if volume is None else volume.notes
        for note in notes[:_N_NOTES]:
            self._notes.addWidget(Notice("info", sentence(note)))
        if len(notes) > _N_NOTES:
            more = "\n".join(notes[_N_NOTES:])
            rest = text_label(f"and {len(notes) - _N_NOTES} more notes", "hint")
            rest.setToolTip(more)
            self._notes.addWidget(rest)


def facts_of(volume: Volume) -> dict[str, str]:
    """Return what there is to know about a scan, as names and words."""
    lengths = TIMES.join(f"{n * s:.1f}" for n, s in zip(volume.size, volume.spacing, strict=True))
    place = "its file" if volume.voxels.in_file else "memory"
    facts = {
        "Name": volume.name,
        "Voxels": f"{size_text(volume.size)} of {spacing_text(volume.spacing)}",
        "Size": f"{lengths} mm",
        "Values": f"{volume.dtype}, {bytes_text(volume.voxels.nbytes)} in {place}",
        "Axes": _axes(volume),
    }
    if volume.path is not None:
        facts["File"] = str(volume.path.name)
    return facts


def _axes(volume: Volume) -> str:
    """Say where the axes of the grid point, such as ``x to L, y to P, z to S``."""
    words, oblique = [], False
    for name, column in zip("xyz", volume.direction.T, strict=True):
        row = int(abs(column).argmax())
        words.append(f"{name} to {'LPS'[row] if column[row] > 0 else 'RAI'[row]}")
        oblique = oblique or abs(column[row]) < 0.999
    return ", ".join(words) + (" (oblique)" if oblique else "")
