"""Every public analysis has a counterpart in mbrs.reference: this fails for one that is added without."""

from __future__ import annotations

import importlib
import inspect
import pkgutil

import mbrs as mb
import numpy as np
import pytest
from mbrs import reference as ref
from mbrs.results import Result

# Analyses that only run others, or arrange what these computed: what they run has a counterpart.
COMPOSED = {
    "accuracy_study": "runs an analysis with several settings",
    "effect_study": "runs an analysis with each effect left out",
    "check_gradients": "runs an analysis at changed values",
    "compare": "runs an analysis in the core and in the reference, and subtracts",
    "sweep": "runs analyses at many designs",
    "campbell": "steady_motion and modes at several speeds",
    "effects": "lists what the model contains",
    "load": "reads what an analysis computed",
    "rotor_modes": "sorts modes by their patterns over the blades, see test_multiblade",
    "state_space": "the matrices of linearize as a system of first order, see test_response",
}
# Under another name, or several: (module of mbrs.reference, names)
OTHERWISE = {
    "gradient": ("ali3p", None),
    "sensitivity": ("sensitivity", ("derivative", "eigenvalue_derivative", "shape_derivative")),
    "eigen_sensitivity": ("precise", ("mp_eigenvalue_derivative",)),
    "harmonic_balance": ("hbm_balance", None),
    "frequency_response": ("hbm_continuation", None),
    "limit_cycle": ("hbm_shooting", None),
    "parameter_response": ("hbm_balance", ("harmonic_balance", "residual")),
    "quasi_periodic": ("hbm_quasi_periodic", None),
    "quasi_periodic_response": ("hbm_quasi_periodic", None),
}


def public_analyses():
    """Public functions that return a `Result` (or a union, or anything, of them)."""
    found = []
    for name in mb._HOME:
        value = getattr(mb, name)
        if not inspect.isfunction(value):
            continue
        module = importlib.import_module(value.__module__)
        returned = str(inspect.signature(value).return_annotation)
        named = getattr(module, returned, None)
        if returned == "Any" or (inspect.isclass(named) and issubclass(named, Result)):
            found.append(name)
    return found


def test_the_list_is_what_the_package_offers():
    assert {"modes", "linearize", "equilibrium", "frf", "response", "sensitivity", "steady_motion"} <= set(
        public_analyses()
    )


@pytest.mark.parametrize("name", public_analyses())
def test_analysis_has_a_counterpart(name):
    if name in COMPOSED:
        return
    if callable(getattr(ref, name, None)):
        return
    assert name in OTHERWISE, (
        f"mb.{name} has no counterpart in mbrs.reference: write one in plain NumPy, and a test that compares"
    )
    module, names = OTHERWISE[name]
    home = importlib.import_module(f"mbrs.reference.{module}")
    own = [n for n, v in vars(home).items() if inspect.isfunction(v) and v.__module__ == home.__name__]
    assert set(names or own) <= set(own) and own


def test_every_reference_module_is_used_by_a_test():
    """A counterpart that nothing compares with proves nothing."""
    from pathlib import Path

    texts = "\n".join(p.read_text(encoding="utf-8") for p in Path(__file__).parent.glob("*.py"))
    inner = {"jets", "joints", "rows", "linear", "reader", "so3", "topology", "kinematics", "dynamics", "closure"}
    for module in pkgutil.iter_modules(ref.__path__):
        if module.name in inner:
            continue
        home = importlib.import_module(f"mbrs.reference.{module.name}")
        own = [
            n
            for n, v in vars(home).items()
            if (inspect.isfunction(v) or inspect.isclass(v)) and v.__module__ == home.__name__ and not n.startswith("_")
        ]
        assert any(f"{n}(" in texts or f"{n}," in texts for n in own), (
            f"no test uses anything of mbrs.reference.{module.name}"
        )


@pytest.mark.parametrize("speed", [0.0, 40.0, 300.0])
def test_steady_motion(speed):
    """A bent shaft: the core's steady state and matrices against the reference's."""
    from agreement import reference_state, relative_difference
    from mbrs.system.tables import tables

    m = mb.Model("bent shaft", gravity=(0, 0, -9.81))
    g = m.body("gimbal", mass=1.0, inertia=(0.01, 0.012, 0.014), at=(0, 0, 0), com=(0.01, 0, 0.02))
    d = m.body("disc", mass=2.0, inertia=(0.02, 0.02, 0.03), at=(0, 0, 0.1))
    m.universal(
        "support", m.ground, g, at=(0, 0, 0), axis="x", axis2="y", k=(90.0, 120.0), c=(0.1, 0.2), preload=(0.4, -0.3)
    )
    m.revolute("shaft", g, d, at=(0, 0, 0.1), axis="z")
    found = mb.steady_motion(m, {"shaft": speed})
    lin, torque = ref.steady_motion(ref.System(tables(m)), {"shaft": speed})
    pose = reference_state(m, found.state)
    errors = {
        "pose": max(np.abs(pose.r - lin.state.r).max(), np.abs(pose.R - lin.state.R).max()),
        "M": relative_difference(found.linearization.M, lin.M),
        "G": relative_difference(
            np.zeros_like(lin.G) if found.linearization.G is None else found.linearization.G, lin.G, lin.D
        ),
        "K": relative_difference(found.linearization.K, lin.K),
        "torque": abs(found.torque["shaft"] - torque[0]),
    }
    print(f"steady at {speed:g} rad/s: " + ", ".join(f"{k} {v:.1e}" for k, v in errors.items()))
    assert max(errors.values()) < 1e-10
