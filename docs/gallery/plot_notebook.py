"""
In a notebook
=============

``plot`` returns a pyvista plotter. The Jupyter backend decides what ``show`` does in a notebook: a picture
(``static``), or a view to turn with the mouse (``trame``: ``pip install "pyvista[jupyter]"``).
"""

import pyvista as pv

import gp_core
from gp_labeler.plotting import plot

# %%
# A picture. It works everywhere, also in an exported notebook.

pv.set_jupyter_backend("static")
plot(gp_core.Atlas.published(), window_size=(900, 640)).show()

# %%
# A view to turn with the mouse: in Jupyter, replace ``static`` by ``trame``. For someone without Python,
# write it as a page that needs only a browser:

# plot(gp_core.Atlas.published()).export_html("atlas.html")
