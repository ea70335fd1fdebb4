"""The application of gp-labeler: label guinea-pig head micro-CT, check estimated cochlea poses."""

from gp_core.moved_modules import keep_importable

keep_importable(
    {
        "gp_labeler.imaging.phantom": "gp_labeler.phantom",
        "gp_labeler.imaging.phantom.phantom": "gp_labeler.phantom.phantom",
    }
)
