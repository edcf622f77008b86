"""An oscillator between two stops against its exact motion: pieces of linear motion, matched where contact begins and ends."""

import itertools

import mbrs as mb
import numpy as np
import pytest
from mbrs.nonlinear.frequency_response import frequency_response


class Exact:
    """Motions of x" + c x' + x + stops (stiffness k, gap 1) = F cos(omega t) with x(t + T/2) = -x(t) that touch each stop once a
    period. Unknowns: the instant at which x passes 1, the speed there, the length of the contact, omega."""

    def __init__(self, c, k, force):
        self.c, self.k, self.force = c, k, force

    def propagator(self, stiffness, t):
        a = self.c / 2
        b = np.sqrt(complex(stiffness - a * a))
        cosine, sine = np.cos(b * t).real, (np.sin(b * t) / b).real
        return np.exp(-a * t) * np.array([[cosine + a * sine, sine], [-stiffness * sine, cosine - a * sine]])

    def driven(self, stiffness, shift, omega, t):
        z = self.force / (stiffness - omega**2 + 1j * omega * self.c) * np.exp(1j * omega * t)
        return np.array([z.real + shift / stiffness, (1j * omega * z).real])

    def moved(self, stiffness, shift, omega, begin, state, length):
        free = state - self.driven(stiffness, shift, omega, begin)
        return self.propagator(stiffness, length) @ free + self.driven(stiffness, shift, omega, begin + length)

    def residual(self, z):
        begin, speed, length, omega = z
        leaving = self.moved(1 + self.k, self.k, omega, begin, np.array([1.0, speed]), length)
        opposite = self.moved(1.0, 0.0, omega, begin + length, leaving, np.pi / omega - length)
        return np.array([leaving[0] - 1, opposite[0] + 1, opposite[1] + speed])

    def jacobian(self, z):
        out = np.zeros((3, 4))
        for i in range(4):
            step = np.zeros(4)
            step[i] = 1e-6 * max(abs(z[i]), 0.01)
            out[:, i] = (self.residual(z + step) - self.residual(z - step)) / (2 * step[i])
        return out

    def nearest(self, z):
        """The exact motion next to z, and the direction of the branch there."""
        scale = np.array([1.0, abs(z[1]), z[2], z[3]])
        for _ in range(30):
            step = -np.linalg.pinv(self.jacobian(z) * scale) @ self.residual(z) * scale
            z = z + step
            if np.max(np.abs(step / scale)) < 1e-10:
                break
        return z, np.linalg.svd(self.jacobian(z) * scale)[2][-1] * scale

    def fold(self, z, direction):
        """Where omega has its extremum near z, by bisection along the branch."""
        scale = np.array([1.0, abs(z[1]), z[2], z[3]])
        along = direction / scale / np.linalg.norm(direction / scale)

        def slope(s):
            there, tangent = self.nearest(z + s * along * scale)
            return there, tangent[3] * np.sign((tangent / scale) @ along)

        low, high = -1e-3, 1e-3
        while slope(low)[1] * slope(high)[1] > 0 and high < 0.2:
            low, high = 2 * low, 2 * high
        first = slope(low)[1]
        assert first * slope(high)[1] < 0, "no fold here"
        for _ in range(50):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if slope(middle)[1] * first > 0 else (low, middle)
        return slope(0.5 * (low + high))[0]


def passage(X, omega):
    """[instant, speed, length, omega] of the first contact of a motion with the stop at 1, None unless there is one a period."""
    t = np.linspace(0, 2 * np.pi, 40_001)[:-1]
    h = np.arange(1, X.shape[1] // 2 + 1)
    series = np.fft.irfft(np.concatenate([[X[0, 0]], 0.5 * (X[0, 1::2] - 1j * X[0, 2::2])]) * len(t), len(t))
    inside = series > 1
    into, out = np.flatnonzero(~inside & np.roll(inside, -1)), np.flatnonzero(inside & ~np.roll(inside, -1))
    if len(into) != 1:
        return None
    start, end = t[into[0]], t[out[0]]
    speed = float(np.sum(h * (X[0, 2::2] * np.cos(h * start) - X[0, 1::2] * np.sin(h * start)))) * omega
    return np.array([start / omega, speed, ((end - start) % (2 * np.pi)) / omega, omega])


def curve_of(stiffness, top, ends):
    """The curve with odd harmonics, and its points with a contact of some length as (number, unknowns of `Exact`)."""
    system = mb.MechanicalSystem([[1.0]], [[0.1]], [[1.0]], elements=[mb.Gap(stiffness, 1.0, bilateral=True, w=[1.0])])
    curve = frequency_response(system, force=[0.5], omega=ends, harmonics=list(range(1, top + 1, 2)), max_points=400)
    points = (curve.point(i) for i in range(len(curve)))
    found = [(i, passage(point.X, point.omega)) for i, point in enumerate(points)]
    touching = [(i, z) for i, z in found if z is not None and z[2] > 1e-2]
    assert len(touching) > 20
    return curve, touching


DIRECTIONS = pytest.mark.parametrize("ends", [(0.9, 6.0), (6.0, 0.9)])


@pytest.mark.slow
@DIRECTIONS
@pytest.mark.parametrize(("stiffness", "top"), [(1e3, 101), (1e3, 41), (300.0, 41)])
def test_folds_are_those_of_the_exact_motion(stiffness, top, ends):
    exact = Exact(0.1, stiffness, 0.5)
    curve, touching = curve_of(stiffness, top, ends)
    turns, direction = [], None
    for (i, z), (j, after) in itertools.pairwise(touching):
        if j != i + 1:
            continue
        tangent = exact.nearest(z)[1]
        slope = tangent[3] * np.sign(tangent @ (after - z))
        if direction is not None and direction * slope < 0:
            turns.append(i)
        direction = slope
    inside = range(touching[0][0] + 1, touching[-1][0])
    folds = [e for e in curve.events if e.kind == "fold" and e.index in inside]
    assert len(folds) == len(turns) == 1, (turns, [str(e) for e in curve.events])
    for event in folds:
        z, tangent = exact.nearest(passage(event.X, event.omega))
        error = max(curve.error[event.index - 1 : event.index + 1])
        off = abs(exact.fold(z, tangent)[3] / event.omega - 1)
        print(f"H = {top}: {event}, off by {off:.1e}, stated {error:.1e}")
        assert off <= error


@pytest.mark.slow
def test_first_points_of_motions_with_many_impacts():
    """Pressed on a stop for most of the time: the harmonics that are too few are refused with a number that suffices."""
    system = mb.MechanicalSystem([[1.0]], [[0.1]], [[1.0]], elements=[mb.Gap(1e3, 1.0, bilateral=True, w=[1.0])])
    with pytest.raises(mb.errors.ConvergenceError, match="take harmonics=") as refused:
        mb.harmonic_balance(system, force=[2.0], omega=0.2, harmonics=31)
    top = int(str(refused.value).rpartition("=")[2])
    found = mb.harmonic_balance(system, force=[2.0], omega=0.2, harmonics=top)
    assert found.status == "converged" and found.verify() < 0.02
    # the quasi-static part: force over the stiffness of spring and stop
    assert found.largest() == pytest.approx(1.0, abs=0.1)
