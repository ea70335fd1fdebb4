"""Landmarks: the feature table, labelled sets, and what is computed from them."""
