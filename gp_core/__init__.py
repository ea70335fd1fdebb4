"""The atlas core of gp-labeler: landmarks of guinea-pig heads, and the pose of a cochlea from a few touches.

Lengths are mm, angles radians, points (N, 3) rows; ``T_dst_src`` maps frame `src` to frame `dst`.

Examples
--------
>>> import gp_core
>>> atlas = gp_core.Atlas.published()
>>> touched = {code: atlas[code] for code in ("CL", "LLI", "MN", "OS", "RWA", "RWP")}
>>> gp_core.estimate_pose(touched, "L", atlas).suspects
()
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from gp_core.atlas.atlas import Atlas
from gp_core.atlas.fitting import fit_atlas
from gp_core.atlas.label_check import Deviation, Finding, SideCheck, check_side, check_specimen
from gp_core.atlas.labelling_error import LabellingError
from gp_core.atlas.prediction import predict
from gp_core.errors import GpError
from gp_core.frames import RigidTransform
from gp_core.io import (
    Labelling,
    import_mat,
    load_labellings,
    load_specimens,
    read_landmarks,
    read_measurements,
    read_touches,
    write_markups,
    write_measurements,
    write_suggestions,
)
from gp_core.io.pose_json import read_pose
from gp_core.landmarks.features import CODES, EXTERNAL, FEATURES, PROBE, RECOMMENDED, TRAINING, Feature, Side
from gp_core.landmarks.measurements import Measurement
from gp_core.landmarks.scan_evidence import ScanEvidence
from gp_core.landmarks.sets import LandmarkSet, Specimen, Status
from gp_core.landmarks.suggestion import Suggestion
from gp_core.moved_modules import keep_importable
from gp_core.pose.both_ears import (
    EarCheck,
    EarComparison,
    MirrorPlane,
    check_ears,
    compare_ears,
    fuse_ears,
    mirror_plane,
)
from gp_core.pose.cochlea_pose import CochleaPose
from gp_core.pose.estimate import estimate_again, estimate_pose
from gp_core.pose.estimate_inputs import EstimateInputs
from gp_core.pose.gate import GateReason, PoseGate
from gp_core.pose.hypothesis_check import read_as
from gp_core.pose.insertion_path import carry_path, read_path
from gp_core.pose.mixture import Hypothesis
from gp_core.pose.next_touch import TouchGain, gains
from gp_core.pose.quality import PoseQuality, pose_quality
from gp_core.pose.skull_link import SkullLink
from gp_core.registration.fiducials import register_fiducials
from gp_core.registration.jrmpc import JrmpcResult, JrmpcSettings, jrmpc
from gp_core.registration.pivot import PivotCalibration, calibrate_pivot
from gp_core.registration.result import RegistrationResult

if TYPE_CHECKING:
    from gp_core.study.compare import ComparisonReport, compare
    from gp_core.study.conditions import ConditionsReport, conditions, touch_conditions
    from gp_core.study.distance_check import DistanceCheck, PairDistance, check_distances
    from gp_core.study.distances import DistanceTable, distances
    from gp_core.study.leave_one_out import LeaveOneOutReport, leave_one_out
    from gp_core.study.nested_search import NestedReport, nested_search
    from gp_core.study.physical import PhysicalReport, physical_test
    from gp_core.study.reliability import ReliabilityReport, reliability
    from gp_core.study.simulation import SimulationReport, simulate
    from gp_core.study.subset_search import SearchReport, search_features

__version__ = "0.1.0"

FiducialRegistration = RegistrationResult
"""Earlier name of `RegistrationResult`."""

Departure = Deviation
"""Earlier name of `Deviation`."""

_OF_STUDIES = {
    "ComparisonReport": "gp_core.study.compare",
    "ConditionsReport": "gp_core.study.conditions",
    "DistanceCheck": "gp_core.study.distance_check",
    "DistanceTable": "gp_core.study.distances",
    "LeaveOneOutReport": "gp_core.study.leave_one_out",
    "NestedReport": "gp_core.study.nested_search",
    "PairDistance": "gp_core.study.distance_check",
    "PhysicalReport": "gp_core.study.physical",
    "ReliabilityReport": "gp_core.study.reliability",
    "SearchReport": "gp_core.study.subset_search",
    "SimulationReport": "gp_core.study.simulation",
    "check_distances": "gp_core.study.distance_check",
    "compare": "gp_core.study.compare",
    "conditions": "gp_core.study.conditions",
    "distances": "gp_core.study.distances",
    "leave_one_out": "gp_core.study.leave_one_out",
    "nested_search": "gp_core.study.nested_search",
    "physical_test": "gp_core.study.physical",
    "reliability": "gp_core.study.reliability",
    "search_features": "gp_core.study.subset_search",
    "simulate": "gp_core.study.simulation",
    "touch_conditions": "gp_core.study.conditions",
}
"""The module of each name that is imported at its first use: most programs run no study."""

MOVED_MODULES = {
    "gp_core.atlas.draw": "gp_core.atlas.sampling",
    "gp_core.atlas.expected": "gp_core.pose.expected_landmarks",
    "gp_core.atlas.insertion": "gp_core.pose.insertion_path",
    "gp_core.atlas.named_fit": "gp_core.registration.named_points",
    "gp_core.atlas.next_touch": "gp_core.pose.next_touch",
    "gp_core.atlas.pose": "gp_core.pose.cochlea_pose",
    "gp_core.atlas.pose_files": "gp_core.io.pose_json",
    "gp_core.atlas.quality": "gp_core.atlas.label_check",
    "gp_core.atlas.shape": "gp_core.atlas.prediction",
    "gp_core.checks": "gp_core.validation",
    "gp_core.landmarks.files": "gp_core.io",
    "gp_core.landmarks.files.dat": "gp_core.io.dat",
    "gp_core.landmarks.files.fcsv": "gp_core.io.fcsv",
    "gp_core.landmarks.files.header": "gp_core.io.header",
    "gp_core.landmarks.files.markups": "gp_core.io.markups",
    "gp_core.landmarks.files.mat": "gp_core.io.authors_mat",
    "gp_core.landmarks.files.points": "gp_core.io.labelled_points",
    "gp_core.landmarks.files.reading": "gp_core.io.reading",
    "gp_core.landmarks.files.specimens": "gp_core.io.specimens",
    "gp_core.landmarks.files.table": "gp_core.io.table",
    "gp_core.registration.stl": "gp_core.io.stl",
    "gp_core.registration.targets": "gp_core.registration.icp_targets",
    "gp_core.study.elimination": "gp_core.study.backward_elimination",
    "gp_core.study.nested": "gp_core.study.nested_search",
    "gp_core.study.skull_registration": "gp_core.registration.skull",
}
"""Modules of version 0.1.0's predecessors that scripts of labs import; see docs/api-stability.md."""

keep_importable(MOVED_MODULES)

__all__ = [
    "CODES",
    "EXTERNAL",
    "FEATURES",
    "PROBE",
    "RECOMMENDED",
    "TRAINING",
    "Atlas",
    "CochleaPose",
    "ComparisonReport",
    "ConditionsReport",
    "Departure",
    "Deviation",
    "DistanceCheck",
    "DistanceTable",
    "EarCheck",
    "EarComparison",
    "EstimateInputs",
    "Feature",
    "FiducialRegistration",
    "Finding",
    "GateReason",
    "GpError",
    "Hypothesis",
    "JrmpcResult",
    "JrmpcSettings",
    "Labelling",
    "LabellingError",
    "LandmarkSet",
    "LeaveOneOutReport",
    "Measurement",
    "MirrorPlane",
    "NestedReport",
    "PairDistance",
    "PhysicalReport",
    "PivotCalibration",
    "PoseGate",
    "PoseQuality",
    "RegistrationResult",
    "ReliabilityReport",
    "RigidTransform",
    "ScanEvidence",
    "SearchReport",
    "Side",
    "SideCheck",
    "SimulationReport",
    "SkullLink",
    "Specimen",
    "Status",
    "Suggestion",
    "TouchGain",
    "__version__",
    "calibrate_pivot",
    "carry_path",
    "check_distances",
    "check_ears",
    "check_side",
    "check_specimen",
    "compare",
    "compare_ears",
    "conditions",
    "distances",
    "estimate_again",
    "estimate_pose",
    "fit_atlas",
    "fuse_ears",
    "gains",
    "import_mat",
    "jrmpc",
    "leave_one_out",
    "load_labellings",
    "load_specimens",
    "mirror_plane",
    "nested_search",
    "physical_test",
    "pose_quality",
    "predict",
    "read_as",
    "read_landmarks",
    "read_measurements",
    "read_path",
    "read_pose",
    "read_touches",
    "register_fiducials",
    "reliability",
    "search_features",
    "simulate",
    "touch_conditions",
    "write_markups",
    "write_measurements",
    "write_suggestions",
]

if not TYPE_CHECKING:  # type checkers know all names, and no others

    def __getattr__(name: str) -> Any:
        """Import what belongs to studies when it is first asked for."""
        if name not in _OF_STUDIES:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        globals()[name] = found = getattr(import_module(_OF_STUDIES[name]), name)
        return found

    def __dir__() -> list[str]:
        """Return all names, those that are not imported yet, too."""
        return sorted({*globals(), *__all__})
