"""Tables of designs: what each way of sampling promises, over random ranges, sizes and units."""

from __future__ import annotations

import mbrs as mb
import numpy as np
import pytest
from mbrs.design.gaussian import cholesky
from scipy import stats

SAMPLERS = {
    "latin_hypercube": mb.design.latin_hypercube,
    "sobol": mb.design.sobol,
    "halton": mb.design.halton,
}


def random_ranges(rng):
    """Ranges of any sign and size, some of them a few roundings wide."""
    ranges = {}
    for j in range(rng.integers(1, 6)):
        low = rng.normal() * 10.0 ** rng.uniform(-12, 12)
        ranges[f"b{j}.at[{j % 3}]"] = (low, low + abs(low) * 10.0 ** rng.uniform(-14, 2))
    return ranges


@pytest.mark.parametrize("name", SAMPLERS)
@pytest.mark.parametrize("seed", range(8))
def test_points_lie_in_their_ranges_and_a_seed_gives_the_same_bits(name, seed):
    rng = np.random.default_rng(seed)
    ranges, n = random_ranges(rng), 2 ** int(rng.integers(0, 8))
    designs = SAMPLERS[name](ranges, n, seed=seed)
    assert designs.values.shape == (n, len(ranges)) and designs.names == tuple(ranges)
    for key, (low, high) in ranges.items():
        assert np.all(designs[key] >= low) and np.all(designs[key] <= high)
    assert designs.values.tobytes() == SAMPLERS[name](ranges, n, seed=seed).values.tobytes()
    assert n < 4 or designs.values.tobytes() != SAMPLERS[name](ranges, n, seed=seed + 1).values.tobytes()


@pytest.mark.parametrize("seed", range(8))
def test_each_part_of_a_range_holds_one_design_of_a_latin_hypercube(seed):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 200))
    low, width = rng.normal(), rng.uniform(0.1, 7.0)
    shape = rng.uniform(0.3, 3.0)
    designs = mb.design.latin_hypercube({"a": (low, low + width), "b": stats.gamma(shape)}, n, seed=seed)
    for share in ((designs["a"] - low) / width, stats.gamma(shape).cdf(designs["b"])):
        # a point may lie on the edge of its part, to rounding
        nearest = np.sort(share) * n - np.arange(n)
        assert np.all(nearest > -1e-9) and np.all(nearest < 1.0 + 1e-9)


@pytest.mark.parametrize("n", [1, 2, 64])
def test_plain_sobol_points_begin_in_the_corner_and_fill_every_dyadic_part(n):
    designs = mb.design.sobol({"a": (-3.7, 11.3), "b": (0.7, 0.9)}, n, scramble=False)
    assert designs.point(0) == {"a": -3.7, "b": 0.7}
    for key, low, width in (("a", -3.7, 15.0), ("b", 0.7, 0.2)):
        assert sorted(np.floor((designs[key] - low) / width * n + 1e-9)) == list(range(n))


@pytest.mark.parametrize("seed", range(10))
def test_a_grid_has_every_combination_once_with_exact_corners(seed):
    rng = np.random.default_rng(seed)
    ranges = random_ranges(rng)
    levels = {name: int(rng.integers(2, 5)) for name in ranges}
    values = rng.normal(size=3)
    designs = mb.design.full_factorial({**ranges, "c": values}, levels)
    assert len(designs) == 3 * np.prod(list(levels.values()))
    assert len({row.tobytes() for row in designs.values}) == len(np.unique(designs.values, axis=0))
    for name, (low, high) in ranges.items():
        assert designs[name].min() == low and designs[name].max() == high
    assert np.array_equal(designs["c"][:3], values)
    assert designs.point(0) == {**{name: low for name, (low, _) in ranges.items()}, "c": values[0]}


def test_ranges_at_the_edge_of_the_numbers_do_not_overflow():
    designs = mb.design.latin_hypercube({"a": (-1e150, 1e150), "b": (5e-324, 1e-323)}, 50)
    assert np.isfinite(designs.values).all() and set(designs["b"]) <= {5e-324, 1e-323}


@pytest.mark.parametrize("seed", range(4))
def test_a_normal_table_has_the_moments_of_its_distribution(seed):
    rng = np.random.default_rng(seed)
    p, n = 3, 4000
    root = rng.normal(size=(p, p + 1))
    covariance = root @ root.T
    sd = np.sqrt(np.diag(covariance))
    correlation = covariance / np.outer(sd, sd)
    correlation = 0.5 * (correlation + correlation.T)
    np.fill_diagonal(correlation, 1.0)
    mean = rng.normal(size=p) * 7.0
    names = ["k", "b.mass", "c"]
    scale = 10.0 ** rng.uniform(-6, 6, p)
    designs = mb.design.normal(
        dict(zip(names, mean * scale, strict=True)), dict(zip(names, sd * scale, strict=True)), n, seed,
        correlation=correlation,
    )  # fmt: skip
    scaled = designs.values / scale
    # five standard errors of a plain sample; the hypercube does better
    assert np.all(np.abs(scaled.mean(axis=0) - mean) < 5.0 * sd / np.sqrt(n))
    found = np.corrcoef(scaled.T)
    assert np.all(np.abs(found - correlation) < 5.0 / np.sqrt(n))
    assert designs.about["covariance"] == pytest.approx(covariance * np.outer(scale, scale), rel=1e-12)
    for j in range(p):
        assert stats.kstest((scaled[:, j] - mean[j]) / sd[j], "norm").pvalue > 1e-6


@pytest.mark.parametrize("r", [1.0, -1.0])
def test_numbers_that_determine_each_other(r):
    designs = mb.design.normal({"a": 1.3, "b": -2.7}, {"a": 0.2, "b": 0.5}, 50, correlation={("b", "a"): r})
    assert (designs["b"] + 2.7) / 0.5 == pytest.approx(r * (designs["a"] - 1.3) / 0.2, abs=1e-12)


def test_correlations_that_no_distribution_has_are_refused():
    bad = np.array([[1.0, 0.9, -0.9], [0.9, 1.0, 0.9], [-0.9, 0.9, 1.0]])
    means = dict.fromkeys("abc", 1.0)
    with pytest.raises(mb.ModelError, match="semidefinite"):
        mb.design.normal(means, means, 10, correlation=bad)
    with pytest.raises(mb.ModelError, match="semidefinite"):
        mb.design.normal({"a": 1.0, "b": 1.0}, {"a": 1.0, "b": 1.0}, 10, correlation={("a", "b"): 1.001})
    rng = np.random.default_rng(3)
    for rank in (1, 2, 4, 7):
        root = rng.normal(size=(7, rank))
        covariance = root @ root.T
        size = np.sqrt(np.diag(covariance))
        correlation = covariance / np.outer(size, size)
        factor = cholesky(correlation)
        assert factor @ factor.T == pytest.approx(correlation, abs=1e-7)
        assert np.all(np.triu(factor, 1) == 0.0)


def test_truncated_normal_tables_stay_inside_and_keep_the_truncated_law():
    low, high = 0.9, 2.1
    designs = mb.design.normal({"a": 1.3, "b": 5.0}, {"a": 0.7, "b": 2.0}, 3000, bounds={"a": (low, high)})
    assert designs["a"].min() >= low and designs["a"].max() <= high
    law = stats.truncnorm((low - 1.3) / 0.7, (high - 1.3) / 0.7, loc=1.3, scale=0.7)
    assert stats.kstest(designs["a"], law.cdf).pvalue > 1e-6
    assert "covariance" not in designs.about


def test_correlated_and_truncated_agrees_with_the_conditional_density():
    """P(b > 0 | a > 0) of a standard bivariate normal is 1/2 + asin(r)/pi (Sheppard)."""
    r, n = 0.63, 20000
    designs = mb.design.normal({"a": 0.0, "b": 0.0}, {"a": 1.0, "b": 1.0}, n, correlation={("a", "b"): r},
                               bounds={"a": (0.0, 1e9)})  # fmt: skip
    assert designs["a"].min() >= 0.0
    share = 0.5 + np.arcsin(r) / np.pi
    assert abs(np.mean(designs["b"] > 0.0) - share) < 5.0 * np.sqrt(share * (1.0 - share) / n)
    with pytest.raises(mb.ModelError, match="draws lie within"):
        mb.design.normal({"a": 0.0, "b": 0.0}, {"a": 1.0, "b": 1.0}, 10, correlation={("a", "b"): r},
                         bounds={"a": (9.0, 10.0)})  # fmt: skip


def test_tables_come_back_with_every_bit_name_and_unit(tmp_path):
    pandas = pytest.importorskip("pandas")
    rng = np.random.default_rng(1)
    designs = mb.design.latin_hypercube(
        {"k leg": (5e4, 2e5), "b.at[2]": (-0.3, 0.7), "V[0,1]": (1e-9, 3e-9)}, 20, seed=3,
        units={"k leg": "N/m", "b.at[2]": "m"},
    )  # fmt: skip
    frame = designs.to_frame()
    path = designs.save(tmp_path / "designs.csv")
    for given in (frame, path, str(path), designs, frame.to_records(index=False)):
        again = mb.design.from_table(given)
        assert again.names == designs.names and again.units == ("N/m", "m", "")
        assert again.values.tobytes() == designs.values.tobytes()
    plain = mb.design.from_table({"k": rng.normal(size=3), "design": [4, 5, 6]}, units={"k": "N/m"})
    assert plain.names == ("k", "design") and plain.units == ("N/m", "")
    assert isinstance(frame, pandas.DataFrame) and len(mb.design.from_table({"k": [], "c": []})) == 0


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda d: d.latin_hypercube({"k": (2.0, 1.0)}, 3), "'k' is empty"),
        (lambda d: d.latin_hypercube({"k": (1.0, 1.0)}, 3), "'k' is empty"),
        (lambda d: d.latin_hypercube({"k": [1.0, 2.0]}, 3), "must be a tuple"),
        (lambda d: d.latin_hypercube({"k": (np.nan, 2.0)}, 3), "NaN"),
        (lambda d: d.latin_hypercube({"k": ("1", 2.0)}, 3), "numbers"),
        (lambda d: d.latin_hypercube({}, 3), "at least one"),
        (lambda d: d.latin_hypercube({3: (1.0, 2.0)}, 3), "address"),
        (lambda d: d.latin_hypercube({"k": (1.0, 2.0)}, 2.5), "n must be an integer"),
        (lambda d: d.latin_hypercube({"k": (1.0, 2.0)}, 3, seed=-1), "seed"),
        (lambda d: d.latin_hypercube({"k": (1.0, 2.0)}, 3, units={"c": "m"}), "does not vary"),
        (lambda d: d.sobol({"k": (1.0, 2.0)}, 100), "take 64 or 128"),
        (lambda d: d.sobol({"k": stats.norm()}, 4, scramble=False), "truncate"),
        (lambda d: d.full_factorial({"k": (1.0, 2.0)}, levels={"c": 3}), "does not vary"),
        (lambda d: d.full_factorial({"k": (1.0, 2.0)}, levels=1), "levels of 'k'"),
        (lambda d: d.full_factorial({"k": []}), "list of numbers"),
        (lambda d: d.from_table({"k": [1.0], "c": [1.0, 2.0]}), "differ in length"),
        (lambda d: d.from_table({"k": ["a"]}), "numbers"),
        (lambda d: d.from_table(3.0), "DataFrame"),
        (lambda d: d.from_table({"k [N]": [1.0], "k [m]": [2.0]}), "two columns"),
        (lambda d: d.normal({"k": 1.0}, {"c": 1.0}, 3), "same numbers"),
        (lambda d: d.normal({"k": 1.0}, {"k": 0.0}, 3), "above 0"),
        (lambda d: d.normal({"k": 1.0}, {"k": 1.0}, 3, correlation={("k", "c"): 0.5}), "the pair"),
        (lambda d: d.normal({"k": 1.0}, {"k": 1.0}, 3, bounds={"c": (0.0, 1.0)}), "does not vary"),
    ],
)
def test_wrong_input_is_named(call, message):
    with pytest.raises(mb.ModelError, match=message):
        call(mb.design)


def test_a_grid_that_cannot_fit_is_refused_before_it_is_made():
    with pytest.raises(mb.RouteError, match="fewer"):
        mb.design.full_factorial({f"p{i}": (0.0, 1.0) for i in range(40)}, levels=7)


@pytest.mark.parametrize(
    ("text", "message"),
    [("", "empty"), ("k,c\n1\n", "line 2: 1 values for 2"), ("k\n1\nx\n", "line 3"), ("k,k\n1,2\n", "twice")],
)
def test_damaged_csv_files_are_named(tmp_path, text, message):
    path = tmp_path / "designs.csv"
    path.write_text(text)
    with pytest.raises(mb.ModelError, match=message):
        mb.design.from_table(path)
