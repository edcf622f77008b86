"""The slave of an FMU of a whole model; `mbrs.io.fmu` puts this file into it. It needs mbrs."""

import json
from pathlib import Path

import numpy as np
from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Real


class MbrsModel(Fmi2Slave):
    """Motion of a multibody model by `mb.simulate` with inputs that are held during a step."""

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        from mbrs.model.model import Model
        from mbrs.motion.simulate import simulate

        self.simulate, folder = simulate, Path(self.resources or Path(__file__).parent)
        told = json.loads((folder / "mbrs_fmu.json").read_text(encoding="utf-8"))
        self.model = Model.load(folder / "mbrs_fmu_model.toml")
        self.options, self.ports, self.description = told["options"], told["outputs"], told["description"]
        self.u, self.p = dict(told["inputs"]), {name: float(self.model.value(name)) for name in told["parameters"]}
        self.state, self.time, self.first = None, 0.0, None
        self.values = np.zeros(0)
        varies = {"variability": Fmi2Variability.continuous}
        for name in told["parameters"]:
            self.register_variable(
                Real(
                    name, causality=Fmi2Causality.parameter, variability=Fmi2Variability.tunable, start=self.p[name],
                    getter=self._read(self.p, name), setter=self._given(self.p, name),
                )
            )  # fmt: skip
        self.parameters = told["input_parameters"]
        for name in self.u:
            ways = {"getter": self._read(self.u, name), "setter": self._given(self.u, name)}
            self.register_variable(Real(name, causality=Fmi2Causality.input, start=0.0, **ways, **varies))
        for i, port in enumerate(self.ports):
            self.register_variable(Real(port["name"], causality=Fmi2Causality.output, getter=self._output(i), **varies))

    def _read(self, table, name):
        return lambda: float(table[name])

    def _given(self, table, name):
        return lambda value: table.__setitem__(name, value)

    def _output(self, i):
        def read():
            if not self.values.size:
                self._observe(self._simulate(self.time, self.time))
            return float(self.values[i])

        return read

    def _simulate(self, begin, end):
        """The motion of a step, or of a moment without one."""
        self.model.set(self.p | {self.parameters[name]: value for name, value in self.u.items()})
        return self.simulate(self.model, np.unique([begin, end]), at=self.state, **self.options)

    def _observe(self, traj, last=False):
        row = -1 if last else 0
        self.values = np.array([self._value(traj, port, row) for port in self.ports], dtype=float)

    def _value(self, traj, port, row):
        """One output at a moment of the motion."""
        if port["kind"] == "motion":
            return np.dot(port["direction"], traj.point(port["point"], of=port["owner"])[row] - port["drawn"])
        found = {
            "velocity": traj.velocity,
            "angular_velocity": traj.angular_velocity,
            "coordinate": traj.joint,
            "rate": traj.joint_rate,
            "reaction": traj.reaction,
        }[port["kind"]](port["owner"])
        return np.reshape(found[row], -1)[port["entry"]]

    def setup_experiment(self, start_time, stop_time=None, tolerance=None):
        """Set the time at which the motion begins."""
        self.time = float(start_time)

    def do_step(self, current_time, step_size):
        """Go on from the last state."""
        traj = self._simulate(float(current_time), float(current_time + step_size))
        if traj.status not in ("finished", "converged", "computed"):
            return False
        self.state, self.time = traj.state(), float(current_time + step_size)
        self._observe(traj, last=True)
        return True
