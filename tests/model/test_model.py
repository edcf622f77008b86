"""The model and its Tables: layout, addresses, directions, m.set, ports, effects."""

from __future__ import annotations

import copy
import pickle

import numpy as np
import pytest
from mbrs._lib.rotations import matrix_to_quaternion, quaternion_matrix
from mbrs.errors import ModelError, NameNotFoundError
from mbrs.examples import cubic_hexapod, four_bar
from mbrs.model.addresses import driver
from mbrs.model.model import Model
from mbrs.model.ports import as_port, base_motion
from mbrs.model.rotations import rotation
from mbrs.model.tables import directions, dx_dV, tables, x
from mbrs.system.compiled import compiled
from mbrs.system.effects import EFFECTS, check_without, effects
from scenes import everything, same_tables


@pytest.mark.exact
def test_layout_of_a_body():
    m = everything()
    t = tables(m)
    b = t["x"][t["body_x"][1] :][:23]
    expected = [0.5, 1, 0, 1, 0, 0, 0, 0.01, 1.25**2, 0, 2, 2, 1.5, 1, -0.1, 0.2, 0.05, 0.1, 0, 0, 0, 2, 1]
    assert b.tolist() == expected
    assert t["body_name"] == ["a", "b", "c", "d"]
    assert t["pose_body"].tolist() == [2]
    assert t["x"][t["pose_x"][0] :][:7].tolist() == [1, 2, 3, 1, 0, 0, 0]
    assert t["x"][t["gravity_x"][0] :][:3].tolist() == [0.1, -9.81, 0.2]


@pytest.mark.exact
def test_layout_of_joints():
    t = tables(everything())
    at = {name: t["x"][s:][:36] for name, s in zip(t["joint_name"], t["joint_x"], strict=True)}
    flags = dict(zip(t["joint_name"], t["joint_flags"].tolist(), strict=True))
    revolute = at["revolute"].tolist()
    assert revolute[:16] == [0, 0, 0, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1, 0, 0, 0]
    assert (revolute[16], revolute[22], revolute[28]) == (2.0, 1.0, 0.5)
    assert at["universal"][6:12].tolist() == [0, 0, 1, 0, -2, 0]
    assert at["spherical"][:6].tolist() == [1, 1, 0, 1, 1, 0.125]
    assert at["free"][16:22].tolist() == [1, 2, 3, 4, 5, 6]
    assert at["rod"][34] == 1.5 and at["drawn rod"][34] == 0.0 and at["disc"][35] == 0.3
    assert flags["revolute"] == 7 and flags["free"] == 9 and flags["cross"] == 8 and flags["rod"] == 16
    assert flags["fixed"] == 0 and flags["drawn rod"] == 0 and flags["planar"] == 5 and flags["cylindrical"] == 3
    types = dict(zip(t["joint_name"], t["joint_type"].tolist(), strict=True))
    assert [types[n] for n in ("fixed", "revolute", "prismatic", "cylindrical", "universal")] == [0, 1, 2, 3, 4]
    assert [types[n] for n in ("spherical", "planar", "free", "rod", "knife", "disc")] == [5, 6, 7, 8, 9, 10]
    assert t["joint_a"][1] == -1 and t["joint_b"][1] == 0


@pytest.mark.exact
def test_layout_of_elements_loads_markers_and_laws():
    t = tables(everything())
    at = {name: t["x"][s:][:88] for name, s in zip(t["element_name"], t["element_x"], strict=True)}
    assert at["spring"][[6, 7, 8, 9]].tolist() == [1, 0, 2, 0]
    assert at["drawn spring"][[6, 7, 8, 9]].tolist() == [2.0 / 0.625, 3, 0, -2]
    assert np.array_equal(at["mount"][10:46].reshape(6, 6), np.diag([1e4, 2e4, 3e4, 4e4, 5e4, 6e4]))
    assert np.array_equal(at["mount"][46:82].reshape(6, 6), np.diag([10, 10, 10, 0, 0, 0]))
    assert np.array_equal(at["bearing"][10:46], np.arange(36.0))
    assert at["bearing"][82:88].tolist() == [1, 2, 3, 4, 5, 6]
    assert at["twist"][:10].tolist() == [0, 0, 1, 0, 2, 0, 1, 2, 0.2, 0.1]
    assert t["element_type"].tolist() == [0, 0, 1, 1, 2]
    assert t["element_flags"].tolist() == [17, 7, 3, 5, 7]
    assert t["load_type"].tolist() == [1, 0, 0] and t["load_frame"].tolist() == [0, 1, 0]
    push = t["x"][t["load_x"][2] :][:6]
    assert push.tolist() == [0, 0.625, 0, 0, 1, 0]
    assert t["marker_body"].tolist() == [1, -1]
    # Laws of elements first, then of joints: "mount" x twice, "revolute", "spherical" y.
    assert t["law_owner_kind"].tolist() == [0, 0, 1, 1]
    assert t["law_owner"].tolist() == [2, 2, 1, 6]
    assert t["law_component"].tolist() == [0, 0, 0, 1]
    assert t["law_type"].tolist() == [7] * 4 and t["law_n"].tolist() == [1, 1, 2, 1]
    assert t["x"][t["law_x"][2] :][:2].tolist() == [1.0, 1.25**2]


def test_types_of_the_arrays():
    for key, value in tables(everything()).items():
        if key.endswith("_name"):
            assert all(type(v) is str for v in value)
        elif key in ("functions", "function_coordinates", "function_body"):
            assert value == []
        elif key == "tolerance":
            assert value == 1e-7
        else:
            assert value.dtype == (np.float64 if key == "x" else np.int64) and value.ndim == 1


def all_addresses(m):
    for item in m.items.values():
        for name, field in item.fields().items():
            yield f"{item.name}.{name}", item, field


def test_every_plain_address_moves_x_as_its_direction_says():
    m = everything()
    walked = 0
    for address, _, field in all_addresses(m):
        if field.kind in ("axis", "orientation"):
            continue
        d = directions(m, address)
        h = 1e-3
        for column, label in enumerate(d.labels):
            other = copy.deepcopy(m)
            before = x(other)
            try:
                other.set({label: other.value(label) + h})
            except ModelError as reason:
                assert "driven" in str(reason)
                continue
            if label.endswith(".length") and "drawn" in label:
                continue  # from "follows the drawing" to a value of its own: see the test of lengths
            assert np.abs((x(other) - before) / h - d.dense[:, column]).max() < 1e-9, label
            walked += 1
    assert walked > 230


def rotate(i, h, v):
    e = np.zeros(3)
    e[i] = 1.0
    return quaternion_matrix(rotation(e, h)) @ v


def test_axes_and_orientations_turn_about_world_axes():
    m = everything()
    walked, h = 0, 1e-5
    for address, item, field in all_addresses(m):
        if field.kind not in ("axis", "orientation"):
            continue
        places = [slots[0] for slots in field.slots]
        start = sum(len(m.stores[k].x) for k in list(m.stores)[: list(m.stores).index(item.store)])
        now = x(m)[start + np.array(places)]
        d = directions(m, address)
        assert d.units == ("rad",) * 3 and d.labels[2] == address + "[2]"
        for i in range(3):
            slope = d.dense[start + np.array(places), i]
            assert np.count_nonzero(d.dense[:, i]) == np.count_nonzero(slope)
            if field.kind == "axis":
                expected = (rotate(i, h, now) - rotate(i, -h, now)) / (2 * h)
                assert np.abs(slope - expected).max() < 1e-9
            else:
                turned = quaternion_matrix(now + h * slope)
                expected = quaternion_matrix(rotation(np.eye(3)[i], h)) @ quaternion_matrix(now)
                assert np.abs(turned - expected).max() < h * h
            walked += 1
    assert walked >= 3 * 20


def test_dx_dV_is_exact():
    m = everything()
    exact = dx_dV(m).toarray()
    assert exact.shape == (len(x(m)), 8)
    for column, symbol in enumerate(m.space.symbols):
        v, h = m.value(symbol.label), 1e-6
        sides = []
        for sign in (1, -1):
            m.set({symbol.label: v + sign * h})
            sides.append(x(m))
        m.set({symbol.label: v})
        difference = (sides[0] - sides[1]) / (2 * h)
        assert np.abs(difference - exact[:, column]).max() <= 1e-9 * max(1.0, np.abs(exact[:, column]).max())
        assert np.abs(exact[:, column]).max() > 0.0


def test_directions_of_the_isolator():
    m = cubic_hexapod()
    t = tables(m)
    d = directions(m, ["k_leg", "c_leg", "payload.mass", "leg0.at_b[2]"])
    assert d.labels == ("k_leg", "c_leg", "payload.mass", "leg0.at_b[2]")
    assert d.units == ("N/m", "N s/m", "kg", "m") and d.shape == (4,)
    assert d.dense.flags.f_contiguous and d.dense.dtype == np.float64
    assert np.flatnonzero(d.dense[:, 0]).tolist() == (t["element_x"] + 6).tolist()
    assert np.flatnonzero(d.dense[:, 1]).tolist() == (t["element_x"] + 7).tolist()
    assert np.flatnonzero(d.dense[:, 2]).tolist() == [t["body_x"][0] + 10]
    assert np.flatnonzero(d.dense[:, 3]).tolist() == [t["element_x"][0] + 5]
    assert (d.sparse.toarray() == d.dense).all()


def test_an_array_parameter_keeps_its_shape():
    m = everything()
    d = directions(m, "V 2")
    assert d.shape == (2, 3) and d.labels[4] == "V 2[1,1]" and d.n == 6
    assert d.shaped(np.zeros((5, 6))).shape == (5, 2, 3)
    assert directions(m, ["V 2", "L"]).shape == (7,)
    assert directions(m, ["L"]).shape == (1,)
    assert directions(m, "b.at").shape == (3,)
    assert directions(m, "bearing.k").shape == (6, 6)


def test_inertia_entries_mean_both_and_at_moves_both_ends():
    m = everything()
    t = tables(m)
    assert (directions(m, "b.inertia[0,1]").dense == directions(m, "b.inertia[1,0]").dense).all()
    assert np.flatnonzero(directions(m, "b.inertia[2,1]").dense[:, 0]).tolist() == [t["body_x"][1] + 16]
    assert m.value("b.inertia").tolist() == [[2.0, -0.1, 0.2], [-0.1, 1.5, 0.05], [0.2, 0.05, 1.0]]
    j = t["joint_x"][0]
    assert np.flatnonzero(directions(m, "fixed.at[1]").dense[:, 0]).tolist() == [j + 1, j + 4]
    with pytest.raises(NameNotFoundError, match="two points"):
        directions(m, "spherical.at[1]")


def test_units_of_coefficients():
    m = everything()
    assert directions(m, "mount.k").units == ("N/m",) * 3 + ("N m/rad",) * 3
    assert directions(m, ["bearing.k[0,4]", "bearing.k[4,0]"]).units == ("N/rad", "N m/m")
    assert directions(m, "cylindrical.k").units == ("N/m", "N m/rad")
    assert directions(m, ["drawn spring.c", "drawn spring.preload"]).units == ("N s/m", "N")


def test_set_and_value():
    m = cubic_hexapod()
    m.set({"k_leg": 2e5, "leg0.at_b[2]": 0.3, "payload.mass": 21})
    assert m.value("leg3.k") == 2e5 and m.value("leg0.at_b")[2] == 0.3 and m.value("payload.mass") == 21.0
    m.set({"payload.inertia": (0.2, 0.2, 0.3), "payload.orientation": rotation("x", 0.1)})
    assert m.value("payload.inertia")[2, 2] == 0.3
    assert m.value("payload.orientation").tolist() == rotation("x", 0.1).tolist()
    m.set({"payload.inertia[0,1]": 0.01})
    assert m.value("payload.inertia")[1, 0] == 0.01


def test_set_keeps_the_structure_and_changes_only_values():
    m = cubic_hexapod()
    first, structure = tables(m), m.structure_version
    m.set({"k_leg": 2e5})
    second = tables(m)
    assert m.structure_version == structure and m.values_version == 1
    assert second["element_x"] is first["element_x"]
    k = first["element_x"][0] + 6
    assert [first["x"][k], second["x"][k]] == pytest.approx([1e5, 2e5], rel=1e-12)


def test_shared_arrays_cannot_be_spoilt():
    with pytest.raises(ValueError, match="read-only"):
        tables(cubic_hexapod())["element_a"][0] = 3


def test_compiled_keeps_the_topology(monkeypatch):
    made = []

    class FakeSystem:
        def __init__(self, t):
            made.append(("new", t["x"]))

        def with_values(self, values):
            made.append(("values", values))
            return self

    from mbrs import _core

    monkeypatch.setattr(_core, "System", FakeSystem, raising=False)
    m = cubic_hexapod()
    assert compiled(m) is compiled(m)
    m.set({"k_leg": 2e5})
    compiled(m)
    m.set({"leg0.length": 0.3})
    compiled(m)
    m.body("second", mass=1.0, inertia=(1, 1, 1))
    compiled(m)
    assert [what for what, _ in made] == ["new", "values", "new", "new"]
    assert np.isclose(made[1][1], 2e5, rtol=1e-12, atol=0.0).sum() == 6


def test_set_is_all_or_nothing():
    m = everything()
    before, t = m.space.values.copy(), tables(m)
    for changes in (
        {"L": 2.0, "a.mass": 3.0},
        {"d.mass": 5.0, "L": -1.0, "nothing.k": 1.0},
        {"d.mass": 5.0, "V 2": -np.ones((2, 3))},
        {"d.at": (1, 2, 3), "lambda": -2.5},
        {"d.at": (1, 2, 3), "d.inertia[2,2]": 50.0},
        {"d.at[0]": 1.0, "d.velocity": (1, 2)},
        {"drawn rod.length": -1.0},
    ):
        with pytest.raises(ModelError):
            m.set(changes)
        assert m.space.values == before and not same_tables(t, tables(m)), changes
    m.set({"L": 1.5})
    assert m.value("a.at").tolist() == [0, 0.75, 0]


def test_driven_numbers_change_through_their_parameter():
    m = everything()
    with pytest.raises(ModelError, match=r"driven by the expression .*'lambda'.*set 'lambda' instead"):
        m.set({"revolute.k": 3.0})
    with pytest.raises(ModelError, match="set 'L' instead"):
        m.set({"a.at": (0, 0, 0)})
    m.set({"a.at[0]": 0.5})
    assert m.value("a.at").tolist() == [0.5, 0.625, 0]


def test_length_follows_the_drawing_until_it_is_set():
    m = cubic_hexapod()
    assert m.value("leg0.length") == pytest.approx(0.2, rel=1e-12)
    flags = tables(m)["element_flags"]
    d = directions(m, "leg0.length")
    assert np.flatnonzero(d.dense[:, 0]).tolist() == [tables(m)["element_x"][0] + 8]
    m.set({"leg0.length": 0.25})
    t = tables(m)
    assert t["element_flags"].tolist() == [19, 3, 3, 3, 3, 3] and flags.tolist() == [3] * 6
    assert t["x"][t["element_x"][0] + 8] == pytest.approx(0.25, rel=1e-12) and m.value("leg0.length") == 0.25


def test_moving_a_body_leaves_the_points_of_others():
    m = four_bar()
    before = tables(m)
    m.set({"coupler.at[0]": 0.6})
    after = tables(m)
    assert np.flatnonzero(before["x"] != after["x"]).tolist() == [before["body_x"][1]]


def test_pickle_and_copy_give_the_same_tables():
    m = everything()
    driver(m)
    for twin in (pickle.loads(pickle.dumps(m)), m.copy()):
        assert not same_tables(tables(m), tables(twin))
        twin.set({"L": 1.4})
        m2 = everything()
        m2.set({"L": 1.4})
        assert not same_tables(tables(m2), tables(twin))
        assert twin.bodies[0].model is twin and twin["L"].space is twin.space
        assert same_tables(tables(m), tables(twin)) == ["x"]


def test_names_find_handles():
    m = everything()
    assert m["a"] is m.bodies[0] and m["tip"] is m.markers[0] and m["ground"] is m.ground
    assert m["L"] is m.space.symbols[0] and "a" in m and "nothing" not in m
    assert m.parameters == ("L", "V 2", "lambda")


def test_ports():
    m = four_bar()
    b = m["coupler"]
    port = b.force("z")
    assert port.name == "coupler.force.z" and port.kind == "force" and not port.is_rotation
    assert port.direction == (0.0, 0.0, 1.0) and port.point is None and port.body == "coupler"
    assert hash(port) == hash(m.copy()["coupler"].force("z")) and {port: 1}[b.force((0, 0, 2.0))] == 1
    assert b.motion("-rx").is_rotation and b.motion("-rx").direction == (-1.0, 0.0, 0.0)
    assert b.torque("y").is_rotation and b.torque("y").name == "coupler.torque.y"
    assert b.force("x", at=(1, 1, 0)).point == (1.0, 1.0, 0.0)
    assert b.force("x", at=(1, 1, 0)) != b.force("x")
    assert m["P2"].motion("x").marker == "P2" and m["P2"].motion("x").body == "coupler"
    assert base_motion("z").name == "base.z" and base_motion("rz").is_rotation
    assert b.force((3, 4, 0)).direction == (0.6, 0.8, 0.0)
    for spec in ("coupler.force.z", "P2.motion.rx", "base.z", "coupler.torque.-y"):
        assert as_port(m, spec).name == spec
    assert as_port(m, port) is port


@pytest.mark.parametrize("wrong", ["coupler.force.q", "coupler.speed.x", "coupler", "A.force.z", 3, "couple.force.x"])
def test_wrong_ports(wrong):
    with pytest.raises(ModelError):
        as_port(four_bar(), wrong)


def test_ports_of_ground_and_of_other_models():
    m = four_bar()
    with pytest.raises(ModelError, match="ground does not move"):
        m.ground.force("x")
    with pytest.raises(NameNotFoundError, match="payload"):
        as_port(m, cubic_hexapod()["payload"].force("z"))


def test_effects_of_three_scenes():
    table = effects(cubic_hexapod())
    assert [row.name for row in table] == list(EFFECTS)
    assert table.on == ("damping",)
    assert table["damping"].why == "all 6 springs have damping"
    assert table["gravity"].why == "no gravity was given"
    assert set(effects(four_bar()).on) == {"gravity", "preload-stiffness", "constraint-force-stiffness", "damping"}
    assert set(effects(everything()).on) == set(EFFECTS) - {
        "flexibility",
        "friction",
        "contact",
        "drives",
        "aerodynamics",
    }
    text = str(effects(four_bar()))
    assert len(text.splitlines()) == 3 + len(EFFECTS) and "1 spring" not in text.splitlines()[0]


@pytest.mark.parametrize(
    ("change", "effect"),
    [
        (lambda m: setattr(m, "gravity", (0, 0, -9.81)), "gravity"),
        (lambda m: m.set({"b.angular_velocity": (0, 0, 1)}), "gyroscopic"),
        (lambda m: m.set({"b.velocity": (0, 0, 1)}), "centrifugal"),
        (lambda m: m.set({"s.length": 0.5}), "preload-stiffness"),
        (lambda m: m.force("f", "b", value=(1, 0, 0)), "constraint-force-stiffness"),
        (lambda m: m.spring_damper("t", m.ground, "b", at=((0, 0, 0), (0, 0, 1)), c=1.0), "damping"),
        (lambda m: m.bushing("t", m.ground, "b", at=(0, 0, 0), k=[1] * 6, preload=[1] * 6), "preload-stiffness"),
        (lambda m: m.knife_edge("t", m.ground, "b", at=(0, 0, 0), axis="x"), "nonholonomic"),
        (lambda m: m.revolute("t", m.ground, "b", at=((0, 0, 0), (0, 0, 1)), axis="x"), "preload-stiffness"),
    ],
)
def test_each_effect_is_switched_on_by_what_causes_it(change, effect):
    m = Model("plain")
    b = m.body("b", mass=1.0, inertia=(1, 1, 1))
    m.revolute("j", m.ground, b, at=(0, 0, 0), axis="z")
    m.spring_damper("s", m.ground, b, at=((0, 0, 1), (0, 0, 2)), k=1.0)
    assert effects(m).on == ()
    change(m)
    assert effects(m)[effect].on


def test_friction_and_contact_come_from_laws():
    class Jenkins:
        code, values = 4, (1.0, 2.0)

    class Gap:
        code, values = 2, (1.0, 2.0)

    m = Model("laws")
    b = m.body("b", mass=1.0, inertia=(1, 1, 1))
    m.spring_damper("s", m.ground, b, at=((0, 0, 1), (0, 0, 2)), law=[Jenkins(), Gap()])
    assert effects(m)["friction"].why == "friction law on s" and effects(m)["contact"].on


def test_without_is_checked():
    assert check_without(("damping", "gravity")) == ("gravity", "damping")
    assert check_without("damping") == ("damping",) and check_without(()) == ()
    with pytest.raises(ModelError, match="did you mean 'gyroscopic'"):
        check_without(("gyroscopc",))
    with pytest.raises(ModelError, match="cannot be switched off"):
        check_without(("loops",))
    for junk in (3, [["damping"]], (None,), (np.zeros(2),)):
        with pytest.raises(ModelError):
            check_without(junk)


def test_rotations():
    assert rotation("z", np.pi / 2).tolist() == [np.cos(np.pi / 4), 0.0, 0.0, np.sin(np.pi / 4)]
    rng = np.random.default_rng(5)
    for _ in range(50):
        q = rng.normal(size=4)
        r = quaternion_matrix(q)
        assert np.abs(r @ r.T - np.eye(3)).max() < 1e-14 and np.linalg.det(r) > 0
        again = matrix_to_quaternion(r)
        assert np.abs(quaternion_matrix(again) - r).max() < 1e-13
    half_turn = quaternion_matrix(rotation((1, 1, 0), np.pi))
    assert np.abs(quaternion_matrix(matrix_to_quaternion(half_turn)) - half_turn).max() < 1e-14
    m = Model("angle")
    q = rotation((0, 1, 1), m.parameter("angle", 0.3))
    assert [v if isinstance(v, float) else v.value for v in q] == pytest.approx(rotation((0, 1, 1), 0.3), abs=1e-16)


def test_gravity_can_be_given_later_and_by_parameters():
    m = Model("late")
    g = m.parameter("g", 9.81)
    m.body("b", mass=1.0, inertia=(1, 1, 1))
    assert tables(m)["gravity_x"].tolist() == [-1]
    m.gravity = (0, 0, -g)
    m.set({"g": 1.62})
    assert m.gravity.tolist() == [0, 0, -1.62] and m.value("gravity[2]") == -1.62
    assert directions(m, "g").dense[-1, 0] == -1.0
    m.gravity = (1, 2, 3)
    assert len(x(m)) == 26
