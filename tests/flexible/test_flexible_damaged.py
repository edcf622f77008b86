"""Damaged files of modal bodies: an error of ours or the body, and never more memory than the file has.

The files are read in one process with a limit on its address space; what it prints is judged here.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import textwrap

import mbrs as mb
import numpy as np
import pytest
from mbrs.flexible import ModalBody

READER = """
    import json, pathlib, resource, sys, warnings
    warnings.simplefilter("ignore")
    import numpy as np
    from mbrs.errors import MbrsError
    from mbrs.flexible import ModalBody
    pages = int(open("/proc/self/statm").read().split()[0]) if sys.platform.startswith("linux") else 0
    if pages:
        most = pages * resource.getpagesize() + 300_000_000
        resource.setrlimit(resource.RLIMIT_AS, (most, most))
    outcome = {}
    for path in sorted(pathlib.Path(sys.argv[1]).iterdir()):
        try:
            body = ModalBody.load(path)
            outcome[path.name] = ["body", bool(np.isfinite(body.mass_matrix()).all())]
        except BaseException as reason:
            outcome[path.name] = [type(reason).__name__, isinstance(reason, MbrsError), str(reason)]
    print(json.dumps(outcome))
"""


def good(tmp_path):
    body = mb.flexible.beam(
        0.83, E=7.1e10, G=2.7e10, rho=2710.0, area=3.7e-4, I_flap=1.3e-8, I_edge=2.9e-8, J=3.1e-8, elements=3, modes=2
    )
    return body, (body.save(tmp_path / "good.npz")).read_bytes()


def read(folder):
    env = {**os.environ, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p), "OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(READER), str(folder)],
        env=env,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, f"ended with {done.returncode}: {done.stderr[-2000:]}"
    outcome = json.loads(done.stdout)
    for name, (kind, fine, *text) in outcome.items():
        assert fine, f"{name}: {kind} {text}"
        assert kind == "body" or (name in text[0] and len(text[0]) < 1000), text
    return outcome


@pytest.mark.some(1)
@pytest.mark.parametrize("seed", range(3))
def test_random_damage(seed, tmp_path):
    """Bytes changed, cut out, doubled, cut off, in the headers more often than elsewhere."""
    rng = np.random.default_rng(seed)
    _, whole = good(tmp_path)
    starts = [i for i in range(len(whole)) if whole[i : i + 2] == b"PK" or whole[i : i + 6] == b"\x93NUMPY"]
    folder = tmp_path / "damaged"
    folder.mkdir()
    for k in range(300):
        data = bytearray(whole)
        for _ in range(rng.integers(1, 4)):
            near = int(rng.choice(starts)) + int(rng.integers(0, 130))
            at = min(near if rng.random() < 0.7 else int(rng.integers(len(data))), len(data) - 1)
            match rng.integers(6):
                case 0:
                    data[at] ^= 1 << int(rng.integers(8))
                case 1:
                    data[at] = int(rng.integers(256))
                case 2:
                    del data[at : at + int(rng.integers(1, 40))]
                case 3:
                    data[at:at] = data[at : at + int(rng.integers(1, 40))]
                case 4:
                    del data[at + 1 :]
                case 5:
                    data[at : at + 4] = rng.bytes(4)
        (folder / f"{k:03d}.npz").write_bytes(data)
    outcome = read(folder)
    kinds = [kind for kind, *_ in outcome.values()]
    assert len(outcome) == 300 and kinds.count("body") < 200 and set(kinds) <= {"body", "ModelError", "InertiaError"}


def rewritten(path, **changes):
    """An archive as `save` writes it, with other arrays in places of its own."""
    with np.load(path) as archive:
        np.savez(path, **{**{name: archive[name] for name in archive.files}, **changes})


CHANGES = {
    "mass of no dimension in a list": dict(mass=np.array([1.0])),
    "nodes as one text": dict(nodes=np.array("root")),
    "nodes as numbers": dict(nodes=np.array([1.0, 2.0])),
    "nodes as bytes": dict(nodes=np.array([b"root"])),
    "a note of numbers": dict(note=np.array(3.7)),
    "K of no dimension": dict(K=np.array(3.7)),
    "complex K": dict(K=np.eye(2) * 1j),
    "dates": dict(mass=np.array("2026-01-01", dtype="M8[D]")),
    "records": dict(K=np.zeros(3, dtype=[("a", float), ("b", "U3")])),
    "line of no dimension": dict(line_position=np.array(1.0)),
    "no line": dict(line_position=np.zeros((0, 3)), line_shape=np.zeros((0, 6, 0))),
    "text for K": dict(K=np.array([["a", "b"], ["c", "d"]])),
    "nan": dict(S=np.full((3, 2), np.nan)),
    "long names": dict(nodes=np.array(["n" * 100000, "m"])),
}


def test_arrays_of_other_kinds_and_shapes(tmp_path):
    folder = tmp_path / "changed"
    folder.mkdir()
    for what, changes in CHANGES.items():
        path = folder / f"{what}.npz"
        good(tmp_path)[0].save(path)
        rewritten(path, **changes)
    outcome = read(folder)
    taken = {name for name, (kind, *_) in outcome.items() if kind == "body"}
    assert taken == {"long names.npz"}, taken
    assert {kind for kind, *_ in outcome.values()} <= {"body", "ModelError", "InertiaError"}


@pytest.mark.some(2)
@pytest.mark.parametrize(
    "shape", ["(1000000, 1000000)", "(2, 9223372036854775807)", "(-1, -7)", "(2, 2, 9)", "('a', 2)", "2"]
)
def test_a_header_that_claims_another_size(shape, tmp_path):
    """7.3 TiB of a file of some kB: refused without asking for them, also where the directory of the archive claims as much."""
    _, whole = good(tmp_path)
    folder = tmp_path / "claims"
    folder.mkdir()
    at = whole.index(b"(2, 2), }", whole.index(b"K.npy"))
    claim = f"{shape}, }}".encode()
    data = whole[:at] + claim + whole[at + len(claim) :]
    (folder / "header.npz").write_bytes(data)
    sizes = data.replace(whole_size(whole), (2**32 - 2).to_bytes(4, "little"))
    (folder / "both.npz").write_bytes(sizes)
    outcome = read(folder)
    assert {kind for kind, *_ in outcome.values()} == {"ModelError"}


def whole_size(whole):
    """The bytes that tell the size of K in the directory: of the header of 128 bytes and of 2 x 2 numbers."""
    size = (128 + 32).to_bytes(4, "little")
    assert size in whole
    return size


def test_an_intact_file_is_the_body(tmp_path):
    body, whole = good(tmp_path)
    (tmp_path / "again.npz").write_bytes(whole)
    again = ModalBody.load(tmp_path / "again.npz")
    for name in ("K", "S", "P1", "P2", "KG", "C", "node_shape", "line_shape", "inertia", "com"):
        assert np.array_equal(getattr(again, name), getattr(body, name)), name
    assert again.nodes == body.nodes and again.mass == body.mass and again.note == body.note
    with pytest.raises(FileNotFoundError):
        ModalBody.load(tmp_path / "absent.npz")
