"""Constants shared by the examples, invented where a comment does not say otherwise: those of the source of the geometry are
lost (docs/theory.md (23.2) to (23.4)).
"""

# One body of a chain, tree or ladder: kg, kg m2.
LATTICE_MASS = 1.0
LATTICE_INERTIA = (4.0e-3, 3.0e-3, 5.0e-3)
# Six-component spring-damper between two jointed bodies: N/m, N m/rad; N s/m, N m s/rad. The damping of translation is
# printed; that of rotation, 10 N m s/deg, would overdamp every mode of the stiffnesses invented here (docs/theory.md (23.2)).
LATTICE_K = (2.0e4, 2.5e4, 3.0e4, 40.0, 50.0, 60.0)
LATTICE_C = (10.0, 10.0, 10.0, 0.01, 0.01, 0.01)
