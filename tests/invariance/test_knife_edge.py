"""The equilibrium of a model with a knife edge: a family of them, so that what is found must not hang on the search."""

import changes
import descriptions
import mbrs as mb
import numpy as np
import pytest
import units


def skate(seed):
    """A skate on ice, pulled off its place by springs that pull across its edge."""
    rng = np.random.default_rng(seed)
    m = mb.Model("skate")
    b = m.body("skate", mass=2.0, inertia=(0.2, 0.3, 0.4), at=(0, 0, 0))
    m.planar("ice", m.ground, b, at=(0, 0, 0), axis="z")
    angle = rng.uniform(0.4, 1.2)
    m.knife_edge("edge", m.ground, b, at=(0.1, 0.05, 0), axis=(-np.sin(angle), np.cos(angle), 0))
    for i in range(3):
        foot = np.append(rng.normal(size=2) * 1.5, 0.0)
        hook = np.append(rng.normal(size=2) * 0.3, 0.0)
        length = 0.6 * float(np.linalg.norm(foot - hook))
        m.spring_damper(f"s{i}", m.ground, b, at=(tuple(foot), tuple(hook)), k=10 + 5 * i, length=length)
    return changes.turned(np.random.default_rng(1))(m)


CHANGES = {
    "order": changes.reordered(np.random.default_rng(5)),
    "turned": changes.turned(np.random.default_rng(6)),
    "units": units.in_units(270.0, 0.3, 0.02),
    "reversed": changes.reversed_joints(np.random.default_rng(8)),
}


def placed(eq, change):
    return change.points_back(eq.position(change.rename("skate")))


@pytest.mark.parametrize("change", CHANGES)
@pytest.mark.parametrize("seed", range(4))
def test_place_after_a_change(seed, change):
    """The same place, or an error that says that there is a family."""
    m = skate(seed)
    try:
        expected = mb.equilibrium(m).position("skate")
    except mb.MbrsError as reason:
        assert "edge" in str(reason)
        return
    eq = mb.equilibrium(CHANGES[change](m))
    assert np.linalg.norm(placed(eq, CHANGES[change]) - expected) < 1e-9


@pytest.mark.parametrize("seed", range(4))
def test_a_family_of_equilibria_is_named(seed):
    """The edge carries a force, and its body may lie elsewhere in balance: the result must say that the place is not unique."""
    m = skate(seed)
    try:
        eq = mb.equilibrium(m)
    except mb.MbrsError as reason:
        assert "edge" in str(reason)
        return
    force = np.linalg.norm(eq.reactions["edge"][:3])
    free = "edge" in str(getattr(eq, "free_directions", "")) or "edge" in eq.status or "family" in str(eq)
    assert free or force < 1e-9


@pytest.mark.parametrize("seed", range(4))
def test_place_does_not_depend_on_where_the_search_began(seed):
    """From the equilibrium itself, and from where it was drawn in one step more: what is allowed is one rule for all starts."""
    m = skate(seed)
    first = mb.equilibrium(m)
    twin = descriptions.Description.of(m)
    for joint in twin["joint"]:
        if joint["type"] == "knife_edge":
            joint["name"] = "other edge"
    nudged = twin.model()
    nudged.set({"s0.k": 1.3 * nudged.value("s0.k")})
    detour = mb.equilibrium(nudged)
    nudged.set({"s0.k": nudged.value("s0.k") / 1.3})
    second = mb.equilibrium(nudged, at=detour.state)
    assert np.linalg.norm(first.position("skate") - second.position("skate")) < 1e-8


def test_sensitivity_that_follows_is_that_of_the_equilibrium_found_again():
    """Or it is refused by name."""
    for seed in range(4):
        m = skate(seed)
        address = "s0.k"
        k = m.value(address)
        modes = mb.modes(m, at=mb.equilibrium(m))
        try:
            found = mb.sensitivity(modes, address).frequency[:, 0]
        except mb.MbrsError as reason:
            assert "edge" in str(reason)
            continue
        f, h = [], 1e-4 * k
        for step in (h, -h):
            m.set({address: k + step})
            f.append(mb.modes(m, at=mb.equilibrium(m)).frequency)
            m.set({address: k})
        difference = (f[0] - f[1]) / (2 * h)
        assert np.abs(found - difference).max() < 1e-5 * np.abs(difference).max()


def wheel(slope, seed):
    """A wheel on a rail along a random direction, held by a spring of its carriage: rolling comes from a position there."""
    R = changes.matrix(changes.random_turn(np.random.default_rng(seed)))
    m = mb.Model("wheel", gravity=tuple(R @ (9.81 * np.array([np.sin(slope), 0.0, -np.cos(slope)]))))
    carriage = m.body("carriage", mass=1.0, inertia=(0.1, 0.1, 0.1), at=R @ [0, 0, 0.3])
    disc = m.body("disc", mass=2.0, inertia=(0.05, 0.09, 0.05), at=R @ [0, 0, 0.3], orientation=R)
    m.prismatic("rail", m.ground, carriage, at=R @ [0, 0, 0.3], axis=R[:, 0])
    m.revolute("axle", carriage, disc, at=R @ [0, 0, 0.3], axis=R[:, 1], k=4.0)
    m.rolling_disc(
        "track", m.ground, disc, at=(R @ [0, 0, 0], R @ [0, 0, 0.3]), axis=R[:, 2], axis2=R[:, 1], radius=0.3
    )
    return m


@pytest.mark.parametrize("seed", range(3))
def test_a_wheel_on_a_rail_rolls_to_its_place_and_its_track_carries_a_force(seed):
    """4 phi = 3 g sin(slope) r, x = r phi."""
    slope = 0.1
    eq = mb.equilibrium(wheel(slope, seed))
    x = 0.3 * 3.0 * 9.81 * np.sin(slope) * 0.3 / 4.0
    assert np.linalg.norm(eq.position("disc") - wheel(slope, seed).value("disc.at")) == pytest.approx(x, rel=1e-9)
    assert np.linalg.norm(eq.reactions["track"][:3]) > 1.0


@pytest.mark.parametrize("seed", range(3))
def test_a_skate_on_a_slope_is_held_by_its_edge_alone_and_says_so(seed):
    R = changes.matrix(changes.random_turn(np.random.default_rng([seed, 3])))
    m = mb.Model("slope", gravity=tuple(R @ [0.0, 2.0, -9.0]))
    b = m.body("skate", mass=2.0, inertia=(0.2, 0.3, 0.4), at=R @ [0, 0, 0])
    m.planar("ice", m.ground, b, at=R @ [0, 0, 0], axis=R[:, 2])
    m.knife_edge("edge", m.ground, b, at=R @ [0, 0, 0], axis=R[:, 1])
    eq = mb.equilibrium(m)
    assert np.linalg.norm(eq.reactions["edge"][:3]) == pytest.approx(4.0, rel=1e-9)
    assert "'edge'" in str(eq) and "family" in str(eq)


@pytest.mark.parametrize(("share", "one_of_many"), [(1e-8, False), (1e-6, True)])
def test_an_edge_that_carries_rounding_makes_no_family(share, one_of_many):
    """A skate on springs along its edge and against turning, pushed across by this share of the force along."""
    m = mb.Model("held")
    b = m.body("skate", mass=1.0, inertia=(1, 1, 1), at=(0, 0, 0))
    m.planar("ice", m.ground, b, at=(0, 0, 0), axis="z")
    m.knife_edge("edge", m.ground, b, at=(0, 0, 0), axis="y")
    m.bushing("springs", m.ground, b, at=(0, 0, 0), k=(10.0, 0, 0, 0, 0, 5.0))
    m.force("push", b, at=(0, 0, 0), value=(1.0, share, 0))
    modes = mb.modes(m, at=mb.equilibrium(m))
    if one_of_many:
        with pytest.raises(mb.MbrsError, match="'edge' holds by a force is one of a family"):
            mb.sensitivity(modes, "skate.mass")
    else:  # omega = sqrt(k / m)
        slope = mb.sensitivity(modes, "skate.mass").frequency[-1, 0]
        assert slope == pytest.approx(-0.5 * np.sqrt(10.0) / (2 * np.pi), rel=1e-9)
