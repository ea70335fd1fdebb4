"""Whether touches lie in one frame: by segments, and by features that are touched again."""

from __future__ import annotations

from gp_labeler.tracker import FrameCheck, RepeatedTouch

_PLACES = {"CL": (0.0, 0.0, 0.0), "OS": (10.0, 0.0, 0.0), "MN": (0.0, 20.0, 0.0)}
_Place = tuple[float, float, float]


class _Touches:
    """Touches by name, and what is known of their frame."""

    def __init__(self, *names: str, segment: tuple[int, int] = (1, 0)) -> None:
        self.check = FrameCheck()
        self.places: dict[str, _Place] = {}
        for name in names:
            self.check.follow(segment)
            assert self.touch(name, segment) is None

    def touch(self, name: str, segment: tuple[int, int], off: float = 0.0) -> RepeatedTouch | None:
        """Touch a feature, that many mm beside its place, in the place of the touch before."""
        x, y, z = _PLACES[name]
        before, self.places[name] = self.places.get(name), (x + off, y, z)
        return self.check.record(name, self.places[name], segment, before, "later")

    @property
    def doubtful(self) -> list[str]:
        return [name for name, place in self.places.items() if self.check.is_doubtful(place)]


def test_touches_without_a_jump_between_them_are_in_one_frame() -> None:
    assert _Touches("CL", "OS", "MN").doubtful == []


def test_after_a_jump_earlier_touches_are_doubtful_until_it_is_taken_back() -> None:
    touches = _Touches("CL", "OS")
    touches.check.follow((1, 1))
    assert touches.doubtful == ["CL", "OS"]
    touches.check.follow((1, 0))
    assert touches.doubtful == []


def test_a_touch_made_during_a_jump_is_doubtful_once_it_is_taken_back() -> None:
    touches = _Touches("CL")
    touches.touch("OS", (1, 1))
    assert touches.doubtful == ["CL"]
    touches.check.follow((1, 0))
    assert touches.doubtful == ["OS"]


def test_a_feature_touched_again_at_its_place_joins_what_a_jump_parted() -> None:
    touches = _Touches("CL", "OS")
    repeated = touches.touch("CL", (1, 1), off=0.4)
    assert repeated is not None
    assert (repeated.agrees, repeated.distance_mm, repeated.time) == (True, 0.4, "later")
    assert touches.doubtful == []
    touches.check.follow((1, 0))
    assert touches.doubtful == []


def test_a_feature_touched_again_elsewhere_makes_all_others_doubtful() -> None:
    touches = _Touches("CL", "OS", "MN")
    repeated = touches.touch("CL", (1, 0), off=4.0)
    assert repeated is not None
    assert not repeated.agrees
    assert touches.doubtful == ["OS", "MN"]
    touches.check.follow((1, 0))
    touches.touch("OS", (1, 0), off=4.0)  # so the reference moved, not one touch
    assert touches.doubtful == ["MN"]


def test_a_repeat_that_differs_across_a_jump_joins_nothing() -> None:
    touches = _Touches("CL", "OS")
    touches.touch("CL", (1, 1), off=4.0)
    assert touches.doubtful == ["OS"]
    touches.touch("OS", (1, 1), off=4.0)
    assert touches.doubtful == []


def test_another_connection_is_another_segment_and_touches_of_before_are_unknown() -> None:
    touches = _Touches("CL")
    touches.places["OS"] = _PLACES["OS"]  # of a file
    touches.check.follow((2, 0))
    assert touches.doubtful == ["CL", "OS"]


def test_a_touch_under_another_name_is_the_same_touch() -> None:
    touches = _Touches("CL", "OS")
    touches.places = {"OS": touches.places["CL"], "CL": touches.places["OS"]}
    assert touches.doubtful == []
