"""Damaged files of every format that is read: samples, mutations, and a run that reports what is not a named error.

``python hostile_files.py FORMAT COUNT SEED`` prints one line for each mutated file that raised something else than an `MbrsError`; it
runs in a process of its own with limits of memory, so that a library in C can fall without the tests.

``python hostile_files.py all [SHARE]`` does so for every format: 100,000 files of each whose parser is ours and 1,000 of each that a
library in C reads, in processes of 2,000 files; SHARE is a part of these numbers. The tests run 300 of each.
"""

from __future__ import annotations

import io
import os
import re
import subprocess
import sys
import tempfile
import traceback
import warnings
from pathlib import Path

import mbrs as mb
import numpy as np
from mbrs.model.toml import dumps
from robot_models import random_mjcf, random_urdf

OURS = ("toml", "urdf", "xml", "csv", "mtx", "mat", "mat compressed", "uff", "uff text")
FOREIGN = ("op4", "op4 text", "pch", "parquet")
# files of each in a whole run, and in one process of it
MANY = {True: 100_000, False: 1_000}
_AT_ONCE = 2_000
NUMBER = re.compile(rb"-?\d+\.?\d*(?:[eE][+-]?\d+)?")
WORDS = b"nan|-inf|1e308|-1e308|1e-320|0|-1||1e400|99999999999999999999|0x10|1_0|abc|\xff\xfe|1 2".split(b"|")


def sample(kind, seed=0):
    """The bytes of a good file."""
    rng = np.random.default_rng(seed)
    if kind == "urdf":
        return random_urdf(rng, n=3, extra='<gazebo reference="link0"><a b="3"/></gazebo>').encode()
    if kind == "xml":
        extra = (
            '<equality><connect body1="body0" anchor="0.1 0.2 0.3"/>'
            '<joint joint1="joint1" joint2="joint2" polycoef="0 2 0 0 0"/></equality>'
            '<tendon><spatial stiffness="3"><site site="site0"/><site site="site2"/></spatial></tendon>'
            '<default><joint damping="0.1"/><default class="a"><geom density="7"/></default></default>'
        )
        return random_mjcf(rng, n=3, extra=extra, compiler='<compiler angle="radian" eulerseq="zxy"/>').encode()
    a = rng.normal(size=(5, 5))
    a = a + a.T
    designs = {"k_leg": a[0], "payload.mass": a[1] + 20.0}
    if kind == "toml":
        return dumps(mb.examples.four_bar()).encode()
    if kind == "csv":
        rows = [",".join(designs), *(",".join(map(repr, row)) for row in np.transpose([*designs.values()]).tolist())]
        return "\n".join(rows).encode()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"a.{kind.split()[0]}"
        if kind == "op4":
            mb.MechanicalSystem(M=a, K=2 * a).save(path)
        elif kind == "op4 text":
            with np.printoptions():
                from pyyeti.nastran import op4

            op4.write(str(path), {"m": a, "k": a}, binary=False)
        elif kind == "pch":
            import pandas as pd

            with np.printoptions():
                from pyyeti.nastran import bulk

            index = pd.MultiIndex.from_tuples([(1, 1), (1, 2), (2, 1), (7, 0), (9, 3)])
            with path.open("w") as file:
                bulk.wtdmig(file, {"maa": pd.DataFrame(a, index, index), "kaa": pd.DataFrame(a, index, index)})
        elif kind == "parquet":
            import pandas as pd

            pd.DataFrame(designs).to_parquet(path)
        elif kind == "mtx":
            import scipy.io

            buffer = io.BytesIO()
            scipy.io.mmwrite(buffer, __import__("scipy.sparse").sparse.coo_matrix(a))
            return buffer.getvalue()
        elif kind.startswith("mat"):
            import scipy.io

            scipy.io.savemat(path, {"M": a, "K": a}, do_compression="compressed" in kind)
        elif kind.startswith("uff"):
            from test_uff import measured

            measured(path, binary=int("text" not in kind))
        return path.read_bytes()


def mutated(data, rng):
    """One to four changes: bits, numbers, pieces cut out, doubled or exchanged, the end cut off."""
    data = bytearray(data)
    for _ in range(int(rng.integers(1, 5))):
        if not data:
            break
        i, j = sorted(int(k) for k in rng.integers(0, len(data) + 1, size=2))
        j = min(j, i + int(rng.integers(1, 200)))
        choice = rng.integers(7)
        if choice == 0:
            data[min(i, len(data) - 1)] = int(rng.integers(256))
        elif choice == 1:
            del data[i:j]
        elif choice == 2:
            data[i:i] = data[i:j]
        elif choice == 3 and rng.random() < 0.3:
            del data[i:]
        elif choice == 4:
            at = int(rng.integers(0, len(data)))
            data[at:at], piece = b"", bytes(data[i:j])
            data[at : at + len(piece)] = piece
        else:
            numbers = list(NUMBER.finditer(bytes(data)))
            if numbers:
                found = numbers[int(rng.integers(len(numbers)))]
                data[found.start() : found.end()] = WORDS[int(rng.integers(len(WORDS)))]
    return bytes(data)


def read(kind, path):
    """What a user would call."""
    ending = kind.split()[0]
    if ending in ("toml", "urdf", "xml"):
        return mb.Model.load(path)
    if ending in ("csv", "parquet"):
        return mb.design.from_table(path)
    if ending == "uff":
        return mb.load(path)
    names = None if ending != "mtx" else {"M": "A", "K": "A"}
    return mb.MechanicalSystem.load(path, names=names)


def run(kind, count, seed, folder):
    """(number of files that were read, number refused, other outcomes)."""
    rng = np.random.default_rng(seed)
    good = sample(kind)
    path = Path(folder) / f"file.{kind.split()[0]}"
    fine, refused, wrong = 0, 0, []
    for k in range(count):
        data = mutated(good, rng)
        path.write_bytes(data)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                warnings.simplefilter("ignore", mb.MbrsWarning)
                read(kind, path)
            fine += 1
        except mb.MbrsError as reason:
            refused += 1
            if len(str(reason)) > 700:
                wrong.append(f"{k}: a message of {len(str(reason))} characters")
        except BaseException as reason:
            where = traceback.extract_tb(reason.__traceback__)[-1]
            wrong.append(
                f"{k}: {type(reason).__name__}: {str(reason)[:200]} ({Path(where.filename).name}:{where.lineno})"
            )
    return fine, refused, wrong


def environment():
    """Of a process that finds the same packages."""
    return {**os.environ, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)}


def main():
    """Run with limits."""
    import resource
    import signal

    kind, count, seed = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
    sample(kind)  # imports what is needed before the limit
    resource.setrlimit(resource.RLIMIT_AS, (6 * 1024**3, 6 * 1024**3))
    signal.alarm(300 + count)
    with tempfile.TemporaryDirectory() as folder:
        fine, refused, wrong = run(kind, count, seed, folder)
    print("\n".join(wrong))
    print(f"read {fine}, refused {refused}, wrong {len(wrong)}")


def whole(share):
    """All formats, in many processes; whether all files gave named errors only."""
    good = True
    for kind in (*OURS, *FOREIGN):
        count, sums = max(1, round(share * MANY[kind in OURS])), [0, 0, 0]
        for first in range(0, count, _AT_ONCE):
            command = [sys.executable, __file__, kind, str(min(_AT_ONCE, count - first)), str(first + 1)]
            done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment())
            last = re.fullmatch(r"read (\d+), refused (\d+), wrong (\d+)", done.stdout.rstrip().rpartition("\n")[2])
            if done.returncode or last is None:
                print(f"{kind}, seed {first + 1}: the process ended with {done.returncode}: {done.stderr[-500:]}")
                good = False
                continue
            sums = [a + int(b) for a, b in zip(sums, last.groups(), strict=True)]
            if int(last[3]):
                print(f"{kind}, seed {first + 1}: {done.stdout}")
                good = False
        print(
            f"{kind}: {sum(sums[:2]) + sums[2]} files, {sums[0]} read, {sums[1]} refused, {sums[2]} wrong", flush=True
        )
    return good


if __name__ == "__main__":
    if sys.argv[1] == "all":
        sys.exit(0 if whole(float(sys.argv[2]) if len(sys.argv) > 2 else 1.0) else 1)
    main()
