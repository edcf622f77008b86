"""Gradients of a ball that bounces on a stiff spring, against closed forms piece by piece, differentiated by complex steps."""

import pickle
import warnings

import mbrs as mb
import numpy as np
import pytest
from mbrs.errors import KinkWarning

COMPLEX_STEP = 1e-30
# rounding of the place of a kink: over the fall it changes a gradient by so many times stiffness over weight per height
PLACED = 16 * np.finfo(float).eps


class Ball:
    """It falls along a random axis, through oil or not, in random units; the spring is up to 1e7 times as stiff as weight over height."""

    def __init__(self, seed, stiff=None, damped=None, bounces=None):
        rng = np.random.default_rng([seed, 31])
        length, mass = 10.0 ** rng.uniform(-1, 2), 10.0 ** rng.uniform(-1, 2)
        axis = rng.normal(size=3)
        self.length, self.axis = length, axis / np.linalg.norm(axis)
        self.g = length * rng.uniform(5.0, 15.0)
        self.pull, self.speed = self.g, 0.0
        drop = length * rng.uniform(0.3, 0.6)
        stiff = 10.0 ** rng.uniform(3, 7) if stiff is None else stiff
        self.stiff = stiff
        k = stiff * mass * self.g / length
        self.fall = np.sqrt(2 * drop / self.g)
        damped = bool(rng.integers(2)) if damped is None else damped
        c = mass / self.fall * rng.uniform(0.05, 0.3) if damped else 0.0
        self.at = length * rng.normal(size=3)
        self.values = {"ball.mass": mass, "rail.law[0]": k, "rail.law[1]": drop, "rail.c": c}
        self.names = [n for n in self.values if damped or n != "rail.c"]
        bounces = rng.uniform(0.6, 3.4) if bounces is None else bounces
        # in the air between two bounces, or before the first
        self.end = self.fall * (2.0 * round(bounces) + rng.uniform(-0.6, 0.6)) if bounces > 0.5 else 0.9 * self.fall

    def model(self, law=None):
        mass, k, drop, c = self.values.values()
        m = mb.Model("bouncing ball", gravity=tuple(self.pull * self.axis))
        velocity = tuple(self.speed * self.axis)
        b = m.body("ball", mass=mass, inertia=(mass * self.length**2,) * 3, at=self.at, velocity=velocity)
        m.prismatic("rail", m.ground, b, at=self.at, axis=self.axis, c=c, law=law or mb.Gap(k, drop))
        m.marker("far", m.ground, at=self.at + self.length * np.array([0.6, -0.5, 0.62]))
        return m

    def fallen(self, values):
        mass, k, drop, c = (complex(x) for x in values)
        t, u, v, held = 0.0, 0.0j, 0.0j, False
        while True:
            piece = (self.spring if held else self.air)(mass, k, drop, c, u, v)
            period = np.pi / np.sqrt(k / mass).real
            ahead = np.linspace(0.0, 1.2 * period, 400) if held else self.fall * np.geomspace(1e-9, 6.0, 2000)
            gone = [(piece(s)[0] - drop).real * (1 if held else -1) for s in ahead]
            # the first place behind the start where the distance has changed its sign
            i = next((i for i in range(2, len(gone)) if gone[i] <= 0 < gone[i - 1]), None)
            s = None if i is None else complex(0.5 * (ahead[i - 1] + ahead[i]))
            for _ in range(60 if s is not None else 0):
                position, rate = piece(s)
                s -= (position - drop) / rate
            if s is None or (t + s).real >= self.end:
                return piece(self.end - t)[0]
            (u, v), t, held = piece(s), t + s, not held

    def air(self, mass, k, drop, c, u, v):
        if c == 0:
            return lambda s: (u + v * s + 0.5 * self.g * s * s, v + self.g * s)
        rate, limit = c / mass, mass * self.g / c
        return lambda s: (
            u + limit * s + (v - limit) * (1 - np.exp(-rate * s)) / rate,
            limit + (v - limit) * np.exp(-rate * s),
        )

    def spring(self, mass, k, drop, c, u, v):
        rate, rest = c / (2 * mass), drop + mass * self.g / k
        w = np.sqrt(k / mass - rate**2)
        a, b = u - rest, (v + rate * (u - rest)) / w
        return lambda s: (
            rest + np.exp(-rate * s) * (a * np.cos(w * s) + b * np.sin(w * s)),
            np.exp(-rate * s) * ((b * w - a * rate) * np.cos(w * s) - (a * w + b * rate) * np.sin(w * s)),
        )

    def exact(self):
        known = np.array(list(self.values.values()))
        out = []
        for name in self.names:
            moved = known.astype(complex)
            i = list(self.values).index(name)
            moved[i] += 1j * COMPLEX_STEP * known[i]
            out.append(self.fallen(moved).imag / (COMPLEX_STEP * known[i]))
        return np.array(out)

    def off(self, m, scheme, method, law=None, **steps):
        """The error of the gradient over its largest effect, and the gradient."""
        objective = mb.Final(lambda s: sum(float(a) * x for a, x in zip(self.axis, s.position("ball"), strict=True)))
        found = mb.gradient(m, objective, self.names, t=self.end, scheme=scheme, method=method, **steps)
        exact, values = self.exact(), np.array([self.values[n] for n in self.names])
        return np.abs((found.gradient - exact) * values).max() / np.abs(exact * values).max(), found


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


class Thrown(Ball):
    """Thrown up against a stop of which it passes the place by a part of the length, without damping."""

    def __init__(self, seed, beyond, stiff=1e6):
        super().__init__(seed, stiff, damped=False)
        drop = self.values["rail.law[1]"]
        self.pull, self.speed = -self.g, np.sqrt(2 * self.g * (drop + beyond * self.length))
        self.end = self.speed / self.g * np.random.default_rng([seed, 41]).uniform(1.4, 1.9)

    def fallen(self, values):
        mass, k, drop, _ = values
        speed, w = np.sqrt(self.speed**2 - 2 * self.g * drop), np.sqrt(k / mass)
        t = self.end - (self.speed - speed) / self.g - 2 * np.arctan(speed * w / self.g) / w
        return drop - speed * t - 0.5 * self.g * t * t


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
