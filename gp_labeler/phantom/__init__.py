"""A synthetic guinea-pig head scan: the demo, the tutorial and the test scan."""

from gp_labeler.phantom.phantom import Phantom, make_phantom, write_phantom

__all__ = ["Phantom", "make_phantom", "write_phantom"]
