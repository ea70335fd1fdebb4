"""Volumes, surfaces and phantoms: SimpleITK, VTK filters and file formats; knows no Qt."""

from gp_core.moved_modules import keep_importable

keep_importable(
    {
        "gp_labeler.imaging.phantom": "gp_labeler.phantom",
        "gp_labeler.imaging.phantom.phantom": "gp_labeler.phantom.phantom",
    }
)
