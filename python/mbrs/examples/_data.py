"""Constants shared by the examples. All of them are invented: the source of the geometry gives none
(docs/theory.md (23.2) to (23.4)).
"""

# One body of a chain, tree or ladder: kg, kg m2.
LATTICE_MASS = 1.0
LATTICE_INERTIA = (4.0e-3, 3.0e-3, 5.0e-3)
# Six-component spring-damper between two jointed bodies: N/m, N m/rad; N s/m, N m s/rad.
LATTICE_K = (2.0e4, 2.5e4, 3.0e4, 40.0, 50.0, 60.0)
LATTICE_C = (10.0, 10.0, 10.0, 0.01, 0.01, 0.01)
