"""What the metadata of the distribution says of addresses: all of them follow from two in pyproject.toml.

Hatchling runs it for every wheel and sdist. The README gets links that also work on a package index.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from hatchling.metadata.plugin.interface import MetadataHookInterface

PAPER = "https://doi.org/10.1097/MAO.0000000000003250"
_PICTURE = re.compile(r"!\[([^\]]*)\]\((?!https?:)([^)]+)\)")
_LINK = re.compile(r"(?<!!)\[([^\]]*)\]\((?!https?:|#)([^)]+)\)")


class AddressHook(MetadataHookInterface):
    """Fills in the addresses of the project, and the README with absolute links."""

    PLUGIN_NAME = "custom"

    def update(self, metadata: dict[str, Any]) -> None:
        """Add `urls` and `readme`."""
        repository, site = self.config["repository"], self.config["site"]
        metadata["urls"] = {
            "Homepage": repository,
            "Documentation": site,
            "Source": repository,
            "Issues": f"{repository}/issues",
            "Changelog": f"{repository}/blob/main/CHANGELOG.md",
            "Paper": PAPER,
        }
        text = (Path(self.root) / "README.md").read_text(encoding="utf-8")
        metadata["readme"] = {"content-type": "text/markdown", "text": absolute(text, repository)}


def absolute(text: str, repository: str) -> str:
    """Return a page with absolute links to files of the repository, and to pictures as they are kept."""
    text = _PICTURE.sub(rf"![\1]({repository}/raw/main/\2)", text)
    return _LINK.sub(rf"[\1]({repository}/blob/main/\2)", text)
