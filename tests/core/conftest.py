"""Puts the helpers of this folder, such as `atlas_cases`, within reach of all tests of `gp_core`."""
