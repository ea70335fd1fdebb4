"""
A labelled head
===============

The synthetic head, its bone surface and its true landmarks, drawn with pyvista.
"""

from gp_labeler.imaging.surface import extract_isosurface
from gp_labeler.imaging.threshold import propose_threshold
from gp_labeler.phantom import make_phantom
from gp_labeler.plotting import plot

# %%
# A coarse head is enough for a picture. Its truth is known: ``phantom.specimen`` holds the landmarks of
# both sides.

phantom = make_phantom(0, spacing=0.3)
threshold = propose_threshold(phantom.volume)
skull = extract_isosurface(phantom.volume, threshold)

# %%
# Bone is translucent, so that the landmarks inside are seen.

plotter = plot(phantom.specimen, over=skull, window_size=(900, 640))
plotter.show()
