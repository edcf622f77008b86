"""What all tests share: tables are as wide everywhere, also where tests run without a terminal; Ctrl-C interrupts."""

import os
import signal
import sys

import pytest

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
