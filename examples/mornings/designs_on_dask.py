"""Ten thousand designs of an isolator on a cluster of Dask, killed half-way and resumed: the same bits as without the accident.

``python designs_on_dask.py folder n``; the client that is killed is this script with a third argument.
"""

import subprocess
import sys
import tempfile
import time
from pathlib import Path

import mbrs as mb
import numpy as np

OUTPUTS = mb.outputs.modes(n=3, sensitivities=["k_leg"])


def designs(n):
    return mb.design.latin_hypercube({"k_leg": (5e4, 2e5), "payload.mass": (15.0, 25.0)}, n=n, seed=3)


def sweep(folder, n, executor=None):
    return mb.sweep(
        mb.examples.cubic_hexapod(), designs(n), OUTPUTS, executor=executor, store=folder, chunk=max(1, n // 100)
    )


def on_a_cluster(folder, n):
    from distributed import Client, LocalCluster

    with (
        LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None, silence_logs=50) as cluster,
        Client(cluster) as client,
    ):
        return sweep(folder, n, client)


def main():
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp())
    n = int(sys.argv[2]) if len(sys.argv) > 2 else 10_000
    client = subprocess.Popen([sys.executable, __file__, str(folder), str(n), "client"])
    deadline = time.monotonic() + 300.0
    while len(list((folder / "runs").glob("chunk*"))) < 20 and client.poll() is None and time.monotonic() < deadline:
        time.sleep(0.01)
    client.kill()
    client.wait()
    some = len(list((folder / "runs").glob("chunk*")))
    print(f"killed with {some} of 100 chunks on the disk")
    runs = on_a_cluster(folder / "runs", n)
    print(runs)
    plain = mb.sweep(mb.examples.cubic_hexapod(), designs(n).part(slice(0, n, 50)), OUTPUTS)
    same = all(np.array_equal(runs[name][::50], plain[name]) for name in ("frequency", "frequency_derivative"))
    print("all designs done:", bool(runs.done.all()))
    print("the bits are those of a plain call:", same)


if __name__ == "__main__":
    if len(sys.argv) > 3:
        on_a_cluster(Path(sys.argv[1]) / "runs", int(sys.argv[2]))
    else:
        main()
