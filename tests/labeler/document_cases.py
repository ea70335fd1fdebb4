"""Shared by the tests of the session: random edits, a scan that is none, an atlas of four lines."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from gp_core.atlas.atlas import Atlas
from gp_core.atlas.label_check import check_side
from gp_core.frames import RigidTransform
from gp_core.landmarks.features import CODES, FEATURES, Side
from gp_core.landmarks.measurements import Measurement
from gp_core.landmarks.sets import LandmarkSet
from gp_core.landmarks.suggestion import Suggestion
from gp_labeler.document.edits import (
    AnnotatePoint,
    CheckPoint,
    ClearPoint,
    ConfirmPoint,
    LockPoints,
    MarkUnseen,
    PlacePoint,
    SuggestPoints,
    SwapPoints,
    SwapSides,
)
from gp_labeler.document.head_edits import ClearHeadFrame, ConfirmLeft, SetHeadFrame
from gp_labeler.document.head_frame import FOUND_BY, HeadFrame
from gp_labeler.document.labelling_edits import BeginLabelling, NameObserver, OpenLabelling
from gp_labeler.document.landmark_import import ImportLandmarks
from gp_labeler.document.measurement_edits import (
    AddMeasurements,
    MoveMeasurement,
    RemoveMeasurements,
    RenameMeasurement,
)
from gp_labeler.document.opening import new_specimen
from gp_labeler.document.page_confirmation import ConfirmPage
from gp_labeler.document.specimen_document import SpecimenDocument, utc_now
from gp_labeler.document.specimen_edits import RecordPoseCheck, RenameSpecimen, SetNotes, SetThreshold
from gp_labeler.document.specimen_json import document_of
from gp_labeler.document.state import How, PoseCheck, Provenance, SpecimenState
from gp_labeler.document.touch_edits import (
    LeaveOutTouch,
    MoveTouches,
    RecordTouch,
    RemoveTouches,
    SetSkull,
    SwapTouches,
    TakeTouches,
)
from gp_labeler.document.touches import Touch, TouchHow
from gp_labeler.jobs.runner import Jobs
from gp_labeler.models.atlas import AtlasModel
from gp_labeler.models.labels import LabelsModel
from gp_labeler.models.messages import Messages
from gp_labeler.models.pose import PoseModel
from gp_labeler.models.scan import ScanModel
from gp_labeler.models.view import ViewModel

PLACEABLE = tuple(f.code for f in FEATURES if not f.computed)
quick = settings(
    deadline=None, max_examples=40, derandomize=True, suppress_health_check=[HealthCheck.too_slow]
)
MARK = Provenance(How.MESH, "2026-01-01T00:00:00+00:00", "AB", (0.1, 0.1, 0.2))


@dataclass(frozen=True)
class FakeVolume:
    """A scan by its attributes only."""

    name: str = "GP-014"
    size: tuple[int, int, int] = (40, 50, 60)
    spacing: tuple[float, float, float] = (0.1, 0.1, 0.2)
    checksum: str = "abc"
    path: Path | None = None

    def contains(self, points):
        return (np.abs(points) < 50).all(axis=1)


class IdleJobs(Jobs):
    """Does none of the work it is given: what comes of it is asked for by the tests."""

    def submit(self, job, done=None, *, key="", after=0.0):
        return None


class Editing:
    """A document with the models of its labels and its pose, and nothing in the background."""

    def __init__(
        self,
        specimen=None,
        *,
        directory=None,
        predict=None,
        check=None,
        author="",
        clock=utc_now,
        atlas=None,
        animals=(),
    ) -> None:
        self.document = document = SpecimenDocument(directory=directory, author=author, clock=clock)
        jobs, self.messages = IdleJobs(), Messages()
        self.view = ViewModel(document)
        scan = ScanModel(document, self.view, jobs, self.messages)
        self.atlas = AtlasModel(document, jobs, self.messages)
        self.labels = LabelsModel(document, self.view, scan, self.atlas, jobs, self.messages)
        self.pose = PoseModel(document, self.atlas, self.view, jobs, self.messages)
        if atlas is not None:
            self.atlas.use(atlas, animals)
        if predict or check:
            self.labels.expect(predict, check)
        self.notices = getattr(specimen, "notices", ())
        begun = new_specimen(directory) if specimen is None else specimen
        document.load(new_specimen(directory, specimen=begun) if isinstance(begun, str) else begun)

    def close(self) -> None:
        self.document.close()


def shape(side: Side = Side.LEFT) -> LandmarkSet:
    """An animal that never was: 19 features within some millimetres; right is left, mirrored."""
    rng = np.random.default_rng(7)
    rows = rng.normal(size=(len(CODES), 3)) * 5 + [20, 0, 0]
    rows[CODES.index("IN"), 0] = 0.0
    if side is Side.RIGHT:
        rows[:, 0] *= -1
    points = dict(zip(CODES, rows, strict=True))
    return LandmarkSet.from_mapping({code: points[code] for code in PLACEABLE}, side)


def predict(landmarks: LandmarkSet):
    """An atlas that knows `shape` moved by the mean offset of the given points."""
    mean = shape(landmarks.side)
    offset = (landmarks.array(landmarks.placed) - mean.array(landmarks.placed)).mean(axis=0)
    return {code: (mean[code] + offset, np.eye(3) * 0.04) for code in PLACEABLE}


def atlas_of_shape() -> Atlas:
    """The same animal as an atlas."""
    side = shape()
    spread = np.eye(3 * len(PLACEABLE)) * 0.04
    return Atlas("shape", PLACEABLE, side.array(PLACEABLE), spread, spread, 22)


check = partial(check_side, atlas=atlas_of_shape())
"""Finds a problem with what is not where `shape` has it."""


def text_of(state: SpecimenState) -> str:
    """The state to the last bit, as text."""
    return json.dumps(document_of(state), sort_keys=True)


def are_apart(points) -> bool:
    """Whether no point lies where the next one does."""
    return bool((np.linalg.norm(np.diff(np.array(points), axis=0), axis=1) > 1e-6).all())


def head_frame(turn=(10.0, -20.0, 35.0), origin=(1.0, 2.0, 3.0), found_by="symmetry", confirmed=False):
    """A head that is turned by three angles (x, y, z; degrees) about a place in its scan."""
    R = Rotation.from_euler("xyz", turn, degrees=True).as_matrix()
    pose = RigidTransform.from_parts(R.T, -R.T @ np.array(origin), dst="head", src="scan")
    return HeadFrame(HeadFrame.of(pose).matrix, found_by, left_confirmed=confirmed)


coordinates = st.floats(-1e4, 1e4, allow_nan=False, width=64)
positions = st.tuples(coordinates, coordinates, coordinates)
sides = st.sampled_from(Side)
codes = st.sampled_from(PLACEABLE)
few_codes = st.sampled_from(("CA", "CB", "IN", "RWA", "RWP", "ZL"))
"""Few, so that edits meet."""

provenances = st.builds(
    Provenance,
    st.sampled_from(How),
    st.text(max_size=5),
    st.text(max_size=5),
    st.none() | st.tuples(*[st.floats(1e-3, 1.0)] * 3),
    st.text(max_size=5),
)
names = st.from_regex(r"[A-Za-z][A-Za-z0-9 _.\-]{0,8}", fullmatch=True)
json_values = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-9, 9)
    | st.floats(allow_nan=False, allow_infinity=False)
    | st.text(max_size=4),
    lambda inner: st.lists(inner, max_size=2) | st.dictionaries(st.text(max_size=3), inner, max_size=2),
    max_leaves=5,
)
pose_checks = st.builds(
    PoseCheck,
    sides,
    st.sampled_from(("accept", "reject")),
    st.text(max_size=3),
    st.text(max_size=3),
    st.text(max_size=9),
    st.dictionaries(st.text(max_size=3), json_values, max_size=2),
)


suggestions = st.builds(
    Suggestion,
    positions,
    st.none() | st.floats(1e-3, 1e3),
    st.sampled_from(("", "atlas", "mirror")),
    doubtful=st.booleans(),
)


@st.composite
def landmark_sets(draw, side: Side):
    points = draw(st.dictionaries(few_codes, positions, max_size=4))
    unseen = draw(st.sets(few_codes, max_size=2))
    landmarks = LandmarkSet.from_mapping(points, side)
    for code in sorted(unseen - set(points)):
        landmarks = landmarks.with_unseen(code)
    suggested = draw(st.dictionaries(few_codes, suggestions, max_size=2))
    return landmarks.with_suggestions(suggested)


touches = st.builds(
    Touch,
    positions,
    st.sampled_from([how for how in TouchHow if how is not TouchHow.SCAN]),
    st.text(max_size=5),
    st.text(max_size=5),
    st.text(max_size=5),
    left_out=st.booleans(),
)
tracked = st.builds(
    Touch, positions, st.just(TouchHow.TRACKED), n_samples=st.integers(2, 99), spread_mm=st.floats(0, 1)
)
touched_names = st.sampled_from(("MN", "LLI", "IN", "S1"))
measurement_names = st.sampled_from(("Ruler 1", "Angle 1", "bulla, width"))
measured_points = st.lists(positions, min_size=2, max_size=3, unique=True).filter(are_apart).map(tuple)
measurements = st.builds(Measurement, measurement_names, measured_points)

observers = st.sampled_from(("AB", "CD"))
certainties = st.none() | st.sampled_from(("sure", "fair", "guess", ""))

head_frames = st.builds(
    head_frame, st.tuples(*[st.floats(-180, 180)] * 3), positions, st.sampled_from(FOUND_BY), st.booleans()
)

edits = st.one_of(
    st.builds(PlacePoint, sides, few_codes, positions, provenances),
    st.builds(PlacePoint, sides, few_codes, positions, provenances, st.just("nudge")),
    st.builds(SuggestPoints, sides, st.dictionaries(few_codes, suggestions, max_size=3), provenances),
    st.builds(ConfirmPoint, sides, few_codes, provenances),
    st.builds(
        ConfirmPage, st.lists(st.tuples(sides, few_codes), min_size=1, max_size=3).map(tuple), provenances
    ),
    st.builds(ClearPoint, sides, few_codes),
    st.builds(MarkUnseen, sides, few_codes, st.none() | provenances),
    st.builds(CheckPoint, sides, few_codes, st.booleans()),
    st.builds(
        LockPoints, st.lists(st.tuples(sides, few_codes), min_size=1, max_size=3).map(tuple), st.booleans()
    ),
    st.builds(SwapPoints, sides, few_codes, few_codes),
    st.builds(SwapSides),
    st.builds(
        ImportLandmarks,
        st.one_of(*[landmark_sets(side).map(lambda one: (one,)) for side in Side]),
        provenances,
        st.none(),
        st.booleans(),
    ),
    st.builds(AnnotatePoint, sides, few_codes, certainties, st.none() | st.text(max_size=9)),
    st.builds(BeginLabelling, observers, st.none() | st.integers(1, 3), st.just(False)),
    st.builds(OpenLabelling, observers, st.integers(1, 2)),
    st.builds(NameObserver, observers),
    st.builds(SetThreshold, st.floats(-1e5, 1e5)),
    st.builds(SetNotes, st.text(max_size=20)),
    st.builds(RenameSpecimen, names),
    st.builds(SetHeadFrame, head_frames),
    st.builds(ClearHeadFrame),
    st.builds(ConfirmLeft),
    st.builds(RecordPoseCheck, pose_checks),
    st.builds(RecordTouch, sides, touched_names, touches | tracked),
    st.builds(TakeTouches, sides, st.dictionaries(touched_names, touches, max_size=3)),
    st.builds(RemoveTouches, sides, st.none() | touched_names),
    st.builds(LeaveOutTouch, sides, touched_names, st.booleans()),
    st.builds(SwapTouches, sides, touched_names, touched_names),
    st.builds(MoveTouches, sides),
    st.builds(SetSkull, st.dictionaries(st.sampled_from(("S1", "S2")), positions, max_size=2)),
    st.builds(AddMeasurements, st.lists(measurements, max_size=2).map(tuple)),
    st.builds(MoveMeasurement, measurement_names, measured_points),
    st.builds(RenameMeasurement, measurement_names, measurement_names),
    st.builds(RemoveMeasurements, st.lists(measurement_names, max_size=2).map(tuple)),
)
