"""Gradients of a ball that bounces on a stiff spring, against closed forms."""

import pickle
import warnings

import mbrs as mb
import numpy as np
import pytest
from bouncing_balls import Ball, Thrown
from mbrs.errors import KinkWarning

# rounding of the place of a kink: over the fall it changes a gradient by so many times stiffness over weight per height
PLACED = 16 * np.finfo(float).eps


CASES = [
    ("explicit", {}),
    ("auto", {}),
    ("radau", {}),
    ("bdf", {}),
    ("generalized-alpha", {"rtol": 1e-4}),
    ("ali3p", {"rtol": 1e-4}),
]


def check(ball, scheme, steps, bound):
    m = ball.model()
    for method in ("direct", "adjoint"):
        with warnings.catch_warnings():
            warnings.simplefilter("error", KinkWarning)
            off, found = ball.off(m, scheme, method, **steps)
        print(f"{scheme} {method} {steps}: {off:.1e}, said {found.error:.1e}, {len(found.t) - 1} steps, {found.status}")
        asked = 0.3 if "step" in steps else np.sqrt(steps.get("rtol", 1e-7))
        assert found.status == ("converged" if found.error <= asked else "unresolved")
        assert off < bound
        # where errors of bounces cancel the difference to a finer motion says less
        chance = 0.02 * steps.get("rtol", 0.0)
        assert off <= 3.0 * found.error + PLACED * ball.stiff + chance


@pytest.mark.some(3)
@pytest.mark.parametrize("stiff", [1e3, 1e5])
@pytest.mark.parametrize("scheme", ["explicit", "auto", "radau"])
def test_the_gradient_behind_a_bounce(scheme, stiff):
    check(Ball(1, stiff, damped=False, bounces=1), scheme, {}, 1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(8))
def test_gradients_behind_bounces_on_any_spring(seed):
    ball = Ball(seed)
    for scheme, steps in CASES:
        # a contact multiplies errors by its stiffness: what lower orders leave is told by the estimate alone
        bound = 1e-4 if scheme in ("explicit", "auto", "radau") else np.inf
        if ball.stiff < 1e5 or scheme not in ("ali3p", "generalized-alpha"):
            check(ball, scheme, steps, bound)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("scheme", ["explicit", "radau", "bdf", "generalized-alpha"])
def test_fixed_steps_behind_bounces(scheme, seed):
    """Steps shorter than the contacts: of about a sixth of them, and of a twelfth."""
    ball = Ball(seed, stiff=10.0 ** (3 + 0.25 * seed), bounces=1)
    mass, k = ball.values["ball.mass"], ball.values["rail.law[0]"]
    for parts in (6, 12):
        check(ball, scheme, {"step": np.pi / np.sqrt(k / mass) / parts}, np.inf)


@pytest.mark.parametrize("scheme", ["ali3p", "bdf", "explicit"])
@pytest.mark.parametrize("first", ["status", "error", None])
def test_what_errs_by_more_than_was_asked_is_not_called_converged(scheme, first):
    """Whatever is read first; a file tells what was known when it was saved."""
    ball = Ball(3, 1e6, damped=False, bounces=1)
    off, found = ball.off(ball.model(), scheme, "direct", rtol=1e-3)
    if first is not None:
        getattr(found, first)
    kept = pickle.loads(pickle.dumps(found))
    good = scheme != "bdf"
    assert (off < 1e-3) == good
    assert found.status == ("converged" if good else "unresolved")
    assert kept.status == (found.status if first else "computed")


def by_mass(ball, law, scheme="explicit", **steps):
    objective = mb.Final(lambda s: sum(float(a) * x for a, x in zip(ball.axis, s.position("ball"), strict=True)))
    return mb.gradient(ball.model(law), objective, "ball.mass", t=ball.end, scheme=scheme, **steps)


@pytest.mark.parametrize("apart", [0.0, 1e-15, 1e-12, 1e-9])
def test_stops_at_one_place_are_one_stop(apart):
    ball = Ball(2, 1e4, damped=False, bounces=1)
    _, k, drop, _ = ball.values.values()
    both = by_mass(ball, [mb.Gap(0.3 * k, drop), mb.Gap(0.7 * k, drop * (1 + apart))])
    assert both.status == "converged"
    assert both.gradient == pytest.approx(ball.exact()[0], rel=1e-5)


def test_a_power_that_has_no_value_beyond_its_kink():
    ball = Ball(3, 1e4, damped=False, bounces=1)
    _, k, drop, _ = ball.values.values()
    k /= np.sqrt(ball.length)
    found = [
        by_mass(ball, law, rtol=1e-9)
        for law in (mb.Hertz(k, 1.5, drop), mb.FunctionLaw(lambda t, u, v: k * np.maximum(u - drop, 0.0) ** 1.5))
    ]
    assert all(0.0 < f.error < 1e-4 and not f.kinks for f in found)
    assert found[0].gradient == pytest.approx(found[1].gradient, rel=1e-4)


def test_a_dashpot_that_begins_with_the_contact_jumps():
    ball = Ball(4, 1e4, damped=False, bounces=1)
    mass, k, drop, _ = ball.values.values()
    c = 0.2 * np.sqrt(k * mass)
    law = mb.FunctionLaw(lambda t, u, v: np.where(u > drop, k * (u - drop) + c * v, 0.0))
    with pytest.warns(KinkWarning, match="its force jumps"):
        assert by_mass(ball, law).status == "kinks"


@pytest.mark.parametrize("seed", range(4))
def test_a_small_jump_is_one_and_a_stiff_contact_none(seed):
    """A five hundredth of the weight, where the contact begins; and a spring of 1e10 weights over the height."""
    soft, stiff = (Ball(seed, k, damped=False, bounces=1) for k in (1e3, 1e10))

    def law(ball, jump):
        mass, k, drop, _ = ball.values.values()
        return mb.FunctionLaw(lambda t, u, v: np.where(u > drop, k * (u - drop) + jump * mass * ball.g, 0.0))

    with pytest.warns(KinkWarning, match="its force jumps"):
        assert by_mass(soft, law(soft, 2e-3)).status == "kinks"
    found = by_mass(stiff, law(stiff, 0.0))
    assert not found.kinks and found.gradient == pytest.approx(stiff.exact()[0], rel=3 * found.error)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(("scheme", "beyond"), [("explicit", 3e-7), ("radau", 3e-7)])
def test_a_stop_that_is_hardly_touched_within_a_step(scheme, beyond, seed):
    """By a part of the length that changes the motion by its root, and the derivative by all of it."""
    ball = Thrown(seed, beyond)
    off, _ = ball.off(ball.model(), scheme, "direct")
    assert off < 1e-3


@pytest.mark.some(2)
@pytest.mark.parametrize("scheme", ["explicit", "radau", "bdf", "generalized-alpha"])
def test_a_motion_that_begins_on_its_kink(scheme):
    """It goes to either side, or rests there: then there is no derivative."""
    w, t, x = 5.0, 0.4, mb.Final(lambda s: s.position("b")[0])
    for speed, exact in ((0.7, 0.7 * (t * np.cos(w * t) - np.sin(w * t) / w) / 4.0), (-0.7, 0.0), (0.0, None)):
        m = mb.Model("stop")
        b = m.body("b", mass=2.0, inertia=(1, 1, 1), at=(0, 0, 0), velocity=(speed, 0, 0))
        m.prismatic("rail", m.ground, b, at=(0, 0, 0), axis="x", law=mb.Gap(2.0 * w**2, 0.0))
        with warnings.catch_warnings():
            warnings.simplefilter("error" if exact is not None else "ignore")
            found = mb.gradient(m, x, "b.mass", t=t, scheme=scheme, step=1e-3)
        assert found.status == ("kinks" if exact is None else "converged")
        # x = v/w sin(w t) of w^2 = k/m
        assert exact is None or found.gradient == pytest.approx(-exact, abs=1e-5)


if __name__ == "__main__":
    import sys
    import time

    for seed in range(*map(int, sys.argv[1:3])):
        ball = Ball(seed)
        m = ball.model()
        print(
            seed, f"stiff {ball.values['rail.law[0]'] * ball.length / ball.values['ball.mass'] / ball.g:.1e}", end=" "
        )
        print(f"end {ball.end / ball.fall:.2f} falls, c {ball.values['rail.c']:.1e}", flush=True)
        for scheme, steps in CASES:
            if len(sys.argv) > 3 and scheme not in sys.argv[3:]:
                continue
            for method in ("direct", "adjoint"):
                begin = time.time()
                try:
                    off, found = ball.off(m, scheme, method, **steps)
                    bad = "BAD" if off > 3 * found.error + 1e-9 and found.status == "converged" else ""
                    said = f"{off:.1e} / {found.error:.1e} {found.status} n {len(found.t) - 1} {bad}"
                except Exception as e:
                    said = f"{type(e).__name__} {str(e)[:150]}"
                print("   ", scheme, method, said, f"{time.time() - begin:.1f} s", flush=True)
