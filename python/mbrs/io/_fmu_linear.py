"""The slave of a linear FMU; `mbrs.io.fmu` puts this file into it. It needs NumPy and SciPy, not mbrs."""

from pathlib import Path

import numpy as np
from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Real


class MbrsLinear(Fmi2Slave):
    """x' = A x + B u, y = C x + D u with inputs that are held during a step: exact for every step."""

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        with np.load(Path(self.resources or Path(__file__).parent) / "mbrs_fmu.npz", allow_pickle=False) as data:
            self.A, self.B, self.C, self.D = (data[name] for name in "ABCD")
            self.names = data["inputs"].tolist(), data["outputs"].tolist()
            self.description = str(data["description"])
        self.x, self.u = np.zeros(len(self.A)), np.zeros(self.B.shape[1])
        self.steps = {}
        varies = {"variability": Fmi2Variability.continuous}
        for i, name in enumerate(self.names[0]):
            self.register_variable(
                Real(
                    name,
                    causality=Fmi2Causality.input,
                    start=0.0,
                    getter=self._input(i),
                    setter=self._given(i),
                    **varies,
                )
            )
        for i, name in enumerate(self.names[1]):
            self.register_variable(Real(name, causality=Fmi2Causality.output, getter=self._output(i), **varies))

    def _input(self, i):
        return lambda: float(self.u[i])

    def _given(self, i):
        return lambda value: self.u.__setitem__(i, value)

    def _output(self, i):
        return lambda: float(self.C[i] @ self.x + self.D[i] @ self.u)

    def do_step(self, current_time, step_size):
        """x(t + h) = e^(A h) x + integral of e^(A s) ds B u."""
        if step_size not in self.steps:
            from scipy.linalg import expm

            n = len(self.A)
            block = np.zeros((n + self.B.shape[1],) * 2)
            block[:n, :n], block[:n, n:] = self.A, self.B
            self.steps = {step_size: expm(block * step_size)[:n]}
        whole = self.steps[step_size]
        self.x = whole[:, : len(self.x)] @ self.x + whole[:, len(self.x) :] @ self.u
        return True
