"""Degrees of freedom of linkages are facts: frames, units, places, order and digits of a drawing do not change them."""

import re
import warnings

import changes
import descriptions
import linkages
import mbrs as mb
import numpy as np
import pytest

MODELS = 16

CHANGES = {
    "drawn": lambda rng, seed: changes.nothing(),
    "turned": lambda rng, seed: changes.general(rng),
    "far": lambda rng, seed: changes.general(rng, distance=1e4),
    "millimetres": lambda rng, seed: changes.general(rng, length=1e3),
    "small": lambda rng, seed: changes.general(rng, length=1.7e6),
    "large": lambda rng, seed: changes.general(rng, length=0.61e-5),
    "digits": lambda rng, seed: changes.general(rng, digits=8 + seed % 8),
    "tilted": lambda rng, seed: changes.chain(changes.general(rng), changes.tilted(rng, 1e-8)),
    "split": lambda rng, seed: changes.chain(changes.general(rng), changes.split(0.37)),
    "repeated": lambda rng, seed: changes.chain(changes.general(rng), changes.repeated(rng)),
    "renamed": lambda rng, seed: changes.chain(changes.general(rng), changes.renamed(rng)),
}


def cases():
    for family in linkages.FAMILIES:
        for change in CHANGES:
            yield pytest.param(family, change, id=f"{family.name}-{change}")


def redrawn(family, change, seed):
    rng = np.random.default_rng([seed, len(family.name)])
    model = family.model(rng)
    return CHANGES[change](rng, seed)(model)


@pytest.mark.some(25)
@pytest.mark.parametrize(
    "seeds", [range(6), pytest.param(range(6, MODELS), marks=pytest.mark.slow)], ids=["few", "more"]
)
@pytest.mark.parametrize(("family", "change"), list(cases()))
def test_degrees_of_freedom(family, change, seeds):
    found = [mb.System(redrawn(family, change, seed)).dof for seed in seeds]
    assert found == [family.answer["dof"]] * len(seeds)


def with_tolerance(description, tolerance):
    """The model drawn with this relative accuracy."""
    made = description.model()
    model = mb.Model(made.name, tolerance=tolerance)
    for b in description["body"]:
        model.body(**b)
    for j in description["joint"]:
        getattr(model, j["type"])(**{k: v for k, v in j.items() if k != "type"})
    return model


@pytest.mark.some(7)
@pytest.mark.parametrize("family", [f for f in linkages.FAMILIES if f.answer["dof"]], ids=lambda f: f.name)
def test_a_coarse_drawing_moves_with_its_tolerance(family):
    """Six digits and axes tilted by 1e-6: with a tolerance of 1e-4 every linkage has its degrees of freedom."""
    found = []
    for seed in range(4):
        rng = np.random.default_rng([seed, 11])
        change = changes.chain(changes.general(rng, digits=6), changes.tilted(rng, 1e-6))
        found.append(mb.System(with_tolerance(change.apply(descriptions.Description.of(family.model(rng))), 1e-4)).dof)
    assert found == [family.answer["dof"]] * 4


@pytest.mark.parametrize("family", [f for f in linkages.FAMILIES if not f.answer["dof"]], ids=lambda f: f.name)
def test_a_frame_stays_locked_with_a_coarse_tolerance(family):
    found = []
    for seed in range(4):
        rng = np.random.default_rng([seed, 12])
        change = changes.general(rng, digits=8)
        found.append(mb.System(with_tolerance(change.apply(descriptions.Description.of(family.model(rng))), 1e-5)).dof)
    assert found == [0] * 4


def test_a_fine_tolerance_locks_a_tilted_four_bar():
    rng = np.random.default_rng(5)
    change = changes.chain(changes.general(rng), changes.tilted(rng, 1e-8))
    drawn = change.apply(descriptions.Description.of(linkages.four_bar(rng)))
    assert [mb.System(with_tolerance(drawn, t)).dof for t in (1e-11, 1e-6)] == [0, 1]


def what_is_said(analysis, model):
    """All that a user reads: warnings, the error or the printed result."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            result = str(analysis(model))
        except mb.MbrsError as reason:
            result = str(reason)
    return "\n".join([result, *(str(w.message) for w in caught)])


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("family", linkages.SINGULAR, ids=lambda f: f.name)
def test_singular_poses_are_named_and_have_no_modes(family, seed):
    words = family.answer["words"]
    rng = np.random.default_rng([seed, 13])
    model = changes.general(rng)(family.model(rng))
    said = what_is_said(mb.System, model)
    assert re.search(words, said) and re.search(r"joint\d", said)
    with pytest.raises(mb.MbrsError, match=words):
        mb.modes(model)


@pytest.mark.exact
@pytest.mark.parametrize("distance", [1e3, 1e6, 1e7])
def test_a_door_far_from_the_origin_is_no_doubtful_one(distance):
    """Two hinges on one axis, where rounding of places is up to a hundredth of the tolerance."""
    m, axis, at = mb.Model("door"), np.array([0.36, 0.48, 0.8]), distance * np.array([1.0, 0.3, -0.7])
    door = m.body("door", mass=1.0, inertia=(1, 1, 1), at=at + [0.5, 0, 0])
    for i in range(2):
        m.revolute(f"hinge{i}", m.ground, door, at=at + i * axis, axis=axis)
    assert mb.System(m).dof == 1 and not mb.System(m).doubts


@pytest.mark.filterwarnings("ignore::mbrs.errors.MbrsWarning")
@pytest.mark.exact  # noise of 1e-13 on places at 1e6 is as much as the hinges are off
def test_a_door_far_from_the_origin_is_locked_by_hinges_that_are_off():
    """By a few tolerances, where rounding of places is far less."""
    m, axis, at = mb.Model("door"), np.array([0.36, 0.48, 0.8]), 1e6 * np.array([1.0, 0.3, -0.7])
    door = m.body("door", mass=1.0, inertia=(1, 1, 1), at=at + [0.5, 0, 0])
    for i in range(2):
        m.revolute(f"hinge{i}", m.ground, door, at=at + i * axis, axis=axis + 3e-7 * i * np.array([0.0, 0.8, -0.48]))
    assert mb.System(m).dof == 0 and mb.System(m).doubts
