"""Whether touches lie in one frame: by segments, and by features that are touched again."""

from __future__ import annotations

from gp_core.landmarks.features import Side
from gp_labeler.tracker import FrameCheck

_HERE, _THERE = (0.0, 0.0, 0.0), (4.0, 0.0, 0.0)


def _doubtful(check: FrameCheck, names: list[str]) -> tuple[str, ...]:
    return tuple(name for name in names if check.is_doubtful((Side.LEFT, name)))


def _touched(*names: str, segment: tuple[int, int] = (1, 0)) -> FrameCheck:
    check = FrameCheck()
    for name in names:
        check.follow(segment)
        assert check.record((Side.LEFT, name), _HERE, segment, None, "t") is None
    return check


def test_touches_without_a_jump_between_them_are_in_one_frame() -> None:
    assert _doubtful(_touched("CL", "OS", "MN"), ["CL", "OS", "MN"]) == ()


def test_after_a_jump_earlier_touches_are_in_doubt_until_it_is_taken_back() -> None:
    check = _touched("CL", "OS")
    check.follow((1, 1))
    assert _doubtful(check, ["CL", "OS"]) == ("CL", "OS")
    check.follow((1, 0))
    assert _doubtful(check, ["CL", "OS"]) == ()


def test_a_touch_made_during_a_jump_is_in_doubt_once_it_is_taken_back() -> None:
    check = _touched("CL")
    check.record((Side.LEFT, "OS"), _HERE, (1, 1), None, "t")
    assert _doubtful(check, ["CL", "OS"]) == ("CL",)
    check.follow((1, 0))
    assert _doubtful(check, ["CL", "OS"]) == ("OS",)


def test_a_feature_touched_again_at_its_place_joins_what_a_jump_parted() -> None:
    check = _touched("CL", "OS")
    repeated = check.record((Side.LEFT, "CL"), (0.4, 0, 0), (1, 1), _HERE, "later")
    assert repeated is not None
    assert (repeated.agrees, repeated.distance_mm, repeated.time) == (True, 0.4, "later")
    assert _doubtful(check, ["CL", "OS"]) == ()
    check.follow((1, 0))
    assert _doubtful(check, ["CL", "OS"]) == ()


def test_a_feature_touched_again_elsewhere_puts_all_others_in_doubt() -> None:
    check = _touched("CL", "OS", "MN")
    repeated = check.record((Side.LEFT, "CL"), _THERE, (1, 0), _HERE, "later")
    assert repeated is not None
    assert not repeated.agrees
    assert _doubtful(check, ["CL", "OS", "MN"]) == ("OS", "MN")
    check.follow((1, 0))
    check.record(
        (Side.LEFT, "OS"), _THERE, (1, 0), _HERE, "later"
    )  # it moved as well: not the touch, the reference
    assert _doubtful(check, ["CL", "OS", "MN"]) == ("MN",)


def test_a_repeat_that_differs_across_a_jump_joins_nothing() -> None:
    check = _touched("CL", "OS")
    check.record((Side.LEFT, "CL"), _THERE, (1, 1), _HERE, "later")
    assert _doubtful(check, ["CL", "OS"]) == ("OS",)
    check.record((Side.LEFT, "OS"), _THERE, (1, 1), _HERE, "later")
    assert _doubtful(check, ["CL", "OS"]) == ()


def test_another_connection_is_another_segment_and_touches_of_before_are_unknown() -> None:
    check = _touched("CL")
    check.follow((2, 0))
    assert _doubtful(check, ["CL", "OS"]) == ("CL", "OS")
    check.forget()
    check.follow((2, 0))
    assert _doubtful(check, []) == ()
