"""Results as mbrs saves them, see `mbrs.io.result_files`."""

from __future__ import annotations

from .._lib.formats import Format, register
from .._lib.result_files import WRITERS, write_file
from .result_files import READERS, read_file

for _ending in WRITERS:
    register(Format(_ending, "result", f"{_ending} of mbrs", read_file if _ending in READERS else None, write_file))
