"""Craig-Bampton bodies: those of a beam's own matrices are the beam, sparse matrices, bad input."""

from __future__ import annotations

import mbrs as mb
import numpy as np
import pytest
from beam_meshes import fem, full_section, plain_section
from mbrs.flexible import beam, craig_bampton


def own_and_reduced(fixed, n):
    """A beam without u and rx, and the Craig-Bampton body of the same finite elements, its signs made the same."""
    grid, M, K, at = fem(plain_section, n)
    stations = dict(mass=[2.0, 0.8], EI_flap=[30.0, 20.4], EI_edge=90.0, inertia_flap=1e-6, inertia_edge=2e-6)
    attach = ["tip"] if fixed else ["root", "tip"]
    b = beam([0.0, 1.2], **stations, twist=[0.0, 0.24], attach=attach, elements=n, modes=6, fixed=fixed)
    KG = None if fixed is None else {i: grid.tensioned(_tension(grid, f)) for i, f in ((0, (0, 1)), (3, (1, 0)))}
    c = craig_bampton(M, K, {"root": 0, "tip": n}, positions=at, modes=6, fixed=fixed, KG=KG)
    signs = np.sign(np.einsum("ank,ank->k", c.node_shape, b.node_shape))
    return b, c, signs


@pytest.mark.parametrize("fixed", ["root", None])
def test_craig_bampton_of_a_beams_own_matrices_is_the_beam(fixed):
    b, c, signs = own_and_reduced(fixed, 24)
    assert c.mass == pytest.approx(b.mass, rel=1e-12) and c.com == pytest.approx(b.com, rel=1e-12)
    assert c.inertia == pytest.approx(b.inertia, rel=1e-9)
    assert b.n_modes == c.n_modes == 10
    assert c.frequencies() == pytest.approx(b.frequencies(), rel=1e-8)
    shape = b.node_shape[list(map(b.node, c.nodes))]
    assert signs * c.node_shape == pytest.approx(shape, abs=1e-6 * np.abs(shape).max())
    assert signs * c.S == pytest.approx(b.S, abs=1e-7 * b.mass)
    mine, theirs = signs[:, None, None] * c.P1, b.P1
    assert mine - np.swapaxes(mine, 1, 2) == pytest.approx(theirs - np.swapaxes(theirs, 1, 2), abs=1e-7 * b.mass)
    assert np.trace(c.P2, axis1=2, axis2=3) == pytest.approx(np.eye(10), abs=1e-9)
    if fixed:
        # the mesh has no sections that turn: W_xx and a0 alone
        assert signs[:, None] * signs * c.KG[:4] == pytest.approx(b.KG[:4], abs=1e-7 * np.abs(b.KG).max())
    else:
        assert np.abs(c.S).max() < 1e-7, "mean axes"


@pytest.mark.some(1)
@pytest.mark.parametrize("fixed", ["root", None])
def test_what_a_mass_matrix_does_not_tell_comes_with_the_mesh(fixed):
    """P1 and P2 of craig_bampton: errors of second order in the element length."""
    errors = []
    for n in (12, 24, 48):
        b, c, signs = own_and_reduced(fixed, n)
        P2 = signs[:, None, None, None] * signs[:, None, None] * c.P2
        errors.append([np.abs(signs[:, None, None] * c.P1 - b.P1).max(), np.abs(P2 - b.P2).max()])
    print(f"fixed={fixed}: errors of P1 and P2 with 12, 24, 48 elements", errors)
    order = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    assert np.all(order > 1.7)


def _tension(grid, field):
    from mbrs.flexible._integrals import _outboard

    outer = _outboard(grid, list(field))
    return np.array([-outer(p.x) for p in grid.points])


def test_craig_bampton_sparse_is_dense_and_large_ones_run():
    import scipy.sparse as sp

    _, M, K, at = fem(full_section)
    dense = craig_bampton(M, K, {"root": 0, "tip": 24}, positions=at, modes=4, fixed="root")
    sparse = craig_bampton(
        sp.csr_matrix(M), sp.coo_matrix(K), {"root": 0, "tip": 24}, positions=at, modes=4, fixed="root"
    )
    assert pytest.approx(dense.K, rel=1e-9) == sparse.K
    _, M, K, at = fem(full_section, 280)  # 1686 freedoms: the sparse route
    large = craig_bampton(
        sp.csr_matrix(M), sp.csr_matrix(K), {"root": 0, "tip": 280}, positions=at, modes=4, fixed="root"
    )
    assert large.frequencies()[:2] == pytest.approx(dense.frequencies()[:2], rel=1e-5)
    assert np.array_equal(
        large.K,
        craig_bampton(
            sp.csr_matrix(M), sp.csr_matrix(K), {"root": 0, "tip": 280}, positions=at, modes=4, fixed="root"
        ).K,
    )


def bad_craig_bampton(change):
    _, M, K, at = fem(full_section, 4)
    given = dict(M=M, K=K, nodes={"root": 0, "tip": 4}, positions=at, modes=2)
    given.update(change(given))
    return craig_bampton(given.pop("M"), given.pop("K"), given.pop("nodes"), **given)


BAD_MATRICES = {
    r"K must be \(30, 30\)": lambda g: dict(K=np.eye(6)),
    "M must be symmetric": lambda g: dict(M=g["M"] + np.triu(np.ones((30, 30)), 1)),
    "K resists the rigid translation along x": lambda g: dict(K=g["K"] + 100 * np.eye(30)),
    "nodes must map names": lambda g: dict(nodes=[0, 4]),
    "the index of node 'tip'": lambda g: dict(nodes={"tip": 7}),
    "two names for one node": lambda g: dict(nodes={"a": 0, "b": 0}),
    "fixed must name one of the nodes": lambda g: dict(fixed="middle"),
    "positions must be": lambda g: dict(positions=np.zeros(5)),
    "KG must map": lambda g: dict(KG=[1.0]),
    "same positive mass": lambda g: dict(M=np.diag([1.0, 2, 3, 1, 1, 1] * 5)),
    "contains NaN": lambda g: dict(M=np.full((30, 30), np.nan)),
}


@pytest.mark.parametrize("words", BAD_MATRICES)
def test_bad_matrices(words):
    assert bad_craig_bampton(lambda g: {}).n_modes == 8
    with pytest.raises(mb.ModelError, match=words):
        bad_craig_bampton(BAD_MATRICES[words])


def test_a_part_that_is_attached_to_nothing():
    K, M = np.zeros((18, 18)), np.eye(18)
    K[:12, :12] = np.kron([[1.0, -1.0], [-1.0, 1.0]], np.eye(6))
    K[12:, 12:] = 1e-300 * np.eye(6)
    with pytest.raises((mb.SingularError, mb.ModelError)):
        craig_bampton(M, K, {"a": 0, "b": 1}, positions=np.zeros((3, 3)), modes=1)
