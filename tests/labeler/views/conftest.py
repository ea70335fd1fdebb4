"""A workspace with a scan, and a widget that dialogs open over."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from panel_cases import workspace_with_scan
from qtpy.QtWidgets import QWidget

from gp_labeler.models.workspace import Workspace
from gp_labeler.views.theme import DARK, apply_theme


@pytest.fixture
def workspace() -> Iterator[Workspace]:
    workspace = workspace_with_scan()
    yield workspace
    workspace.close(discard=True)


@pytest.fixture
def parent(qtbot) -> QWidget:
    parent = QWidget()
    apply_theme(parent, DARK)
    qtbot.addWidget(parent)
    return parent
