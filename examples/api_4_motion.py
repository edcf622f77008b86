"""Motion in time on one page: a four-bar."""

import numpy as np
import mbrs as mb

m = mb.examples.four_bar()

traj = mb.simulate(m, t=10.0, rtol=1e-7)                       # method chosen from what the scene contains; t: a number (accepted steps, last exactly t) or an array of times
traj = mb.simulate(m, t=10.0, method="bdf-bfgs", step=1e-3)    # also "generalized-alpha", "ali3p", "bdf", "explicit"; every method takes rtol or step
traj.t                                                         # (n_t,)
traj.position("crank"); traj.velocity("crank")                 # (n_t, 3) world
traj.orientation("crank"); traj.angular_velocity("crank")      # (n_t, 4) scalar first; (n_t, 3) world
traj.joint("A"); traj.reaction("A"); traj.point("P2")          # joint coordinate, continuous over turns; wrench; a marker
traj.energy; traj.error; traj.stats; traj.plot(); traj.animate("run.html")   # energy: (n_t,) total
fun, x0 = lambda x: x**2 - np.array([2.0, 3.0]), [1.0, 1.0]
sol = mb.root(fun, x0, method="inverse-bfgs")                  # the derivative-free solver by itself; SciPy's OptimizeResult
print(traj)
print(sol)
