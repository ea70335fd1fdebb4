"""Volumes, surfaces and phantoms: SimpleITK, VTK filters and file formats; knows no Qt."""
