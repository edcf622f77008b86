"""What harmonic balance found is kept: saved, loaded in another process and followed on, and kept where a branch breaks off."""

from __future__ import annotations

import os
import pickle
import subprocess
import sys

import mbrs as mb
import numpy as np
import pytest
from mbrs.examples import duffing

GO_ON = """
import pickle, sys
curve = pickle.load(open(sys.argv[1], "rb"))
assert curve.status == "max-points", curve.status
curve.resume().save(sys.argv[2])
"""


def in_another_process(curve, tmp_path):
    """The same curve, saved, loaded and resumed by a Python that knows nothing of this one."""
    before, after = tmp_path / "before.pkl", tmp_path / "after.pkl"
    curve.save(before)
    env = {**os.environ, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)}
    command = [sys.executable, "-c", GO_ON, str(before), str(after)]
    done = subprocess.run(command, env=env, capture_output=True, text=True, check=False, timeout=300)
    assert done.returncode == 0, done.stderr
    return pickle.loads(after.read_bytes())


def off_the_branch(curve, whole):
    """Largest distance of the points of a curve from the polygon of another one, relative to its size."""
    span = np.array([np.ptp(whole.omega), np.max(whole.amplitude())])
    a = np.column_stack([curve.omega, curve.amplitude()]) / span
    b = np.column_stack([whole.omega, whole.amplitude()]) / span
    start, along = b[:-1], np.diff(b, axis=0)
    worst = 0.0
    for point in a:
        t = np.clip(np.sum((point - start) * along, 1) / np.sum(along**2, 1), 0, 1)
        worst = max(worst, float(np.min(np.linalg.norm(start + t[:, None] * along - point, axis=1))))
    return worst


@pytest.mark.some(3)
@pytest.mark.parametrize("most", [1, 2, 12, 30, 45, 60])
def test_a_branch_goes_on_in_another_process(most, tmp_path):
    given = dict(force=[0.18], omega=(0.5, 1.6), harmonics=7)
    whole = mb.frequency_response(duffing(), **given)
    part = mb.frequency_response(duffing(), max_points=most, **given)
    rest = in_another_process(part, tmp_path) if most in (2, 30) else pickle.loads(pickle.dumps(part)).resume()
    assert rest.status == "converged" and np.allclose(rest.omega[:most], part.omega, rtol=1e-9)
    assert [e.kind for e in rest.events] == ["fold", "fold"]
    folds = np.array([e.omega for e in rest.events]) / [e.omega for e in whole.events] - 1
    off = off_the_branch(rest, whole)
    print(f"resumed after {most} points: folds differ by {np.max(np.abs(folds)):.1e}, the curve by {off:.1e}")
    # chords of the other curve are that far from it
    assert np.max(np.abs(folds)) < 1e-9 and off < 5e-3
    assert np.all(np.diff([e.index for e in rest.events]) > 0) and rest.events[0].index < len(rest)
    for event in rest.events:  # the points on both sides of a fold are those around it
        i = event.index
        assert (rest.omega[i] - rest.omega[i - 1]) * (rest.omega[i + 1] - rest.omega[i]) < 0 or abs(
            rest.omega[i] - event.omega
        ) < 0.02
    assert not np.any(np.diff(rest.omega) == 0)


def test_a_branch_with_automatic_harmonics_and_one_over_the_level_go_on(tmp_path):
    for given in (
        dict(omega=(0.5, 1.6), harmonics="auto", tol=1e-7),
        dict(omega=1.2, level=(0.1, 3.0)),
    ):
        part = mb.frequency_response(duffing(), force=[0.18], max_points=15, **given)
        whole = mb.frequency_response(duffing(), force=[0.18], **given)
        rest = pickle.loads(pickle.dumps(part)).resume()
        assert rest.status == whole.status == "converged"
        assert [e.kind for e in rest.events] == [e.kind for e in whole.events]
        for a, b in zip(rest.events, whole.events, strict=True):
            assert a.omega == pytest.approx(b.omega, rel=1e-7) and a.level == pytest.approx(b.level, rel=1e-7)
        assert np.max(rest.error) <= 1e-6


def test_a_branch_of_a_model_in_one_of_its_numbers_goes_on():
    m = mb.examples.clearance_oscillator()
    given = dict(
        value=(2e3, 8e4),
        inputs="mass.force.x",
        amplitude=3.0,
        frequency=9.0,
        harmonics=9,
        stability=False,
        n_samples=2048,
    )
    part = mb.parameter_response(m, "rail.law[0]", max_points=4, **given)
    rest = pickle.loads(pickle.dumps(part)).resume()
    whole = mb.parameter_response(m, "rail.law[0]", **given)
    assert rest.status == whole.status and rest.value[-1] == whole.value[-1] == 8e4
    assert np.allclose(rest.X[-1], whole.X[-1], atol=1e-7 * np.max(np.abs(whole.X)))


def test_a_curve_that_cannot_go_on_says_so():
    points = mb.frequency_response(duffing(), force=[0.18], omega=[0.5, 0.6])
    with pytest.raises(mb.ModelError, match="give a range"):
        points.resume()
    family = lambda k3: duffing(k3)  # noqa: E731  a function without a name cannot travel
    part = mb.parameter_response(family, value=(0.05, 0.2), force=[0.18], omega=0.9, max_points=3)
    twin = pickle.loads(pickle.dumps(part))
    assert np.array_equal(twin.X, part.X)
    with pytest.raises(mb.ModelError, match="module"):
        twin.resume()
    assert part.resume().status == "converged"


PAIR = [dict(force=[-0.25j], omega=2.0), dict(force=[-0.25j], omega=2.0 * 2**0.5)]
RESULTS = {
    "periodic solution": lambda: mb.harmonic_balance(duffing(), force=[0.18], omega=0.9),
    "frequency response": lambda: mb.frequency_response(duffing(), force=[0.18], omega=(0.5, 1.6)),
    "set of frequencies": lambda: mb.frequency_response(duffing(), force=[0.18], omega=[0.5, 0.6]),
    "without stability": lambda: mb.frequency_response(duffing(), force=[0.18], omega=(0.5, 0.7), stability=False),
    "parameter response": lambda: mb.parameter_response(duffing, value=(0.05, 0.2), force=[0.18], omega=0.9),
    "limit cycle": lambda: mb.limit_cycle(mb.examples.van_der_pol(1.0), harmonics=9),
    "quasi-periodic": lambda: mb.quasi_periodic(duffing(), PAIR, harmonics=3),
    "quasi-periodic branch": lambda: mb.quasi_periodic_response(duffing(), PAIR, scale=(1.0, 0.9), harmonics=3),
    "of a model": lambda: mb.frequency_response(
        mb.examples.clearance_oscillator(), inputs="mass.force.x", amplitude=3.0, frequency=(9, 10), harmonics=9
    ),
}


@pytest.mark.some(5)
@pytest.mark.parametrize("name", RESULTS)
def test_every_result_saves_as_netcdf_and_as_a_pickle(name, tmp_path):
    pytest.importorskip("h5py")
    import xarray as xr

    found = RESULTS[name]()
    with xr.open_dataset(found.save(tmp_path / "found.nc"), engine="h5netcdf") as data:
        there = found.to_xarray()
        assert np.array_equal(data.X.values, there.X.values) and dict(data.sizes) == dict(there.sizes)
        assert str(data.attrs["status"]) == found.status
    twin = pickle.loads(found.save(tmp_path / "found.pkl").read_bytes())
    assert np.array_equal(twin.X, found.X) and np.array_equal(twin.error, found.error)
    assert str(twin) == str(found) and twin.status == found.status


class Brittle:
    """A spring that refuses beyond a displacement: an error inside a solve."""

    def __call__(self, t, u, v):
        if np.max(np.abs(u)) > 1.0:
            raise mb.ModelError("the spring is broken")
        return 0.1 * u**3


def test_a_branch_that_an_error_ends_keeps_its_points():
    system = mb.MechanicalSystem(
        [[1.0]], [[0.05]], [[1.0]], elements=[mb.FunctionLaw(Brittle(), lambda t, u, v: (0.3 * u**2, 0 * u), w=[1.0])]
    )
    curve = mb.frequency_response(system, force=[0.18], omega=(0.5, 1.6), stability=False)
    assert curve.status == "stopped" and "the spring is broken" in curve.reason
    assert len(curve) > 5 and 0.8 < np.max(curve.amplitude()) < 1.05
    whole = mb.frequency_response(duffing(), force=[0.18], omega=(0.5, 1.6), stability=False)
    assert off_the_branch(curve, whole) < 5e-3
    assert "broken" in str(curve)
