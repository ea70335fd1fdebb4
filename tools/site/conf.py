"""Configuration of the site for Sphinx, which tools/site/build runs."""

import os
import sys
from pathlib import Path

import gp_core

sys.path.insert(0, str(Path(__file__).resolve().parent))
from generate import REPOSITORY

project = "gp-labeler"
author = "gp-labeler developers"
copyright = author
release = version = gp_core.__version__
extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx_copybutton",
    "sphinxcontrib.mermaid",
    "sphinx_gallery.gen_gallery",
]
source_suffix = {".md": "markdown", ".rst": "restructuredtext"}
sphinx_gallery_conf = {
    "examples_dirs": "gallery",
    "gallery_dirs": "auto_gallery",
    "filename_pattern": r"/plot_",
    "image_scrapers": ("pyvista", "matplotlib"),
    "abort_on_example_error": True,
    "show_memory": False,
    "plot_gallery": os.environ.get("GALLERY") == "1",  # tools/site/build --gallery runs the scripts
    "remove_config_comments": True,
}
exclude_patterns = ["gallery/*"]
nitpicky = False
suppress_warnings = [
    "ref.python"
]  # `array` in a docstring is NumPy's, though some of our classes have one too
default_role = "code"
myst_enable_extensions = ["attrs_inline", "colon_fence", "deflist"]
myst_heading_anchors = 4
myst_fence_as_directive = ["mermaid"]
napoleon_google_docstring = False
napoleon_use_rtype = False
napoleon_use_ivar = True
napoleon_custom_sections = [("Yields", "returns_style")]
autodoc_default_options = {"members": True, "member-order": "bysource", "show-inheritance": False}
autodoc_typehints = "none"
autodoc_class_signature = "mixed"
copybutton_prompt_text = r"\$ |>>> |\.\.\. "
copybutton_prompt_is_regexp = True
html_theme = "furo"
html_title = "gp-labeler"
html_logo = html_favicon = "../../resources/icons/gp-labeler.svg"
html_static_path = []
html_show_sphinx = False
html_theme_options = {
    "source_repository": REPOSITORY,
    "source_branch": "main",
    "source_directory": "docs/",
}
