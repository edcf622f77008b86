"""Nonlinear vibration on one page: Duffing, van der Pol, two tones, and a model: a mass on a rail with a hardening spring."""

import numpy as np
import mbrs as mb

m = mb.Model("mass on a rail")
b = m.body("mass", mass=2.0, inertia=(1e-2, 1e-2, 1e-2))
m.prismatic("rail", m.ground, b, at=(0, 0, 0), axis="x", k=8e3, c=8.0, law=mb.Cubic(4e7))

duffing = mb.MechanicalSystem(M=[[1.0]], C=[[0.05]], K=[[1.0]], elements=[mb.Cubic(0.1, w=[1.0])])   # M x" + C x' + K x + w law(w.x, w.x') = f
curve = mb.frequency_response(duffing, force=[0.18], omega=(0.5, 1.6), harmonics=7)
curve.omega, curve.X            # (n,), (n, dof, 2H+1) real Fourier coefficients [a0, a1, b1, a2, b2, ...], zero-padded, built when asked for
curve.amplitude(dof=0, harmonic=1)
curve.stable                    # (n,) bool; None with stability=False; nan where it cannot be told (laws with memory)
curve.events                    # each with .kind ("fold", "branch-point", "neimark-sacker", "period-doubling"), .omega, .X; solved for, not just bracketed
curve.status, curve.error       # named stop reason; estimate from the omitted harmonics relative to the largest coefficient, (n,)
curve.plot()
one = mb.harmonic_balance(duffing, force=[0.18], omega=1.2, harmonics=7)      # a single solution
qp = mb.quasi_periodic(duffing, forces=[dict(force=[0.25], omega=2.0), dict(force=[0.25], omega=2.0 * np.sqrt(2))], harmonics=7)
qp.indices, qp.X                # (n_k, 2), (dof, 2 n_k + 1)
lc = mb.limit_cycle(mb.MechanicalSystem([[1.0]], [[-1.0]], [[1.0]], elements=[mb.VanDerPol(1.0, w=[1.0])]), harmonics=15)   # VanDerPol(mu): mu u^2 u'
lc.period, lc.error, lc.status
print(curve, one, qp, lc, sep="\n\n")
curve = mb.frequency_response(m, inputs=b.force("x"), amplitude=20.0, frequency=(1, 40), harmonics="auto", tol=1e-6)   # a multibody model, geometry linearised
print(f"\n{curve}")
