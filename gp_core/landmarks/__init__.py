"""Landmarks: the feature table, labelled sets, what is computed from them, and their files."""
