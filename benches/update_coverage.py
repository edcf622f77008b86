"""Coverage of the 95 % intervals of `mb.update`: twelve parameters of a hexapod from noisy transfer functions, 400 repetitions.

``PYTHONPATH=tests/models python benches/update_coverage.py [repetitions]``; 94 to 96 % of all intervals must hold the true value. The
standard error of the share over 4,800 intervals is 0.3 %.
"""

import sys
import time
import warnings

from hexapods import covered

repetitions = int(sys.argv[1]) if len(sys.argv) > 1 else 400
warnings.simplefilter("ignore")  # resonances between the points of the test
begin, hits, total = time.process_time(), 0, 0
for first in range(0, repetitions, 20):
    found = covered(min(20, repetitions - first), first)
    hits, total = hits + found[0], total + found[1]
    print(f"{first + 20:4d} repetitions: {hits} of {total} intervals, {100 * hits / total:.2f} %", flush=True)
share = hits / total
print(f"{time.process_time() - begin:.0f} s; within 94 to 96 %: {0.94 <= share <= 0.96}")
