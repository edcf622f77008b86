"""The cases of a test that stand for the others in the default tests: ``@pytest.mark.some(n)``.

A test with many cases of one kind (random models, a grid of models and changes) is run with ``n`` of them by default; the
others get the mark ``slow``. Each is the one whose parameters were chosen least often before, so that ``n`` cases of a grid
take as many values of each parameter as they can. Cases that are ``slow`` by themselves are left as they are.
"""

from collections import Counter

import pytest


def choose(cases: list[list[str]], n: int) -> list[int]:
    """Indices of n cases, each told by its parameters: one after the other, that with the least used ones, the first of equals."""
    used, left, chosen = Counter(), list(range(len(cases))), []
    while left and len(chosen) < n:
        best = min(left, key=lambda i: sum(used[p] for p in cases[i]))
        used.update(cases[best])
        left.remove(best)
        chosen.append(best)
    return chosen


def mark_others_slow(items):
    """Of each test marked ``some(n)``: all cases but n get the mark ``slow``."""
    tests = {}
    for item in items:
        if (some := item.get_closest_marker("some")) and not item.get_closest_marker("slow"):
            tests.setdefault(item.nodeid.partition("[")[0], (some.args[0], []))[1].append(item)
    for n, cases in tests.values():
        chosen = choose([case.callspec.id.split("-") for case in cases], n)
        for i, case in enumerate(cases):
            if i not in chosen:
                case.add_marker(pytest.mark.slow)
