"""
Slices in any plane
===================

A slice along the modiolar axis, as the window cuts it, drawn with Matplotlib.
"""

import matplotlib.pyplot as plt
import numpy as np

from gp_core import Side
from gp_labeler.phantom import make_phantom

phantom = make_phantom(0, spacing=0.2)
ear = phantom.specimen.side(Side.LEFT)

# %%
# The plane holds the axis CB-CA and the middle of the round window. Positions are scan millimetres, LPS.

up = (ear["CA"] - ear["CB"]) / np.linalg.norm(ear["CA"] - ear["CB"])
towards = (ear["RWA"] + ear["RWP"]) / 2 - ear["CO"]
right = towards - (towards @ up) * up
right /= np.linalg.norm(right)
steps = np.linspace(-5, 5, 300)
points = ear["CO"] + steps[None, :, None] * right + steps[::-1, None, None] * up
values = phantom.volume.values_at(points.reshape(-1, 3)).reshape(300, 300)

# %%
# Features that lie within half a millimetre of the plane are marked.

figure, axes = plt.subplots(figsize=(6, 6))
axes.imshow(values, cmap="gray", extent=(-5, 5, -5, 5))
normal = np.cross(right, up)
for code in ear.placed:
    offset = ear[code] - ear["CO"]
    x, y = offset @ right, offset @ up
    if abs(offset @ normal) < 0.5 and max(abs(x), abs(y)) < 5:
        axes.plot(x, y, "o", color="orange")
        axes.annotate(code, (x, y), xytext=(4, 4), textcoords="offset points", color="orange")
axes.set(xlabel="towards the round window, mm", ylabel="towards the apex, mm")
plt.show()
