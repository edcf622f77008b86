"""Marks of tests that fail, or mean nothing, where `jitter` is on."""

import jitter
import pytest


def defect(reason, seeds=None, **given):
    """A strict expected failure where the numbers of models have noise (of one of the ``seeds``), because of a known defect."""
    on = jitter.seed() is not None and (seeds is None or jitter.seed() in seeds)
    return pytest.mark.xfail(on, strict=True, reason=reason, **given)
