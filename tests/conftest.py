"""What all tests share: tables are as wide everywhere, also where tests run without a terminal; Ctrl-C interrupts; numbers of
models have noise where the environment variable ``MBRS_JITTER`` asks for it.
"""

import os
import signal
import sys

# the tests share out among the cores, so each has one BLAS thread; read when NumPy is imported, by `jitter`
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import jitter
import pytest
import representatives
from manual.record import make

os.environ["COLUMNS"] = "120"
os.environ.setdefault("MPLBACKEND", "agg")
# a shell that starts this in the background has it ignore Ctrl-C, and so would the processes that tests start
signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(autouse=True)
def closed_figures():
    """Figures of results are pyplot's, which keeps them until they are closed."""
    yield
    if "matplotlib.pyplot" in sys.modules:
        sys.modules["matplotlib.pyplot"].close("all")


@pytest.fixture
def case(request):
    """A case of the verification manual: asserts, and writes a record where MBRS_MANUAL names a folder; see `manual.record`."""
    return make(request.node, request.config.rootpath)


@pytest.fixture(scope="session", autouse=True)
def noise_on_the_numbers_of_models():
    """With ``MBRS_JITTER=<seed>``: every real number of a model is multiplied by 1 + 1e-13 r; see `jitter`."""
    with pytest.MonkeyPatch.context() as patch:
        if jitter.seed() is not None:
            patch.setattr("mbrs.model.tables.x", jitter.jittered)
        yield


@pytest.hookimpl(tryfirst=True)  # before pytest selects by marks
def pytest_collection_modifyitems(items):
    """Of tests marked ``some`` most cases are slow; tests marked ``exact`` are about equal bits or printed digits, which noise
    changes by design.
    """
    representatives.mark_others_slow(items)
    if jitter.seed() is None:
        return
    skip = pytest.mark.skip(reason="about equal bits or printed digits, which noise on the numbers changes by design")
    for item in items:
        if item.get_closest_marker("exact"):
            item.add_marker(skip)
