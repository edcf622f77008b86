"""An arm from URDF to its modes, what moves them, and a page."""

import sys
import tempfile
import warnings
from pathlib import Path

import mbrs as mb
import numpy as np
from mbrs.view.page import Section, write_page

folder = Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp())
(folder / "arm.urdf").write_text(
    """<robot name="arm">
  <link name="base"/>
  <link name="upper"><inertial><origin xyz="0.01 0 0.21"/><mass value="3.1"/>
    <inertia ixx="0.05" iyy="0.052" izz="0.011" ixy="0.001" ixz="0" iyz="0.002"/></inertial></link>
  <link name="lower"><inertial><origin xyz="0.15 0.02 0"/><mass value="1.9"/>
    <inertia ixx="0.011" iyy="0.031" izz="0.03" ixy="0" ixz="0.001" iyz="0"/></inertial></link>
  <link name="tool"/>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0.1 1 0"/>
    <limit lower="-1.5" upper="1.5" effort="50" velocity="3"/><dynamics damping="0.4"/></joint>
  <joint name="elbow" type="continuous"><parent link="upper"/><child link="lower"/>
    <origin xyz="0 0 0.4" rpy="0 0.3 0"/><axis xyz="0 1 0.2"/><dynamics damping="0.2"/></joint>
  <joint name="flange" type="fixed"><parent link="lower"/><child link="tool"/><origin xyz="0.3 0 0"/></joint>
</robot>"""
)
with warnings.catch_warnings():
    warnings.simplefilter("ignore", mb.OmissionWarning)  # the limit of the shoulder is named, and left out
    m = mb.Model.load(folder / "arm.urdf")
m.torsion("drive", m.ground, "upper", at=(0, 0, 0), axis=(0.1, 1, 0), k=4e3)
m.torsion("belt", "upper", "lower", at=(0, 0, 0.4), axis="y", k=2e3)

modes = mb.modes(m)
by = mb.sensitivity(modes, ["drive.k", "belt.k", "lower.mass", "upper.com[2]"])
print(modes)
print(by)
tip = mb.frf(m, "tool.force.z", "tool.motion.z", frequency=(1.0, 100.0))
write_page(
    folder / "arm.html",
    "The arm",
    [Section("Modes", [modes, modes.plot()]), Section("What moves them", by), Section("Tip", tip.plot())],
)

# the same derivative by differences of two models
step = 1e-3 * 3.1
ends = []
for sign in (1.0, -1.0):
    m.set({"belt.k": 2e3 + sign * step})
    ends.append(mb.modes(m).frequency)
wanted = (ends[0] - ends[1]) / (2.0 * step)
print("derivatives agree:", bool(np.abs(by.frequency[:, 1] - wanted).max() < 1e-6 * np.abs(wanted).max()))
