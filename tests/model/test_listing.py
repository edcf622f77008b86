"""``print(model)`` is a table of everything that was given, and never fails."""

import mbrs as mb
import numpy as np
import pytest
from mbrs.model import listing


def machine(bodies=3):
    m = mb.Model("press", gravity=(0.0, 1.7, -9.6))
    k = m.parameter("k", 2.5e4, unit="N/m")
    arms = [m.body(f"arm{i}", mass=1.3 + i, inertia=(0.2, 0.3, 0.4), at=(0.4 * i, 1e-18, 0.7)) for i in range(bodies)]
    m.revolute("hinge", m.ground, arms[0], at=(0.1, 0.2, 0.3), axis=(0.6, 0.0, 0.8))
    m.spring_damper("leg", arms[0], arms[1], at=((0.1, 0.0, 0.0), (0.9, 0.1, 0.2)), k=2.0 * k, c=31.0)
    m.prismatic("rail", m.ground, arms[1], at=(1, 2, 3), axis="y", law=mb.Cubic(7.0))
    m.force("push", arms[1], at=(0.3, 0.2, 0.1), value=(0.0, 12.5, 0.0))
    m.drive("turn", m["hinge"], mb.Ramp(3.0))
    m.marker("tip", arms[2], at=(1.0, 2.0, 3.0))
    return m


def test_every_object_is_listed_with_what_it_joins_its_numbers_and_its_parameters():
    text = str(machine())
    head = text.splitlines()[0]
    assert head == (
        "model 'press': 3 bodies, 2 joints, 1 spring or damper, 1 load, 1 drive, 1 parameter, gravity [0, 1.7, -9.6] m/s2"
    )
    for word in ("parameters", "bodies", "joints", "springs and dampers", "loads", "drives", "markers", "mass [kg]"):
        assert word in text
    rows = {line.split()[0]: line for line in text.splitlines() if line}
    assert "ground - arm0" in rows["hinge"] and "revolute" in rows["hinge"] and "[0.6, 0, 0.8]" in rows["hinge"]
    assert "arm0 - arm1" in rows["leg"] and "= 5e+04" in rows["leg"]
    assert "N/m" in rows["k"] and "2.3" in rows["arm1"] and "[0.4, 0, 0.7]" in rows["arm1"]
    assert "[0, 12.5, 0]" in rows["push"] and "arm2" in rows["tip"] and "Ramp" in rows["turn"]


def test_a_large_model_is_cut_and_says_so():
    text = str(machine(listing.MOST_ROWS + 7))
    assert "... and 7 more" in text
    assert len(text.splitlines()) < listing.MOST_ROWS + 60


def test_an_empty_model_prints_and_notebooks_get_html():
    assert str(mb.Model("nothing")) == "model 'nothing': empty"
    page = machine()._repr_html_()
    assert page.count("<table") == 7 and "arm0" in page


@pytest.mark.parametrize(
    "name", [n for n in dir(mb.examples) if n in ("four_bar", "cubic_hexapod", "wind_rotor", "quadruped")]
)
def test_models_of_the_examples_print(name):
    made = getattr(mb.examples, name)()
    text = str(made)
    assert all(body.name in text for body in made.bodies[: listing.MOST_ROWS])
    assert max(len(line) for line in text.splitlines()) <= 121


def test_functions_with_derivatives_that_no_file_can_hold_are_shown():
    """A file needs a name by which they can be imported; a table does not."""
    m = mb.Model("local functions")
    b = m.body("b", mass=1.3, inertia=(1.0, 2.0, 2.5), at=(0.3, 0.2, 0.1))
    stiffening = mb.FunctionLaw(lambda t, u, v: u**3, derivatives=lambda t, u, v: (3 * u**2, 0.0))
    m.spring_damper("spring", m.ground, b, at=((1.0, 2.0, 0.3), (0.3, 0.2, 0.1)), k=3.0, law=stiffening)
    slopes = lambda t, u: ([[0.0, 1.0]], [np.zeros((2, 2))])  # noqa: E731
    m.constraint("level", lambda t, u: [u], ["b.motion.z"], derivatives=slopes)
    text = str(m)
    assert "<lambda>(t, u, v)" in text and "<lambda>(t, u)" in text
    with pytest.raises(mb.ModelError, match="cannot be saved"):
        m.file_text()
