"""Files are there whole or not at all: killed while saving, without room, behind a link, without a folder."""

from __future__ import annotations

import os
import signal
import stat
import subprocess
import sys
import time
from pathlib import Path

import mbrs as mb
import numpy as np
import pytest
from mbrs._lib.files import write_atomic
from mbrs.errors import FileError

WRITER = """
import sys, mbrs as mb
modes = mb.modes(mb.examples.cubic_hexapod())
print("ready", flush=True)
while True:
    modes.save(sys.argv[1])
"""


def environment():
    return {**os.environ, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)}


@pytest.mark.exact  # the process that is killed has no noise
@pytest.mark.skipif(os.name != "posix", reason="SIGKILL")
@pytest.mark.parametrize(
    ("ending", "kills"),
    [(".nc", 2), *(pytest.param(e, 6, marks=pytest.mark.slow) for e in (".nc", ".json", ".pkl", ".csv"))],
)
def test_a_process_that_is_killed_while_saving_leaves_a_whole_file(tmp_path, ending, kills):
    path = tmp_path / f"modes{ending}"
    modes = mb.modes(mb.examples.cubic_hexapod())
    modes.save(path)
    size = path.stat().st_size
    rng = np.random.default_rng(3)
    for _ in range(kills):
        writer = subprocess.Popen([sys.executable, "-c", WRITER, str(path)], stdout=subprocess.PIPE, env=environment())
        writer.stdout.readline()
        time.sleep(rng.uniform(0.0, 0.06))
        writer.send_signal(signal.SIGKILL)
        writer.wait()
        writer.stdout.close()
        # the time that the analysis took is in the file: sizes differ by some digits
        assert abs(path.stat().st_size - size) < 40
        if ending in (".nc", ".json"):
            assert np.array_equal(mb.load(path).eigenvalue, modes.eigenvalue)
        for other in tmp_path.iterdir():
            assert other == path or other.name.endswith(".tmp")
            if other != path:
                other.unlink()


@pytest.mark.skipif(os.name != "posix", reason="limits of POSIX")
@pytest.mark.parametrize(
    "ending", [".json", ".html", *(pytest.param(e, marks=pytest.mark.slow) for e in (".nc", ".pkl", ".csv", ".toml"))]
)
def test_a_disk_that_is_full_leaves_the_old_file(tmp_path, ending):
    """No file may grow beyond 500 bytes: every save fails, the interpreter lives, the old file is as it was."""
    path = tmp_path / f"old{ending}"
    path.write_bytes(b"old" * 50)
    code = """
import resource, signal, sys, mbrs as mb
m = mb.examples.cubic_hexapod()
modes = mb.modes(m)
saved = {".toml": m.save, ".html": modes.animate}.get(sys.argv[2], modes.save)
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (500, 500))
try:
    saved(sys.argv[1])
except OSError as reason:
    print("refused", reason.errno)
del modes
import gc
gc.collect()
"""
    done = subprocess.run(
        [sys.executable, "-B", "-c", code, str(path), ending], env=environment(), capture_output=True, text=True
    )
    assert done.returncode == 0 and "refused" in done.stdout, done.stderr
    assert path.read_bytes() == b"old" * 50 and list(tmp_path.iterdir()) == [path]


def test_a_link_is_replaced_and_its_target_stays(tmp_path):
    target, link = tmp_path / "target", tmp_path / "link"
    target.write_bytes(b"precious")
    link.symlink_to(target)
    write_atomic(link, b"new")
    assert target.read_bytes() == b"precious" and link.read_bytes() == b"new" and not link.is_symlink()


def test_permissions_are_kept_and_new_files_have_the_usual_ones(tmp_path):
    path = tmp_path / "a"
    plain = tmp_path / "plain"
    plain.write_bytes(b"")
    write_atomic(path, b"1")
    assert stat.S_IMODE(path.stat().st_mode) == stat.S_IMODE(plain.stat().st_mode)
    path.chmod(0o640)
    write_atomic(path, b"2")
    assert path.read_bytes() == b"2" and stat.S_IMODE(path.stat().st_mode) == 0o640


def test_failures_leave_nothing_behind(tmp_path, monkeypatch):
    with pytest.raises(FileError, match=r"cannot write .*absent.*folder that is there"):
        write_atomic(tmp_path / "absent" / "a", b"x")
    (tmp_path / "folder").mkdir()
    with pytest.raises(OSError):
        write_atomic(tmp_path / "folder", b"x")

    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "fsync", interrupted)
    with pytest.raises(KeyboardInterrupt):
        write_atomic(tmp_path / "a", b"x")
    assert [p.name for p in Path(tmp_path).iterdir()] == ["folder"]
