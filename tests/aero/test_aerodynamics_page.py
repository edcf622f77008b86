"""docs/aerodynamics.md: its code runs and shows what it says."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
import pytest
from folders import DOCS

PAGE = (DOCS / "aerodynamics.md").read_text(encoding="utf-8")


@pytest.mark.slow
def test_the_page_is_true(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    scope: dict = {}
    for block in PAGE.split("```python\n")[1:]:
        exec(block.split("```")[0], scope)
    plt.close("all")
    curve, start = scope["curve"], scope["start"]
    assert curve.status == "converged" and curve.error.max() < 1e-3
    assert 0.4 < curve.power_coefficient.max() < 16 / 27 and "kW in wind of 8 m/s" in capsys.readouterr().out
    assert scope["steady"].lift_coefficient[1] > 1.9 * scope["steady"].lift_coefficient[0]
    assert start.lift_coefficient[-1] > start.lift_coefficient[0] > 0
    # four equal sides: v = 4 Gamma / (4 pi h) * ..., along the axis
    assert scope["free"].status == "unsteady wake" and scope["free"].thrust > 0
    assert scope["rigid"].status == "computed"
    assert scope["rigid"].power_coefficient == pytest.approx(curve.power_coefficient[8:11:2], rel=0.15)
    corner, h2 = np.sqrt(1.25), 0.5 + 0.25
    side = 1 / (4 * np.pi) * (2 * np.sqrt(0.5) / corner) * np.sqrt(0.5) / np.sqrt(h2**2 + 0.05**4)
    assert scope["v"] == pytest.approx([0.0, 0.0, 4 * side], abs=1e-12)
