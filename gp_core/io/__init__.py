"""Landmark files: Slicer's ``.mrk.json`` and ``.fcsv``, tables, the probe's ``.dat``, the authors' sets."""

from gp_core.io.authors_mat import import_mat, read_authors_mat
from gp_core.io.dat import skull_feature_names
from gp_core.io.fcsv import write_fcsv
from gp_core.io.file_names import landmark_file_name, natural_key
from gp_core.io.header import FileHeader
from gp_core.io.lab_names import read_lab_names
from gp_core.io.labelled_points import LabelledPoint, PointList
from gp_core.io.markups import write_markups, write_suggestions
from gp_core.io.measurement_markups import measurement_file_names, read_measurements, write_measurements
from gp_core.io.reading import (
    label_names,
    landmarks_of,
    read_landmarks,
    read_points,
    read_touches,
    sides_of,
    specimen_of,
    unknown_labels,
)
from gp_core.io.specimens import Labelling, landmark_files, load_labellings, load_specimens, mean_labels
from gp_core.io.table import write_csv

__all__ = [
    "FileHeader",
    "LabelledPoint",
    "Labelling",
    "PointList",
    "import_mat",
    "label_names",
    "landmark_file_name",
    "landmark_files",
    "landmarks_of",
    "load_labellings",
    "load_specimens",
    "mean_labels",
    "measurement_file_names",
    "natural_key",
    "read_authors_mat",
    "read_lab_names",
    "read_landmarks",
    "read_measurements",
    "read_points",
    "read_touches",
    "sides_of",
    "skull_feature_names",
    "specimen_of",
    "unknown_labels",
    "write_csv",
    "write_fcsv",
    "write_markups",
    "write_measurements",
    "write_suggestions",
]
