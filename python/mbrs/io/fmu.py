"""Functional mock-up units (FMI 2, co-simulation), by pythonfmu: linear systems, and whole models.

https://fmi-standard.org/docs/2.0.5/ and https://github.com/NTNU-IHB/PythonFMU
"""

from __future__ import annotations

import hashlib
import io
import json
import pickle
import re
import tempfile
import zipfile
from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypedDict, Unpack
from xml.etree import ElementTree

import numpy as np

from .._lib.checks import names, shown
from .._lib.files import write_atomic
from .._lib.formats import Format, register
from ..errors import ModelError
from ..linear.first_order import StateSpace
from ..linear.linear_system import as_list
from ..model.model import Model
from ..model.ports import Port, as_port

if TYPE_CHECKING:
    from ..linear.aliases import Ports
    from ..results import Result

_PLAIN = re.compile(r"[A-Za-z_]\w*(\.[A-Za-z_]\w*)*", re.ASCII)
_STATE = re.compile(r"(.+)\.(velocity|angular_velocity|coordinate|rate|reaction)(?:\.([xyz])|\[(\d{1,3})\])?")


class StepOptions(TypedDict, total=False):
    """Options of `mbrs.simulate` that units take."""

    rtol: float
    step: float
    method: str
    without: Sequence[str]
    rho: float
    max_step: float


_OPTIONS = tuple(StepOptions.__annotations__)


def fmu(
    m: Model,
    path: str | Path,
    inputs: Ports,
    outputs: Ports,
    *,
    parameters: Sequence[str] | None = None,
    **options: Unpack[StepOptions],
) -> Path:
    """Write a model as an FMU for co-simulation: its whole motion, with forces and torques as inputs, motions and reactions as outputs.

    At each communication step the inputs are held and `mb.simulate` goes on from the last state. A linearised model is an FMU by
    ``mb.state_space(m, inputs, outputs).save("model.fmu")``, which steps exactly.

    Parameters
    ----------
    m
        The model as it is now; it begins in the drawn state with its given velocities.
    path
        Ends in ".fmu".
    inputs
        Forces and torques of bodies and markers (ports or their names), world axes, N or N m; the names of the variables.
    outputs
        Displacements of bodies and markers from the drawn configuration, m (ports such as ``body.motion("z")``), and by their names:
        "body.velocity.x" (of its origin, m/s) and "body.angular_velocity.x" (rad/s), world axes; "joint.coordinate" and "joint.rate",
        "joint.coordinate[1]" where a joint has several (rad and m); "joint.reaction[2]" of the wrench on its second body.
    parameters
        Names of model parameters (single numbers) that are tunable; all by default.
    **options
        Of `mb.simulate`: rtol, step, method, without, rho, max_step.

    Returns
    -------
    Path

    Raises
    ------
    ModelError
        Ports of another kind, an unknown option, or pythonfmu is not installed.

    Notes
    -----
    The unit runs Python: the importing tool needs the environment's Python with mbrs and pythonfmu (`needsExecutionTool`). A function in
    the model must be importable by name there, and units do not call such functions. Held inputs are an error of first order in the
    communication step.

    Examples
    --------
    >>> import tempfile, pathlib, mbrs as mb
    >>> m = mb.examples.cubic_hexapod()
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = mb.fmu(m, pathlib.Path(folder) / "isolator.fmu", "payload.force.z", "payload.motion.z")
    ...     path.stat().st_size > 1000
    True
    """
    path = Path(path)
    if path.suffix.lower() != ".fmu":
        raise ModelError(f"an FMU ends in .fmu, and {path.name} does not")
    for name in options:
        if name not in _OPTIONS:
            raise ModelError(f"mb.fmu has no {name}=; options of mb.simulate that units take are {', '.join(_OPTIONS)}")
    given = (
        [name for name, value in _numbers(m).items()] if parameters is None else list(names("parameters", parameters))
    )
    for name in given:
        if name not in _numbers(m):
            raise ModelError(f"parameters= names {shown(name)}, which is not a parameter of {m.name!r} with one number")
    copy: Model = pickle.loads(pickle.dumps(m))
    driven = {
        variable(port.name): _drive(copy, i, port) for i, port in enumerate(as_port(m, p) for p in as_list(inputs))
    }
    told = {
        "description": f"motion of {m.name}, written by mbrs",
        "inputs": dict.fromkeys(driven, 0.0),
        "input_parameters": driven,
        "outputs": [_observed(m, p) for p in as_list(outputs)],
        "parameters": given,
        "options": options,
    }
    with tempfile.TemporaryDirectory() as folder:
        copy.save(Path(folder) / "mbrs_fmu_model.toml")
        (Path(folder) / "mbrs_fmu.json").write_text(json.dumps(told), encoding="utf-8")
        return _build("_fmu_model.py", ["mbrs_fmu_model.toml", "mbrs_fmu.json"], Path(folder), path)


def _numbers(m: Model) -> dict[str, float]:
    return {name: float(m.value(name)) for name in m.parameters if np.ndim(m.value(name)) == 0}


def variable(name: str) -> str:
    """A name as FMI's structured naming has it: quoted unless it is made of identifiers."""
    return name if _PLAIN.fullmatch(name) else "'" + name.replace("\\", "\\\\").replace("'", "\\'") + "'"


def _drive(copy: Model, i: int, port: Port) -> str:
    """A load along a port whose size is a new parameter; its name."""
    if port.kind not in ("force", "torque"):
        raise ModelError(f"the input {port.name!r} is a {port.kind}; inputs of an FMU are forces and torques")
    label = f"mbrs_input_{i}"
    size = copy.parameter(label, 0.0)
    value = tuple(size * d for d in port.direction)
    if port.kind == "torque":
        copy.torque(f"mbrs_load_{i}", port.body, value=value)
    else:
        copy.force(f"mbrs_load_{i}", port.body, at=_drawn(copy, port), value=value)
    return label


def _observed(m: Model, given: Any) -> dict[str, Any]:
    found = _STATE.fullmatch(given) if isinstance(given, str) else None
    if found is not None:
        return _state(m, given, *found.groups())
    port = as_port(m, given)
    if port.kind != "motion" or port.is_rotation:
        raise ModelError(
            f"the output {port.name!r} is not a displacement; outputs of an FMU are such as body.motion('z'), 'body.velocity.z', "
            "'body.angular_velocity.z', 'joint.coordinate', 'joint.rate' and 'joint.reaction[2]'"
        )
    at = _drawn(m, port)
    name = variable(port.name)
    return {
        "name": name, "kind": "motion", "owner": port.body, "point": at, "drawn": at, "direction": port.direction
    }  # fmt: skip


def _state(m: Model, name: str, owner: str, kind: str, axis: str | None, entry: str | None) -> dict[str, Any]:
    """An output that belongs to a body or a joint."""
    item = m[owner]
    size = 3
    if kind in ("velocity", "angular_velocity"):
        good = item.kind == "body" and axis is not None
    else:
        good = item.kind == "joint" and axis is None
        size = 6 if kind == "reaction" else len(item.table.free) if good else 0
    place = "xyz".index(axis) if axis else int(entry or 0)
    if not good or place >= size or (entry is None and axis is None and size > 1):
        raise ModelError(
            f"the output {shown(name)} does not fit {item!r}; outputs are such as 'body.velocity.z', 'joint.coordinate' where there is one "
            "coordinate, 'joint.coordinate[1]' and 'joint.reaction[5]'"
        )
    return {"name": variable(name), "kind": kind, "owner": owner, "entry": place}


def _drawn(m: Model, port: Port) -> tuple[float, ...]:
    """The drawn world point of a port on a rigid body."""
    if port.body not in m.body_index or m[port.body].nodes:
        raise ModelError(
            f"the port {port.name!r} is not on a rigid body; give a point of one, or save mb.state_space(...) as an FMU"
        )
    if port.point is not None:
        return port.point
    return tuple(float(x) for x in m[port.marker or port.body].values("at"))


def write(thing: Result, path: Path) -> Path:
    """Write a `StateSpace` as an FMU that steps exactly with held inputs.

    Raises
    ------
    ModelError
        Another result.
    """
    if not isinstance(thing, StateSpace):
        raise ModelError(
            f"an FMU holds the result of mb.state_space, not a {type(thing).__name__}; mb.fmu writes models"
        )
    with tempfile.TemporaryDirectory() as folder:
        np.savez(
            Path(folder) / "mbrs_fmu.npz",
            **{name: getattr(thing, name) for name in "ABCD"},
            inputs=np.array([variable(name) for name in thing.inputs], dtype=str),
            outputs=np.array([variable(name) for name in thing.outputs], dtype=str),
            description=np.array("linear system, written by mbrs"),
        )
        return _build("_fmu_linear.py", ["mbrs_fmu.npz"], Path(folder), Path(path))


def _build(slave: str, resources: list[str], folder: Path, path: Path) -> Path:
    try:
        from pythonfmu.builder import FmuBuilder
    except ImportError:
        raise ModelError("an FMU needs pythonfmu, which is not installed: pip install 'mbrs-dynamics[fmu]'") from None
    code = files("mbrs.io").joinpath(slave).read_bytes()
    # a name of its own: a process may hold several units, and knows modules by their names
    content = hashlib.sha256(b"".join([code, *((folder / name).read_bytes() for name in resources)]))
    script = folder / f"mbrs_fmu_{content.hexdigest()[:12]}.py"
    script.write_bytes(code)
    out = folder / "out"
    out.mkdir()
    made = FmuBuilder.build_FMU(script, dest=out, project_files=[folder / name for name in resources])
    return write_atomic(path, _with_unknowns(Path(made)))


def _with_unknowns(made: Path) -> bytes:
    """The bytes of a unit, its outputs named as unknowns of the initialisation, which pythonfmu leaves out."""
    out = io.BytesIO()
    with zipfile.ZipFile(made) as old, zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as new:
        for entry in old.infolist():
            data = old.read(entry)
            if entry.filename == "modelDescription.xml":
                root = ElementTree.fromstring(data)
                structure = root.find("ModelStructure")
                if structure is not None and structure.find("InitialUnknowns") is None:
                    unknowns = ElementTree.SubElement(structure, "InitialUnknowns")
                    unknowns.extend(structure.findall("Outputs/Unknown"))
                data = ElementTree.tostring(root, encoding="utf-8", xml_declaration=True)
            new.writestr(entry, data)
    return out.getvalue()


register(Format(".fmu", "result", "FMU 2 for co-simulation", None, write))
