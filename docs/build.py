"""Build the site into target/site: runs the tests of the verification manual first, unless their records are there.

python docs/build.py [--fresh]      needs pip install '.[test,docs]'

Pages are read anew, since what they print comes from the package; ``--fresh`` also runs the tests of the manual and the gallery's
scripts again.
"""

import os
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
TARGET = ROOT / "target"
# tests that call the fixture `case`
CASES = [
    "tests/manual",
    "tests/truth/test_rolling.py",
    "tests/linear/test_air_lags.py",
    "tests/linear/test_modes_in_wind.py",
    "tests/aero/test_dynamic_stall.py",
    "tests/aero/test_filaments.py",
    "tests/aero/test_momentum.py",
    "tests/aero/test_published_rotors.py",
    "tests/aero/test_wakes.py",
    "tests/aero/test_wings.py",
    "tests/motion/test_air_states.py",
    "tests/motion/test_nonholonomic.py",
]


def run(*command: str, **environment: str) -> None:
    """Run a command of this interpreter in the root, or end with its code."""
    code = subprocess.call(
        [sys.executable, "-m", *command], cwd=ROOT, env=os.environ | {"MPLBACKEND": "agg"} | environment
    )
    if code:
        raise SystemExit(code)


def main() -> None:
    """Records, pages, checks."""
    records = Path(os.environ.get("MBRS_MANUAL", TARGET / "manual"))
    if "--fresh" in sys.argv:
        for made in (records, ROOT / "docs" / "gallery", ROOT / "docs" / "generated"):
            shutil.rmtree(made, ignore_errors=True)
    if not any(records.glob("*.json")):
        run("pytest", *CASES, MBRS_MANUAL=str(records))
    out = TARGET / "site"
    shutil.rmtree(out, ignore_errors=True)
    run(
        "sphinx",
        "-W",
        "-E",
        "--keep-going",
        "-b",
        "html",
        "-d",
        str(TARGET / "doctrees"),
        "docs",
        str(out),
        MBRS_MANUAL=str(records),
    )
    subprocess.check_call([sys.executable, str(ROOT / "docs" / "_ext" / "check_site.py"), str(out)])


if __name__ == "__main__":
    main()
