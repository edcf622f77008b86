"""Multiblade coordinates and the families of rotor modes."""

from __future__ import annotations

import types

import mbrs as mb
import numpy as np
import pytest


@pytest.mark.parametrize("n", [2, 3, 4, 5])
def test_there_and_back(n):
    rng = np.random.default_rng(n)
    psi = 0.3 + 2 * np.pi * np.arange(n) / n + np.linspace(0, 5, 7)[:, None]
    q = rng.normal(size=(7, n)) + 1j * rng.normal(size=(7, n))
    a = mb.multiblade(q, psi)
    assert mb.multiblade(a, psi, inverse=True) == pytest.approx(q, abs=1e-13)
    assert not np.iscomplexobj(mb.multiblade(q.real, psi))
    assert a[:, 0] == pytest.approx(q.mean(axis=1))


def test_a_tilted_disc_in_fixed_axes():
    """Blades that follow a plane standing still in the fixed frame have constant cosine and sine coordinates."""
    psi = 2 * np.pi * np.arange(3) / 3 + np.linspace(0, 9, 50)[:, None]
    a = mb.multiblade(0.2 + 0.7 * np.cos(psi) - 0.4 * np.sin(psi), psi)
    assert a == pytest.approx(np.broadcast_to([0.2, 0.7, -0.4], (50, 3)), abs=1e-13)


def test_families():
    """Blade i + 1 a third of a turn further round and later in phase: forward, seen at f + speed / 2 pi."""
    phase = np.exp(-2j * np.pi * np.arange(3) / 3)
    shape = np.stack([np.ones(3), phase, phase.conj(), np.zeros(3)], axis=1).astype(complex)
    shape = np.concatenate([shape, [[0, 0, 0, 1.0]]])
    fake = types.SimpleNamespace(
        shape=shape,
        eigenvalue=2j * np.pi * np.array([1.0, 2.0, 2.0, 5.0]),
        coordinates=["a.q1", "b.q1", "c.q1", "hub.x"],
    )
    found = mb.rotor_modes(fake, ["a", "b", "c"], speed=2 * np.pi * 0.3)
    assert found.family == ("collective", "forward", "backward", "hub")
    assert found.fixed == pytest.approx([1.0, 2.3, 1.7, 5.0])
    assert found.share[:3].max(axis=1) == pytest.approx(1.0)
    # the same wave in time: cos(omega t - 2 pi i / 3) of blades at psi_i = 2 pi i / 3 + speed t
    t = np.linspace(0, 20, 4001)
    psi = 2 * np.pi * np.arange(3) / 3 + 2 * np.pi * 0.3 * t[:, None]
    fixed = mb.multiblade((shape[:3, 1] * np.exp(4j * np.pi * t[:, None])).real, psi)[:, 1]
    spectrum = np.abs(np.fft.rfft(fixed[:-1]))
    assert np.fft.rfftfreq(4000, t[1])[np.argmax(spectrum)] == pytest.approx(2.3, abs=0.03)
    assert "forward" in str(found) and "q1" in str(found)


@pytest.mark.parametrize(
    "words, call",
    {
        "at least 2": lambda: mb.multiblade([1.0], [0.0]),
        "azimuth must end in": lambda: mb.multiblade([1.0, 2, 3], 0.0),
        "evenly spaced": lambda: mb.multiblade([1.0, 2, 3], [0.0, 1.0, 2.0]),
        "NaN": lambda: mb.multiblade([1.0, np.nan, 3], [0.0, 1.0, 2.0]),
        "must be flexible bodies": lambda: mb.rotor_modes(mb.modes(mb.examples.rotor()), ["disc", "housing"], 1.0),
        "speed must be a finite number": lambda: mb.rotor_modes(None, ["a", "b"], [1.0, 2.0]),
        "must be a list of names": lambda: mb.rotor_modes(None, 3, 1.0),
    }.items(),
)
def test_bad_input(words, call):
    with pytest.raises(mb.ModelError, match=words):
        call()
