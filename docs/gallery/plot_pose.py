"""
A pose, with and without a slipped touch
========================================

Six touches of a drawn animal, whose true cochlea is known. One touch slips by 3 mm: the robust
estimate hardly moves.
"""

import numpy as np

import gp_core
from gp_core.study.drawn_labels import draw_touches
from gp_labeler.plotting import compare

touches, truth = draw_touches(seed=3)
careful = gp_core.estimate_pose(touches, "L")
slipped = gp_core.estimate_pose(
    {**{code: touches[code] for code in touches.placed}, "OS": touches["OS"] + [0.0, 0.0, 3.0]}, "L"
)

# %%
# The error of each, mm, and what the second one suspects:

print(f"careful: {np.linalg.norm(careful.origin - truth['CO']):.2f} mm")
print(
    f"slipped: {np.linalg.norm(slipped.origin - truth['CO']):.2f} mm, suspect {', '.join(slipped.suspects)}"
)

# %%
# The legend says how far the origins and the axes lie apart.

compare({"careful": careful, "OS slipped": slipped}, window_size=(900, 640)).show()
