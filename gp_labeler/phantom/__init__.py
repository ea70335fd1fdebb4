"""Synthetic guinea-pig head scans with their truth: the demo, the tutorial, and the test scans."""

from gp_labeler.phantom.files import save_phantom, write_phantom
from gp_labeler.phantom.phantom import Phantom, make_phantom
from gp_labeler.phantom.variation import SWITCHES, USUAL, HeadVariation

__all__ = ["SWITCHES", "USUAL", "HeadVariation", "Phantom", "make_phantom", "save_phantom", "write_phantom"]
