"""Results as mbrs saves them, see `mbrs.result_files`."""

from __future__ import annotations

from ..formats import Format, register
from ..result_files import READERS, WRITERS, read_file, write_file

for _ending in WRITERS:
    register(Format(_ending, "result", f"{_ending} of mbrs", read_file if _ending in READERS else None, write_file))
