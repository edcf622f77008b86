"""Matrices of finite-element programs: OP4 and DMIG against pyyeti, Matrix Market and .mat against SciPy, and the bodies made of them."""

from __future__ import annotations

import subprocess
import sys
import warnings

import mbrs as mb
import numpy as np
import pytest
import scipy.io
import scipy.sparse as sp
from mbrs.errors import ModelError, NameNotFoundError, OmissionWarning

ENDINGS = (".op4", ".mtx", ".mat")


def system(rng, n=9, sparse=False):
    """M, C, K, G, N of different sizes and entries with all their digits."""
    root = rng.normal(size=(n, n))
    M, K = root @ root.T + n * np.eye(n), 1e7 * (np.diag(rng.random(n)) + np.ones((n, n)) / 3)
    skew = rng.normal(size=(2, n, n))
    given = dict(M=M, K=K, C=1e-3 * M + 1e-9 * K, G=skew[0] - skew[0].T, N=skew[1] - skew[1].T)
    return mb.MechanicalSystem(**{k: sp.csc_matrix(a) if sparse else a for k, a in given.items()})


def dense(a):
    return a.toarray() if sp.issparse(a) else a


def need(ending):
    if ending in (".op4", ".pch"):
        pytest.importorskip("pyyeti", reason="pip install pyyeti (with numba 230 MB)")


@pytest.mark.parametrize("sparse", [False, True])
@pytest.mark.parametrize("ending", ENDINGS)
def test_systems_come_back_to_the_last_bit(tmp_path, ending, sparse):
    need(ending)
    s = system(np.random.default_rng(1), sparse=sparse)
    again = mb.MechanicalSystem.load(s.save(tmp_path / f"plate{ending}"))
    for name in "MCKGN":
        assert np.array_equal(dense(getattr(s, name)), dense(getattr(again, name))), name


@pytest.mark.parametrize("ending", ENDINGS)
def test_large_sparse_systems_stay_sparse(tmp_path, ending):
    need(ending)
    n = 3000
    line = sp.diags([np.full(n - 1, -1.0), np.full(n, 2.0 + 1 / 3), np.full(n - 1, -1.0)], [-1, 0, 1]).tocsc()
    again = mb.MechanicalSystem.load(
        mb.MechanicalSystem(M=sp.identity(n, format="csc"), K=line).save(tmp_path / f"line{ending}")
    )
    assert again.is_sparse and abs(again.K - line).max() == 0.0 and again.C is None


@pytest.mark.parametrize("options", [{}, {"sparse": "bigmat"}, {"sparse": "nonbigmat"}, {"sparse": "dense"}])
@pytest.mark.parametrize("form", [{"binary": False}, {"binary": True, "endian": "<"}, {"binary": True, "endian": ">"}])
def test_every_form_of_op4_that_pyyeti_writes(tmp_path, form, options):
    need(".op4")
    with np.printoptions():
        from pyyeti.nastran import op4

    s = system(np.random.default_rng(2))
    op4.write(str(tmp_path / "p.op4"), {"maa": s.M, "kaa": s.K, "baa": s.C}, **form, **options)
    again = mb.MechanicalSystem.load(tmp_path / "p.op4")
    for name in "MCK":
        a, b = getattr(s, name), getattr(again, name)
        assert np.abs(dense(b) - a).max() <= 1e-12 * np.abs(a).max()


def test_what_is_written_is_read_by_the_other_program(tmp_path):
    s = system(np.random.default_rng(3))
    matlab = scipy.io.loadmat(s.save(tmp_path / "p.mat"))
    market = scipy.io.mmread((s.save(tmp_path / "p.mtx")).with_name("p.K.mtx"))
    assert np.array_equal(matlab["M"], s.M) and np.array_equal(market, s.K)
    need(".op4")
    with np.printoptions():
        from pyyeti.nastran import op4

    assert np.array_equal(op4.read(str(s.save(tmp_path / "p.op4")))["c"], s.C)


def free_frame(rng, n=5):
    """A chain of bushings between nodes in space: free to move, with masses of six freedoms each; grids 11, 14, 17, ..."""
    at = np.round(np.cumsum(rng.normal(size=(n, 3)), axis=0), 1)  # so that ten digits hold K
    M = np.zeros((6 * n, 6 * n))
    K = np.zeros_like(M)
    for i in range(n):
        m = 1.0 + rng.random()
        j = 0.01 * (1 + rng.random(3))
        M[6 * i : 6 * i + 6, 6 * i : 6 * i + 6] = np.diag([m, m, m, *j])
    for i in range(n - 1):
        d = at[i + 1] - at[i]
        cross = np.array([[0, -d[2], d[1]], [d[2], 0, -d[0]], [-d[1], d[0], 0]])
        rigid = np.block([[np.eye(3), -cross], [np.zeros((3, 3)), np.eye(3)]])
        strain = np.zeros((6, 6 * n))
        strain[:, 6 * i : 6 * i + 6], strain[:, 6 * i + 6 : 6 * i + 12] = -rigid, np.eye(6)
        K += strain.T @ np.diag([1e5, 2e5, 3e5, 1e3, 2e3, 3e3]) @ strain
    return M, K, at


def numbers(body):
    """What a body does to the outside, free of the signs of its shapes."""
    return [
        body.mass, *body.com, *np.ravel(body.inertia), *body.frequencies(),
        *np.ravel(np.einsum("nik,njk->nij", body.node_shape, body.node_shape)),
    ]  # fmt: skip


@pytest.mark.parametrize("ending", ENDINGS)
def test_craig_bampton_bodies_from_files_are_those_of_arrays(tmp_path, ending):
    need(ending)
    M, K, at = free_frame(np.random.default_rng(4))
    given = dict(nodes={"a": 0, "b": 4}, positions=at, modes=4, damping=0.01)
    path = mb.MechanicalSystem(M=M, K=K).save(tmp_path / f"frame{ending}")
    found, wanted = mb.flexible.from_file(path, **given), mb.flexible.craig_bampton(M, K, **given)
    assert np.allclose(numbers(found), numbers(wanted), rtol=1e-12, atol=1e-12)


def punch(path, matrices, index):
    import pandas as pd

    with np.printoptions():
        from pyyeti.nastran import bulk

    with path.open("w") as file:
        bulk.wtdmig(file, {name: pd.DataFrame(a, index=index, columns=index) for name, a in matrices.items()})


def test_bodies_from_punch_files(tmp_path):
    """DMIG holds ten digits; the mass has entries for two freedoms of some nodes only."""
    need(".pch")
    pandas = pytest.importorskip("pandas")
    M, K, at = free_frame(np.random.default_rng(5))
    M, K = np.round(M, 6), np.round(K, 6)
    grids = [11 + 3 * i for i in range(5)]
    index = pandas.MultiIndex.from_product([grids, range(1, 7)])
    path = tmp_path / "frame.pch"
    punch(path, {"maa": M, "kaa": K}, index)
    assert "DMIG" in path.read_text()
    s = mb.MechanicalSystem.load(path)
    assert np.abs(s.K - K).max() <= 1e-9 * np.abs(K).max() and s.coordinates[6:8] == ("14:1", "14:2")
    wanted = mb.flexible.craig_bampton(s.M, s.K, {"a": 0, "b": 4}, positions=at, modes=3)
    for where in (at, dict(zip(grids, at, strict=True))):
        found = mb.flexible.from_file(path, {"a": 11, "b": 23}, positions=where, modes=3)
        assert np.allclose(numbers(found), numbers(wanted), rtol=1e-12, atol=1e-12)
    with pytest.raises(NameNotFoundError, match=r"no grid 12 in the file; it has 11, 14"):
        mb.flexible.from_file(path, {"a": 12}, positions=at)


def test_punch_matrices_over_different_freedoms_share_one_list(tmp_path):
    need(".pch")
    pandas = pytest.importorskip("pandas")
    path = tmp_path / "two.pch"
    with path.open("w") as file:
        with np.printoptions():
            from pyyeti.nastran import bulk

        one = pandas.MultiIndex.from_tuples([(3, 1), (7, 2)])
        two = pandas.MultiIndex.from_tuples([(3, 1), (5, 0), (7, 2)])
        M, K = np.array([[2.0, 0.5], [0.5, 3.0]]), np.array([[4.0, 1.0, 0.0], [1.0, 5.0, 2.0], [0.0, 2.0, 6.0]])
        bulk.wtdmig(file, {"m": pandas.DataFrame(M, one, one), "k": pandas.DataFrame(K, two, two)})
    s = mb.MechanicalSystem.load(path)
    assert s.coordinates == ("3:1", "5:0", "7:2")
    assert np.array_equal(s.M, [[2, 0, 0.5], [0, 0, 0], [0.5, 0, 3]]) and np.array_equal(s.K, K)


def test_names_of_matrices(tmp_path):
    a = np.array([[2.0, 0.1], [0.1, 3.0]])
    path = tmp_path / "p.mat"
    scipy.io.savemat(
        path, {"MAA": a, "stiff": 3 * a, "x": 7 * a, "text": "no matrix", "cells": np.array([1, "a"], dtype=object)}
    )
    s = mb.MechanicalSystem.load(path)
    assert np.array_equal(s.M, a) and np.array_equal(s.K, 3 * a) and s.C is None
    s = mb.MechanicalSystem.load(path, names={"K": "X", "C": "stiff"})
    assert np.array_equal(s.K, 7 * a) and np.array_equal(s.C, 3 * a)
    with pytest.raises(NameNotFoundError, match=r"p\.mat has no matrix 'y'; it has MAA, stiff, x"):
        mb.MechanicalSystem.load(path, names={"K": "y"})
    with pytest.raises(ModelError, match="names= has Q; known are M, C, K, G, N"):
        mb.MechanicalSystem.load(path, names={"Q": "x"})
    scipy.io.savemat(path, {"MAA": a, "M": a, "K": a})
    with pytest.raises(
        NameNotFoundError, match=r'several matrices that may be M: it has MAA, M, K; give names=\{"M": name\}'
    ):
        mb.MechanicalSystem.load(path)
    scipy.io.savemat(path, {"M": a})
    with pytest.raises(NameNotFoundError, match="no matrices that may be K"):
        mb.MechanicalSystem.load(path)


def test_one_file_for_each_matrix(tmp_path):
    a = np.array([[2.0, 0.1], [0.1, 3.0]])
    scipy.io.mmwrite(tmp_path / "mass.mtx", a)
    scipy.io.mmwrite(tmp_path / "spring.mtx", sp.coo_matrix(5 * a))
    s = mb.MechanicalSystem.load({"M": tmp_path / "mass.mtx", "K": tmp_path / "spring.mtx"})
    assert np.array_equal(s.M, a) and np.array_equal(s.K, 5 * a)


def test_what_files_of_matrices_cannot_hold(tmp_path):
    a = np.eye(2)
    s = mb.MechanicalSystem(M=a, K=a, elements=[mb.Cubic(1.0, w=[1.0, 0.0])], coordinates=["left", "x1"])
    with pytest.warns(OmissionWarning, match="nonlinear elements: Cubic; names of coordinates: left"):
        s.save(tmp_path / "p.mat")
    with pytest.raises(ModelError, match=r"the ending '\.foo' of a matrices|known are \.mat, \.mtx, \.op4"):
        s.save(tmp_path / "p.foo")
    with pytest.raises(ModelError, match=r"is only read; known are \.mat, \.mtx, \.op4"):
        s.save(tmp_path / "p.pch")
    with warnings.catch_warnings():
        warnings.simplefilter("error", OmissionWarning)
        mb.MechanicalSystem(M=a, K=a).save(tmp_path / "p.mat")


def test_matrices_that_are_not_real_or_not_finite(tmp_path):
    a = np.eye(2)
    path = tmp_path / "p.mat"
    for wrong, message in ((a * (1 + 1j), "'K' is complex"), (a * np.inf, "'K' has entries that are not finite")):
        scipy.io.savemat(path, {"M": a, "K": wrong})
        with pytest.raises(ModelError, match=f"p.mat: matrix {message}"):
            mb.MechanicalSystem.load(path)
    scipy.io.savemat(path, {"M": a, "K": a + 0j})
    assert mb.MechanicalSystem.load(path).K.dtype == float


@pytest.mark.parametrize("symmetry", ["general", "symmetric", "skew-symmetric"])
@pytest.mark.parametrize("field", ["real", "integer"])
@pytest.mark.parametrize("sparse", [False, True])
def test_every_kind_of_matrix_market_that_scipy_writes(tmp_path, symmetry, field, sparse):
    rng = np.random.default_rng(6)
    a = rng.integers(-9, 9, size=(7, 7)) * 1.0 if field == "integer" else rng.normal(size=(7, 7))
    a = {"general": a, "symmetric": a + a.T, "skew-symmetric": a - a.T}[symmetry]
    scipy.io.mmwrite(
        tmp_path / "a.mtx",
        sp.coo_matrix(a) if sparse else a,
        field=field,
        symmetry=symmetry,
        comment="of a test",
        precision=17,
    )
    assert symmetry in (tmp_path / "a.mtx").read_text().splitlines()[0]
    found = mb.MechanicalSystem.load({"M": tmp_path / "a.mtx", "K": tmp_path / "a.mtx"}).K
    assert np.array_equal(found, a) and np.array_equal(found, dense(scipy.io.mmread(tmp_path / "a.mtx")))


@pytest.mark.parametrize("compressed", [False, True])
@pytest.mark.parametrize("dtype", ["f8", "f4", "i1", "u2", "i4", "i8", "u8", "?", "c16"])
def test_every_class_of_numbers_in_matlab_files(tmp_path, dtype, compressed):
    rng = np.random.default_rng(7)
    a = (rng.random((6, 6)) * 5).astype(dtype)
    thin = sp.random(6, 6, 0.4, format="csc", random_state=1)
    thin.data = thin.data * 9 - 4
    path = tmp_path / "a.mat"
    others = {
        "s": {"x": 1.0},
        "text": "abc",
        "cells": np.array([1, "a"], dtype=object),
        "cube": np.zeros((2, 2, 2)),
        "K": thin,
        "M": a,
    }
    scipy.io.savemat(path, others, do_compression=compressed)
    found = mb.MechanicalSystem.load(path)
    assert np.array_equal(found.M, scipy.io.loadmat(path)["M"].astype(float)) and np.array_equal(
        found.K, thin.toarray()
    )


@pytest.mark.slow  # imports numba
def test_reading_leaves_the_print_options_of_numpy(tmp_path):
    """The package that reads OP4 and DMIG changes them when it is imported."""
    pytest.importorskip("pyyeti", reason="the extra nastran is not installed")
    code = (
        "import numpy as np, mbrs as mb\n"
        "before = np.get_printoptions()\n"
        "mb.MechanicalSystem(np.eye(2), K=np.diag([2.0, 3.0])).save('s.op4')\n"
        "mb.MechanicalSystem.load('s.op4')\n"
        "assert np.get_printoptions() == before"
    )
    subprocess.run([sys.executable, "-c", code], cwd=tmp_path, check=True, timeout=120)
