"""How far off a guess may be: from its history, from how templates differ, and from their detours."""

import numpy as np
import pytest

from gp_labeler.autolabel.confidence import GuessConfidence, HeldOut
from gp_labeler.autolabel.detours import detours_of

NAMES = tuple("abcdefgh")


def turned(points, matrix, shift):
    return {name: matrix @ xyz + shift for name, xyz in points.items()}


def heads_of_one_shape(rng, n=3):
    """Return labels of templates, which differ a little, where they are in a scan, and in each other."""
    shape = {name: rng.normal(0, 10, 3) for name in NAMES}
    poses = [(1 + 0.05 * k, np.linalg.qr(rng.normal(size=(3, 3)))[0], rng.normal(0, 30, 3)) for k in range(n)]
    maps = [(scale * np.linalg.det(q) * q, shift) for scale, q, shift in poses]
    slips = [{name: rng.normal(0, 0.2, 3) for name in NAMES} for _ in range(n)]  # of who labelled it

    def labels_in(k, there):
        own = {name: shape[name] + slips[k][name] for name in NAMES}
        return turned(own, *there)

    home = (np.eye(3), np.zeros(3))
    labels = {f"t{k}": labels_in(k, maps[k]) for k in range(n)}
    carried = {f"t{k}": labels_in(k, home) for k in range(n)}
    between = {
        f"t{a}": {f"t{b}": labels_in(b, maps[a]) for b in range(n) if a != b} for a in range(n)
    }  # fmt: skip
    return labels, carried, between


def test_labels_that_differ_make_no_detour_but_a_faulty_registration_does():
    labels, carried, between = heads_of_one_shape(np.random.default_rng(0))
    assert max(detours_of(carried, labels, between).values()) < 0.05  # labels differ by 0.35
    carried["t1"]["c"] = carried["t1"]["c"] + [1.5, 0, 0]
    found = detours_of(carried, labels, between)
    assert max(found, key=found.get) == "c"
    assert found["c"] == pytest.approx(np.sqrt(2 / 3 * 1.5**2 / 2), rel=0.1)  # 4 of 6 pairs are of t1


def test_one_template_and_a_library_that_was_not_predicted_say_nothing_of_detours():
    labels, carried, between = heads_of_one_shape(np.random.default_rng(1))
    assert detours_of({"t0": carried["t0"]}, labels, between) == {}
    assert detours_of(carried, labels, {}) == {}


def history(rng, *, signs):
    """Return the history of eight landmarks, each labelled head ten times, of which the last err more."""
    scales = np.linspace(0.1, 0.5, len(NAMES))
    heads = []
    for k in range(10):
        off = np.linalg.norm(rng.normal(size=(8, 3)) * scales[:, None], axis=1)
        errors = dict(zip(NAMES, off, strict=True))
        known = dict(zip(NAMES, scales, strict=True)) if signs else dict.fromkeys(NAMES, np.nan)
        heads.append(HeldOut(f"h{k}", errors, known, known))
    return GuessConfidence(heads), scales


def test_a_radius_grows_with_history_spread_and_detour():
    confidence, _ = history(np.random.default_rng(2), signs=True)
    assert confidence.radius_95("h", 0.2, 0.2) > confidence.radius_95("a", 0.2, 0.2)
    assert confidence.radius_95("d", 0.4, 0.2) > confidence.radius_95("d", 0.2, 0.2)
    assert confidence.radius_95("d", 0.2, 0.4) > confidence.radius_95("d", 0.2, 0.2)
    assert confidence.radius_95("d", 0.0, 0.0) > 0.0  # templates that agree by chance are not exact


@pytest.mark.parametrize("signs", [True, False])
def test_the_radii_hold_new_errors(signs):
    rng = np.random.default_rng(3)
    confidence, scales = history(rng, signs=signs)
    held = [
        np.linalg.norm(rng.normal(0, scale, 3)) <= confidence.radius_95(name, scale, scale)
        for name, scale in zip(NAMES, scales, strict=True)
        for _ in range(200)
    ]
    assert np.mean(held) > 0.9
