"""Steps on all specimens of some folders: listing them, contact sheets."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import ClassVar

from gp_core.disk import write_text
from gp_core.errors import GpError
from gp_labeler.document.specimen_file import SUFFIX
from gp_labeler.document.specimen_list import specimen_files
from gp_labeler.scripting.step import Step
from gp_labeler.scripting.window_driver import WindowDriver

__all__ = ["ContactSheet", "ListFolders"]


@dataclass(frozen=True)
class ListFolders(Step):
    """List the specimens of folders, in the window's list.

    Parameters
    ----------
    folders : text or texts
        Folders, searched with the folders in them, or specimen files; by default the open specimen.
    path : str, optional
        Where to write the list, JSON.
    """

    do: ClassVar[str] = "list"
    folders: tuple[str, ...] = ()
    path: str | None = None

    def run(self, driver: WindowDriver) -> str:  # noqa: D102
        model = driver.workspace.specimens
        model.add(*([driver.to_read(each) for each in self.folders] or [driver.saved_specimen()]))
        driver.wait_until_idle()
        if self.path is not None:
            file = driver.to_write(self.path)
            write_text(file, json.dumps([row.as_dict() for row in model.every], indent=1) + "\n")
            driver.wrote(file)
        return model.text


@dataclass(frozen=True)
class ContactSheet(Step):
    """Make contact sheets as PDF: of specimen files, or of the specimen that is open.

    Parameters
    ----------
    specimens : text or texts
        Specimen files, or folders of them; by default the open specimen, as it is saved.
    path : str
        A ``.pdf`` file for all, or a folder for one file each.
    all_labellings : bool
        Whether each labelling has its pages, not only the one in work.
    """

    do: ClassVar[str] = "contact_sheet"
    specimens: tuple[str, ...] = ()
    path: str = "contact.pdf"
    all_labellings: bool = False

    def run(self, driver: WindowDriver) -> str:  # noqa: D102
        workspace = driver.workspace
        places = [driver.to_read(each) for each in self.specimens] or [driver.saved_specimen()]
        files = specimen_files(places)
        if not files:
            raise GpError(f"contact_sheet: there are no specimens (*{SUFFIX})")
        where = driver.to_write(self.path)
        workspace.specimens.make_contact_sheets_of(files, where, all_labellings=self.all_labellings)
        driver.wait_until_idle()
        made = [where] if where.suffix.lower() == ".pdf" else sorted(where.glob("*_contact.pdf"))
        driver.wrote(*[file for file in made if file.exists()])
        return f"{len(files)} specimen{'' if len(files) == 1 else 's'}"
