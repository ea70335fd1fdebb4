"""Landmark files: Slicer's ``.mrk.json`` and ``.fcsv``, tables, the probe's ``.dat``, the authors' sets."""

from gp_core.disk import write_text
from gp_core.landmarks.files.dat import skull_feature_names
from gp_core.landmarks.files.fcsv import write_fcsv
from gp_core.landmarks.files.header import FileHeader
from gp_core.landmarks.files.lab_names import read_lab_names
from gp_core.landmarks.files.markups import write_markups, write_suggestions
from gp_core.landmarks.files.mat import import_mat, read_authors_mat
from gp_core.landmarks.files.naming import landmark_file_name, natural_key
from gp_core.landmarks.files.points import LabelledPoint, PointList
from gp_core.landmarks.files.reading import (
    label_names,
    landmarks_of,
    read_landmarks,
    read_points,
    read_touches,
    sides_of,
    specimen_of,
    unknown_labels,
)
from gp_core.landmarks.files.scale import check_plausible_size
from gp_core.landmarks.files.specimens import landmark_files, load_specimens
from gp_core.landmarks.files.table import write_csv

__all__ = [
    "FileHeader",
    "LabelledPoint",
    "PointList",
    "check_plausible_size",
    "import_mat",
    "label_names",
    "landmark_file_name",
    "landmark_files",
    "landmarks_of",
    "load_specimens",
    "natural_key",
    "read_authors_mat",
    "read_lab_names",
    "read_landmarks",
    "read_points",
    "read_touches",
    "sides_of",
    "skull_feature_names",
    "specimen_of",
    "unknown_labels",
    "write_csv",
    "write_fcsv",
    "write_markups",
    "write_suggestions",
    "write_text",
]
