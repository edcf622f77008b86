"""B' and B'': the sizes that the source of the reduction counts, and the reduction itself from matrices of free bodies."""

from __future__ import annotations

import mbrs as mb
import numpy as np
import pytest
from random_models import random_loop, random_tree


def models():
    yield "ladder R", mb.examples.ladder(3, "R"), (54, 45, 60, 6)
    yield "ladder S", mb.examples.ladder(3, "S"), (54, 27, 36, 9)
    yield "tree", mb.examples.tree(4, "C"), (90, 60, 60, 0)
    yield "four-bar", mb.examples.four_bar(), (18, 15, 20, 2)
    yield "stewart", mb.examples.stewart_platform(), None
    for seed in range(3):
        rng = np.random.default_rng(seed)
        yield f"loop {seed}", random_loop(rng, ("revolute", "universal", "spherical", "cylindrical")), None
        yield f"tree {seed}", random_tree(rng, 5, ("revolute", "universal", "spherical", "cylindrical")), None


@pytest.mark.filterwarnings("ignore::mbrs.errors.MbrsWarning")
@pytest.mark.parametrize("name, m, sizes", [pytest.param(*case, id=case[0]) for case in models()])
def test_the_mass_matrix_is_reduced_twice(name, m, sizes):
    system, lin = mb.System(m), mb.linearize(m)
    n, p, q, solved = 6 * len(m.bodies), system.n_open, system.n_constraints, system.rank
    assert (n - p, solved) == (system.n_tree, n - p - system.dof) and p <= n - system.dof <= q
    assert sizes is None or (n, p, q, solved) == sizes
    assert lin.B_open.shape == (n, system.n_tree) and lin.B_cut.shape == (system.n_tree, system.dof)
    # M of free bodies, place by place, without the package
    M = np.zeros((n, n))
    for i, body in enumerate(lin.bodies):
        R, J = lin.poses["rotation"][i], np.array(m.value(f"{body}.inertia"))
        J = np.diag(J) if J.ndim == 1 else J
        mass, arm = m.value(f"{body}.mass"), np.cross(np.eye(3), R @ np.asarray(m.value(f"{body}.com")))
        block = np.block([[mass * np.eye(3), mass * arm.T], [mass * arm, R @ J @ R.T + mass * arm.T @ arm]])
        M[6 * i : 6 * i + 6, 6 * i : 6 * i + 6] = block
    reduced = lin.B_cut.T @ (lin.B_open.T @ M @ lin.B_open) @ lin.B_cut
    scale = np.sqrt(np.outer(np.diag(lin.M), np.diag(lin.M)))
    assert np.abs((reduced - lin.M) / scale).max() < 1e-11
    twist = np.abs(lin.B_open) @ np.abs(lin.B_cut)
    assert np.abs((lin.B_open @ lin.B_cut - lin.T) / np.maximum(twist, 1e-3 * twist.max())).max() < 1e-11
    assert f"loops solve for {n} - p - m = {solved}" in str(system)


def test_modal_coordinates_count():
    m = mb.examples.slider_crank(stiffness=900.0)
    system, lin = mb.System(m), mb.linearize(m)
    assert system.n_open + system.n_tree == 6 * len(m.bodies) + lin.modal_map.shape[0]
    assert np.abs(lin.B_open @ lin.B_cut - lin.T).max() < 1e-10 * np.abs(lin.T).max()
