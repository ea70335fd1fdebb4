"""What the parts of `WindowUi` share: window, workspace, who asks, and where files were opened last."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from gp_labeler.models.workspace import Workspace
from gp_labeler.views.prompts import Prompts

if TYPE_CHECKING:
    from gp_labeler.views.main_window import MainWindow

__all__ = ["UiPart"]


class UiPart:
    """One family of answers that a main window gives to actions."""

    _window: MainWindow
    _workspace: Workspace
    prompts: Prompts

    def open_path(self, path: Path) -> None:
        """Open a scan, specimen or atlas; `WindowUi` does."""
        raise NotImplementedError

    @property
    def _folder(self) -> str:
        return self._window.memory.get("folder", str, str(Path.home()))  # type: ignore[no-any-return]

    def _remember_folder(self, path: Path) -> None:
        self._window.memory.set(folder=str(Path(path).absolute().parent))
