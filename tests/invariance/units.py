"""Models with numbers in other units: the same answers, in those units."""

from __future__ import annotations

import numpy as np
from descriptions import Change

FREE = {
    "fixed": "",
    "revolute": "r",
    "prismatic": "t",
    "cylindrical": "tr",
    "universal": "rr",
    "spherical": "rrr",
    "planar": "ttr",
    "free": "tttrrr",
    "distance": "",
    "knife_edge": "",
    "rolling_disc": "",
    "screw": "r",
    "point_on_line": "t",
}
COORDINATES = {"u": "t", "angle": "r", "alpha": "r", "beta": "r", "x": "t", "y": "t", "z": "t"}
COORDINATES |= {"rx": "r", "ry": "r", "rz": "r"}


def in_units(length, mass=1.0, time=1.0, name=None) -> Change:
    """The same thing with numbers in other units: one metre is ``length`` of the new ones, and so on."""

    def u(*powers):  # of length, mass, time
        return length ** powers[0] * mass ** powers[1] * time ** powers[2]

    displacement = {"t": length, "r": 1.0}
    force = {"t": u(1, 1, -2), "r": u(2, 1, -2)}

    def stiffness(kinds, more=0):
        """Of coordinates of the given kinds, or a matrix of them; ``more``: powers of time."""
        return np.array([[force[i] / displacement[j] for j in kinds] for i in kinds]) * time**more

    def scaled(value, factor):
        return (np.array(value, float) * factor).tolist()

    def matrix_or_diagonal(value, kinds, more):
        full = stiffness(kinds, more)
        return scaled(value, full if np.ndim(value) == 2 else np.diag(full) if np.ndim(value) else full[0, 0])

    def law(made, kind):
        f, x = force[kind], displacement[kind]
        v, n, p = x / time, len(made["values"]), made["values"]
        half = n // 2
        factors = {
            "Cubic": lambda: [f / x**3],
            "Gap": lambda: [f / x, x, x],
            "CoulombTanh": lambda: [f, v],
            "Hertz": lambda: [f / x ** p[1], 1.0, x],
            "TableLaw": lambda: [x] * half + [f] * half,
            "VanDerPol": lambda: [f / (x * x * v)],
            "Jenkins": lambda: [f / x, f],
            "Polynomial1D": lambda: (
                [f / x**i for i in range(n)]
                if made["code"] == 1
                else [f / x**i for i in range(half)] + [f / v**i for i in range(half)]
            ),
        }[made["type"]]()
        return {**made, "values": scaled(p, np.array(factors))}

    def laws(table, kinds_of):
        if "law" in table:
            table["law"] = {
                key: [law(one, kinds_of(key)) for one in (many if isinstance(many, list) else [many])]
                for key, many in table["law"].items()
            }

    def preload(table, kinds):
        if "preload" in table:
            factor = np.array([force[i] for i in kinds]) if np.ndim(table["preload"]) else force[kinds]
            table["preload"] = scaled(table["preload"], factor)

    def motion(given, factor):
        if not isinstance(given, dict):
            return scaled(given, factor)
        by_type = {
            "Ramp": {"rate": factor / time, "offset": factor, "start": time},
            "Sine": {"amplitude": factor, "omega": 1 / time, "frequency": 1 / time, "phase": 1.0, "offset": factor},
            "Table": {"t": time, "value": factor},
        }
        if given["type"] == "Polynomial":
            made = [c * factor / time**i for i, c in enumerate(given["coefficients"])]
            return {**given, "coefficients": made}
        factors = by_type[given["type"]]
        return {k: scaled(v, factors[k]) if k in factors else v for k, v in given.items()}

    def apply(d):
        d = d.copy()
        if "gravity" in d.data["model"]:
            d.data["model"]["gravity"] = scaled(d.data["model"]["gravity"], u(1, 0, -2))
        for b in d["body"]:
            if "modal_body" in b:
                raise ValueError("flexible bodies keep their units here")
            factors = {"mass": u(0, 1, 0), "inertia": u(2, 1, 0), "at": length, "com": length}
            factors |= {"velocity": u(1, 0, -1), "angular_velocity": u(0, 0, -1)}
            for key, factor in factors.items():
                if key in b:
                    b[key] = scaled(b[key], factor)
            if "pose" in b:
                b["pose"] = [scaled(b["pose"][0], length), b["pose"][1]]
        for item in (*d["joint"], *d["element"], *d["marker"], *d["load"]):
            for key in ("at", "length", "radius"):
                if key in item:
                    item[key] = scaled(item[key], length)
        for j in d["joint"]:
            kinds = FREE[j["type"]]
            for key, more in (("k", 0), ("c", 1)):
                if key in j:
                    j[key] = matrix_or_diagonal(j[key], kinds, more)
            preload(j, kinds)
            laws(j, lambda key, j=j: "r" if j["type"] in ("spherical", "universal") else COORDINATES[key])
        for e in d["element"]:
            kinds = {"spring_damper": "t", "torsion": "r", "bushing": "tttrrr"}[e["type"]]
            for key, more in (("k", 0), ("c", 1)):
                if key in e:
                    e[key] = matrix_or_diagonal(e[key], kinds, more)
            preload(e, kinds)
            laws(e, lambda key: COORDINATES[key])
        for load in d["load"]:
            factor = force["t" if load["type"] == "force" else "r"]
            load["value"] = (
                [motion(v, factor) for v in load["value"]]
                if isinstance(load["value"], list)
                else motion(load["value"], factor)
            )
        types = {j["name"]: FREE[j["type"]] for j in d["joint"]}

        def kind_of(joint, coordinate):
            kinds = types[joint]
            return kinds if len(kinds) == 1 else COORDINATES[coordinate]

        for drive in d["drive"]:
            drive["motion"] = motion(drive["motion"], displacement[kind_of(drive["joint"], drive.get("coordinate"))])
        for c in d["coupler"]:
            first = displacement[kind_of(c["first"], c.get("first_coordinate"))]
            second = displacement[kind_of(c["second"], c.get("second_coordinate"))]
            c["ratio"] = scaled(c["ratio"], second / first)
            if "offset" in c:
                c["offset"] = scaled(c["offset"], second)
        return d

    return Change(
        name or f"length {length:g}, mass {mass:g}, time {time:g}", apply, length=length, mass=mass, time=time
    )
