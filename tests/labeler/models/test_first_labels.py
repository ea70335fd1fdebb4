"""Suggestions from labelled scans reach the document off the user's thread, and are never taken as labels."""

import multiprocessing
import os
import threading
import time
from types import SimpleNamespace

import numpy as np
import pytest
from small_heads import TURN, save_markups, save_volume, small_head

from gp_core.atlas.atlas import Atlas
from gp_core.errors import GpError
from gp_core.frames import RigidTransform
from gp_core.landmarks.features import Side
from gp_labeler.autolabel import Guess, Proposal
from gp_labeler.autolabel.registration_process import ProcessRegistration
from gp_labeler.commands.actions import ACTIONS
from gp_labeler.document.head_edits import SetHeadFrame
from gp_labeler.document.head_frame import HeadFrame
from gp_labeler.head_pose.result import HeadPoseError
from gp_labeler.imaging.progress import Cancelled
from gp_labeler.jobs.first_labels import SuggestFromScans
from gp_labeler.jobs.runner import Progress, QueueDispatcher
from gp_labeler.models.workflow import Active
from gp_labeler.models.workspace import Workspace


@pytest.fixture(scope="module")
def labelled(tmp_path_factory):
    folder = tmp_path_factory.mktemp("labelled")
    volume, points = small_head(0)
    save_volume(folder / "small-0.nrrd", volume)
    for side in "LR":
        own = {name.removesuffix(f"_{side}"): xyz for name, xyz in points.items() if name[-1] in (side, "N")}
        save_markups(folder / f"small-0_{side}.mrk.json", own)
    return folder


@pytest.fixture
def workspace(tmp_path):
    calls = QueueDispatcher()
    made = Workspace(tmp_path / "state", calls, author="AB")
    made.scan.begin(small_head(7, turn=TURN)[0])
    calls.deliver_until_idle(made.jobs)
    yield made, calls
    made.close(discard=True)


def test_suggestions_arrive_the_least_certain_first_and_placed_points_stay(workspace, labelled, monkeypatch):
    def refuse(volume, **options):
        raise HeadPoseError("no symmetry")

    monkeypatch.setattr("gp_labeler.head_pose.straighten", refuse)
    made, calls = workspace
    truth = small_head(7, turn=TURN)[1]
    assert not made.first_labels.knows_left
    made.labels.place(truth["OI_L"], side="L", code="OI")
    assert made.first_labels.knows_left
    said = []
    made.messages.said.connect(lambda text, level: said.append(text))
    made.first_labels.suggest([labelled])
    assert made.first_labels.is_running
    calls.deliver_until_idle(made.jobs)
    assert not made.first_labels.is_running
    left, right = (made.document.landmarks(side) for side in Side)
    assert left.placed == ("OI",)
    assert set(left.suggested) == {"IN", "CA", "RWA"}
    assert set(right.suggested) == {"CA", "RWA", "OI", "ZL", "IN"}
    assert right.suggested["CA"].position == pytest.approx(truth["CA_R"], abs=1.5)
    assert made.labels.active != Active(Side.LEFT, "OI")
    assert any("points suggested from 1 labelled scan" in text for text in said)
    assert made.head.frame is None  # it is no failure that the views stay as they are
    made.document.undo()
    made.document.undo()
    assert not made.document.landmarks(Side.RIGHT).suggested


def test_the_atlas_in_use_is_asked_and_what_it_contradicts_is_looked_at_first(
    workspace, labelled, monkeypatch
):
    made, calls = workspace
    atlas, asked = Atlas.published(), []
    made.atlas.use(atlas)

    def told(volume, library, **options):
        asked.append(options["atlas"])
        guesses = [
            Guess("CA_L", np.zeros(3), 0.9, 0.1, 0.1, 3),
            Guess("OI_L", np.ones(3), 0.3, 0.1, 0.1, 3, is_doubtful=True, atlas_distance=1.4),
        ]
        return Proposal(tuple(guesses), ("CA_L", "OI_L"), (), ("a", "b", "c"), 0.3, "greedy", "confirmed")

    monkeypatch.setattr("gp_labeler.autolabel.propose", told)
    monkeypatch.setattr("gp_labeler.head_pose.straighten", lambda volume, **options: None)
    said = []
    made.messages.said.connect(lambda text, level: said.append(text))
    made.first_labels.suggest([labelled])
    calls.deliver_until_idle(made.jobs)
    assert asked == [atlas]
    assert made.first_labels.labelled == (labelled,)  # offered again for the next head
    assert made.document.landmarks(Side.LEFT).suggested["OI"].atlas_distance == 1.4
    assert made.labels.active == Active(Side.LEFT, "OI")
    assert any("look closely at OI left" in text for text in said)


def test_it_is_stopped_within_two_seconds_while_images_are_registered(labelled, tmp_path):
    job = SuggestFromScans(small_head(7)[0], (labelled,), tmp_path)
    stopped = []

    def report(fraction, text):
        if fraction > 0.2 and not stopped:  # the pose is found: the other process is at work
            stopped.append(time.monotonic())
            progress.cancel()

    progress = Progress(report)
    with pytest.raises(Cancelled):
        job.run(progress)
    assert time.monotonic() - stopped[0] < 2.0


def test_it_is_stopped_while_the_other_process_still_starts(monkeypatch):
    """Images are sent once it listens: sending more than a pipe holds would wait for it."""

    held: list[int] = []
    stopped = []

    class Silent:
        Pipe = staticmethod(multiprocessing.Pipe)

        def Process(self, target, args, daemon):  # noqa: N802 - as a context has it
            held.append(os.dup(args[0].fileno()))  # open, and nobody reads
            return SimpleNamespace(start=int, terminate=int, join=int)

    monkeypatch.setattr("gp_labeler.autolabel.registration_process.worker_context", Silent)
    image = np.zeros((60, 60, 60), np.float32)

    def register():
        with pytest.raises(Cancelled):
            ProcessRegistration("greedy").register(image, image, 1.0, "1", cancel=lambda: True)
        stopped.append(True)

    thread = threading.Thread(target=register, daemon=True)
    thread.start()
    thread.join(5.0)
    assert stopped
    os.close(held[0])


def test_a_process_that_cannot_be_started_is_said_in_one_line(monkeypatch):
    def refuse():
        raise OSError("too many processes")

    class Full:
        Pipe = staticmethod(multiprocessing.Pipe)

        def Process(self, target, args, daemon):  # noqa: N802 - as a context has it
            return SimpleNamespace(start=refuse)

    monkeypatch.setattr("gp_labeler.autolabel.registration_process.worker_context", Full)
    image = np.zeros((20, 20, 20), np.float32)
    with ProcessRegistration("greedy") as registration, pytest.raises(GpError, match="Free some memory"):
        registration.register(image, image, 1.0, "1")


def test_what_cannot_be_suggested_is_said(workspace, tmp_path):
    made, calls = workspace
    failed = []
    made.jobs.failed.connect(lambda task: failed.append(task.message))
    made.first_labels.suggest([tmp_path / "nothing"])
    calls.deliver_until_idle(made.jobs)
    assert "does not exist" in failed[0]
    with pytest.raises(GpError, match="Open one first"):
        Workspace().first_labels.suggest([tmp_path])
    assert ACTIONS["point.suggest_like"].enabled(made)
    assert not ACTIONS["point.suggest_like"].enabled(Workspace())


def test_left_is_not_asked_again_once_it_was_said_for_the_suggestions(workspace):
    made, _ = workspace
    made.document.do(SetHeadFrame(HeadFrame.of(RigidTransform(np.eye(4), dst="head", src="scan"))))
    made.first_labels.suggest(["none"])
    assert made.head.asks_left
    made.first_labels.suggest(["none"], left_confirmed=True)
    assert not made.head.asks_left
