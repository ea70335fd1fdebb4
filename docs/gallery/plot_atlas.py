"""
The published atlas
===================

The mean of every feature, and the region in which 95 % of animals have it.
"""

import gp_core
from gp_labeler.plotting import plot

atlas = gp_core.Atlas.published()
plot(atlas, window_size=(900, 640)).show()

# %%
# A notebook shows an atlas, a pose and a specimen as tables, too.

atlas
