"""Modes, transfer function and design sensitivity of an isolator. Writes modes.html here."""

import numpy as np
import mbrs as mb

m = mb.Model("isolator")                                  # no gravity: the closed form is exact
p = m.body("payload", mass=20.0, inertia=(0.15, 0.15, 0.15), at=(0, 0, 0.1))
k = m.parameter("k_leg", 1e5)                             # a design variable used six times
c = m.parameter("c_leg", 30.0)
for i, (a, b) in enumerate(mb.examples.cubic_hexapod_points(edge=0.2, centre=(0, 0, 0.1))):
    m.spring_damper(f"leg{i}", m.ground, p, at=(a, b), k=k, c=c)

print(mb.effects(m))
modes = mb.modes(m)             # mb.modes(m, n=20): the 20 lowest; shift= for those near a frequency
print(modes)                    # f_n, f_d, zeta, kind, repeated group, dominant body, residual
modes.frequency                 # (n,) |s|/2pi, Hz; n = degrees of freedom, ascending; 0 for rigid modes
modes.damping                   # (n,) -Re s/|s|; nan for rigid modes
modes.eigenvalue                # (n,) complex, rad/s: of each pair the root with Im > 0, of a real pair the root with the larger real part
modes.roots                     # all of them; 2n unless velocity constraints make it fewer
modes.shape                     # (dof, n), rows are the model's minimal coordinates; normalised by docs/theory.md (6.3)
modes.body_shape("payload")     # (6, n) complex motion of the body's origin
modes.groups                    # repeated eigenvalues
modes.animate("modes.html")     # one self-contained page

s = mb.sensitivity(modes, ["k_leg", "c_leg", "payload.mass", "leg0.at_b[2]"])
s.frequency                     # (n, 4) d f_n / d p, along each parameter alone; also s.damping, s.eigenvalue, s.shape
s.group(0).matrices             # repeated group: (4, g, g); s.directional(dp) for a combined change

h = mb.frf(m, inputs=p.force("z"), outputs=p.motion("z"), frequency=np.linspace(1, 200, 2000), kind="receptance")
h.value                         # (n_out, n_in, n_freq) complex
mb.sensitivity(h, ["k_leg"]).value
t = mb.frf(m, inputs=mb.base_motion("z"), outputs=p.motion("z"), frequency=(1, 200), kind="transmissibility")
y = mb.response(m, t=np.linspace(0, 1, 2001), loads={p.force("z"): lambda t: np.sin(60 * t)}, outputs=p.motion("z"))
