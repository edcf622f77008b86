"""Files on one page: a robot, transfer functions and measurements, results, and an update. Writes h.uff, h.csv, modes.nc, measured.png."""

import sys
import tempfile
from pathlib import Path

import mbrs as mb
import numpy as np

folder = Path(sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp())
(folder / "arm.urdf").write_text(
    """<robot name="arm"><link name="base"/>
<link name="upper"><inertial><origin xyz="0.1 0 0.3"/><mass value="2"/>
<inertia ixx="0.1" iyy="0.1" izz="0.05" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0.3 1 0.2"/>
<limit lower="-1" upper="1" effort="1" velocity="1"/><dynamics damping="0.1"/></joint></robot>"""
)
m = mb.Model.load(folder / "arm.urdf")                         # .toml, .urdf, .xml (MJCF): what mbrs cannot represent is named object by object
print(m)

m = mb.examples.cubic_hexapod()
modes, h = mb.modes(m), mb.frf(m, "base.z", "payload.motion.z", frequency=np.linspace(1.0, 50.0, 200))
h.save(folder / "h.uff"); h.save(folder / "h.csv"); modes.save(folder / "modes.nc")   # the ending decides; an unknown one is an error that lists the known ones
modes = mb.load(folder / "modes.nc"); test = mb.load(folder / "h.uff")   # results and measurements; nothing is ever executed or unpickled
m.set({"k_leg": 0.8 * m.value("k_leg"), "c_leg": 1.5 * m.value("c_leg")})
test.plot(against=mb.frf(m, "base.z", "payload.motion.z", frequency=np.linspace(1.0, 50.0, 200))).savefig(folder / "measured.png")
fit = mb.update(m, test, ["k_leg", "c_leg"]); print(fit)       # with covariance and what the data do not see
