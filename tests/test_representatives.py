"""Which cases of a test are run by default."""

import pytest
from representatives import choose


def grid(*sizes):
    """All combinations of the letters a, b, .. with numbers."""
    cases = [[]]
    for letter, size in zip("abc", sizes, strict=False):
        cases = [[*case, f"{letter}{i}"] for case in cases for i in range(size)]
    return cases


@pytest.mark.parametrize(("sizes", "n"), [((7, 3), 7), ((4, 4), 4), ((6, 6, 16), 16), ((2, 9), 9)])
def test_as_many_values_as_cases(sizes, n):
    cases = grid(*sizes)
    chosen = choose(cases, n)
    assert len(set(chosen)) == n
    assert {p for i in chosen for p in cases[i]} == {p for case in cases for p in case}


def test_pairs_of_a_grid_are_all_taken_before_any_comes_again():
    cases = grid(3, 4)
    assert sorted(choose(cases, 12)) == list(range(12)) and len(choose(cases, 100)) == 12


def test_of_equal_cases_the_first():
    assert choose([[str(i)] for i in range(9)], 3) == [0, 1, 2]
