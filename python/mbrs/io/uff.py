"""Universal files (UFF): functions (58), modes (55), geometry (15, 82), header (151) and units (164), by pyuff."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .._lib.files import write_atomic
from .._lib.formats import Format, Omission, open_file, register, warn_of_omissions
from ..errors import ModelError
from ._matrices import guarded
from ._uff_codes import AXES, CODES, KINDS, NUMERATORS, QUANTITIES, direction_code, direction_name

if TYPE_CHECKING:
    from ..linear.frf import FrfResult
    from ..linear.measurement import MeasuredFunction, Measurement
    from ..linear.modal_result import ModalResult

# The first line of functions that mbrs wrote: the names of ports are in the last two lines.
_MARK = "mbrs "
_LINE = 80  # characters of an identification line
_READ = (15, 55, 58, 82, 151, 164)
Set = dict[str, Any]


def _library() -> Any:
    try:
        import pyuff
    except ImportError:
        raise ModelError("UFF needs pyuff, which is not installed: pip install 'mbrs-dynamics[files]'") from None
    return pyuff


def read(path: Path, functions: bool = False) -> Measurement:
    """Everything of the known data sets, in SI units as data set 164 says; the others are named."""
    open_file(path)
    library = _library()

    omissions: list[Omission] = []

    def load() -> Measurement:
        file = library.UFF(str(path))
        types = [int(t) for t in file.get_set_types()]
        if not types:
            raise ModelError(f"{path.name} has no data sets, so it is not a universal file")
        omissions.extend(Omission(f"data set {i + 1}", f"type {t}") for i, t in enumerate(types) if t not in _READ)
        wanted = [i for i, t in enumerate(types) if t in _READ]
        sets = [file.read_sets(i) for i in wanted]
        return _Reader(path, sets, omissions).measurement()

    made: Measurement = guarded(path, "UFF", load)
    warn_of_omissions(path.name, omissions)
    return made


class _Reader:
    def __init__(self, path: Path, sets: list[Set], omissions: list[Omission]) -> None:
        self.path, self.sets, self.omissions = path, sets, omissions
        units = next((s for s in sets if s["type"] == 164), {"length": 1.0, "force": 1.0})
        self.length, self.force = float(units["length"]), float(units["force"])
        if not (math.isfinite(self.length) and math.isfinite(self.force) and self.length > 0.0 and self.force > 0.0):
            raise ModelError(f"{path.name}: the unit factors of data set 164 must be positive")

    def measurement(self) -> Measurement:
        """All sets together."""
        from ..linear.measurement import Measurement

        place: dict[int, np.ndarray] = {}
        for s in self.sets:
            if s["type"] == 15:
                for i, x, y, z in zip(*(s[k] for k in ("node_nums", "x", "y", "z")), strict=True):
                    place[int(i)] = np.array([x, y, z], dtype=float) / self.length
        modes = [s for s in self.sets if s["type"] == 55 and self._is_mode(s)]
        for s in modes:
            for i in np.atleast_1d(s["node_nums"]):
                place.setdefault(int(i), np.full(3, np.nan))
        nodes = list(place)
        index = {n: i for i, n in enumerate(nodes)}
        shape = np.zeros((6, len(nodes), len(modes)), dtype=complex)
        eigenvalue = np.zeros(len(modes), dtype=complex)
        for k, s in enumerate(modes):
            rows = [index[int(i)] for i in np.atleast_1d(s["node_nums"])]
            eigenvalue[k] = _eigenvalue(s)
            for c in range(6):
                if f"r{c + 1}" in s:
                    shape[c, rows, k] = s[f"r{c + 1}"]
        names = _node_names(self.sets)
        return Measurement(
            np.array(nodes, dtype=int),
            np.array([place[n] for n in nodes], dtype=float).reshape(-1, 3),
            tuple(names.get(n, str(n)) for n in nodes),
            tuple(line for s in self.sets if s["type"] == 82 for line in _polygons(s)),
            tuple(self._function(s) for s in self.sets if s["type"] == 58),
            eigenvalue,
            shape,
            self.path.name,
            error=None,
            status="measured",
        )

    def _is_mode(self, s: Set) -> bool:
        if s["analysis_type"] in (2, 3, 7):
            return True
        self.omissions.append(
            Omission(f"data set 55 {str(s.get('id1', ''))[:40]!r}", f"analysis type {s['analysis_type']}")
        )
        return False

    def _function(self, s: Set) -> MeasuredFunction:
        from ..linear.measurement import MeasuredFunction

        over, under = self._quantity(s, "ordinate", "rsp_dir"), self._quantity(s, "orddenom", "ref_dir")
        kind = KINDS.get(s["func_type"], f"function type {s['func_type']}")
        factor = over[1] / (under[1] if kind == "frequency response" else 1.0)
        ours = str(s["id1"]).startswith(_MARK)
        response, reference = (
            (s["id4"], s["id5"]) if ours else (_place(s["rsp_node"], s["rsp_dir"]), _place(s["ref_node"], s["ref_dir"]))
        )
        value = np.asarray(s["data"]) * factor
        x = np.asarray(s["x"], dtype=float)
        if x.shape != value.shape or x.ndim != 1:
            raise ModelError(f"{self.path.name}: a function of {response} has {len(value)} values over {len(x)} points")
        what = f"{over[0]}/{under[0]}" if kind == "frequency response" and under[0] else over[0]
        return MeasuredFunction(kind, str(response), str(reference), what, str(s["ordinate_axis_units_lab"]), x, value)

    def _quantity(self, s: Set, which: str, direction: str) -> tuple[str, float]:
        """Name, and the factor to SI units."""
        code = s[f"{which}_spec_data_type"]
        name, along, about = QUANTITIES.get(code, (f"quantity {code}" if code else "", (0, 0), (0, 0)))
        length, force = about if abs(s[direction]) > 3 else along
        if code == 1:
            length, force = s[f"{which}_len_unit_exp"], s[f"{which}_force_unit_exp"]
        return name, self.length ** -float(length) * self.force ** -float(force)


def _place(node: int, direction: int) -> str:
    named = direction_name(direction) if abs(direction) <= 6 else ""
    return f"{node}:{named}" if named else str(node)


def _eigenvalue(s: Set) -> complex:
    if s["analysis_type"] in (3, 7):
        return complex(s["eig"])
    omega, zeta = 2.0 * math.pi * float(s["freq"]), float(s.get("modal_damp_vis", 0.0))
    return complex(-zeta * omega, omega * math.sqrt(max(0.0, 1.0 - zeta * zeta)))


def _polygons(s: Set) -> list[tuple[int, ...]]:
    """The lines of a trace: a node 0 lifts the pen."""
    lines: list[list[int]] = [[]]
    for n in np.atleast_1d(s["nodes"]).astype(int):
        if n:
            lines[-1].append(int(n))
        elif lines[-1]:
            lines.append([])
    return [tuple(line) for line in lines if len(line) > 1]


def _node_names(sets: Sequence[Set]) -> dict[int, str]:
    """Names that mbrs left in the identification line of its traces, "mbrs 3 = payload"."""
    found = {}
    for s in sets:
        words = str(s.get("id", "")).split(" ", 3) if s["type"] == 82 else []
        if len(words) == 4 and words[0] == _MARK.strip() and words[2] == "=" and words[1].isdigit():
            found[int(words[1])] = words[3]
    return found


def write(thing: Any, path: Path) -> Path:
    """Write transfer functions (binary, all digits) or modes (six digits, as data set 55 holds).

    Raises
    ------
    ModelError
        Another result.
    """
    from ..linear.frf import FrfResult
    from ..linear.modal_result import ModalResult

    writers: dict[type, Callable[[Any, list[Omission]], list[Set]]] = {FrfResult: _frf_sets, ModalResult: _mode_sets}
    if type(thing) not in writers:
        raise ModelError(
            f"UFF holds transfer functions and modes, not a {type(thing).__name__}; save it as .nc or .json"
        )
    library = _library()
    omissions: list[Omission] = []
    sets = [_header(path), _units(), *writers[type(thing)](thing, omissions)]
    with tempfile.TemporaryDirectory() as folder:
        made = Path(folder) / "made.uff"
        library.UFF(str(made)).write_sets(sets, mode="overwrite")
        done = write_atomic(path, made.read_bytes())
    warn_of_omissions(Path(path).name, omissions)
    return done


def _header(path: Path) -> Set:
    empty = dict.fromkeys(("date_db_created", "time_db_created", "date_db_saved", "time_db_saved"), "")
    written = dict.fromkeys(("date_file_written", "time_file_written"), "")
    named = {"model_name": Path(path).stem[:_LINE], "description": "", "db_app": "mbrs", "program": "mbrs"}
    return {"type": 151, **named, **empty, **written, "version_db1": "0", "version_db2": "0", "file_type": "0"}


def _units() -> Set:
    return {
        "type": 164, "units_code": 1, "units_description": "SI", "temp_mode": 1, "length": 1.0, "force": 1.0, "temp": 1.0,
        "temp_offset": 273.15,
    }  # fmt: skip


class _Nodes:
    """Numbers of bodies, markers or coordinates, from 1."""

    def __init__(self) -> None:
        self.numbers: dict[str, int] = {}

    def of(self, name: str) -> int:
        """The number of a name."""
        return self.numbers.setdefault(name, len(self.numbers) + 1)

    def geometry(self, at: dict[str, np.ndarray], lines: Sequence[tuple[str, str]] = ()) -> list[Set]:
        """Data sets of the nodes that are somewhere, their names, and lines between them."""
        known = [name for name in self.numbers if name in at]
        if not known:
            return []
        xyz = np.array([at[name] for name in known], dtype=float)
        nodes = np.array([self.numbers[name] for name in known])
        sets: list[Set] = [{"type": 15, "node_nums": nodes, "x": xyz[:, 0], "y": xyz[:, 1], "z": xyz[:, 2]}]
        for i, name in enumerate(known):
            n = self.numbers[name]
            sets.append(
                {
                    "type": 82,
                    "trace_num": i + 1,
                    "id": f"{_MARK}{n} = {name}"[:_LINE],
                    "color": 0,
                    "nodes": np.array([n, 0]),
                }
            )
        drawn = [(self.numbers[a], self.numbers[b]) for a, b in lines if a in at and b in at and a != b]
        for i, pair in enumerate(drawn):
            sets.append(
                {"type": 82, "trace_num": len(known) + i + 1, "id": "line", "color": 0, "nodes": np.array([*pair, 0])}
            )
        return sets


def _split(port: str) -> tuple[str, int]:
    """The owner of a port and its direction: "payload.motion.-z" is ("payload", -3)."""
    owner, _, direction = port.rpartition(".")
    code = direction_code(direction)
    if code == 0:
        return port, 0
    owner, _, kind = owner.rpartition(".")
    return owner or kind, code + (3 if code > 0 else -3) * (kind == "torque" and abs(code) <= 3)


def _frf_sets(h: FrfResult, omissions: list[Omission]) -> list[Set]:
    nodes, sets = _Nodes(), []
    under = "force" if h.kind != "transmissibility" else "displacement"
    for name in (*h.outputs, *h.inputs):
        if len(name) > _LINE:
            omissions.append(Omission(f"port {name[:40]!r}", "end of a long name"))
    for (i, output), (j, source) in ((o, s) for o in enumerate(h.outputs) for s in enumerate(h.inputs)):
        (a, response), (b, reference) = _split(output), _split(source)
        sets.append(
            {
                "type": 58, "binary": 1, "func_type": 4, "id1": f"{_MARK}{h.kind}", "id4": output[:_LINE], "id5": source[:_LINE],
                "rsp_node": nodes.of(a), "rsp_dir": response, "ref_node": nodes.of(b), "ref_dir": reference,
                "rsp_ent_name": a[:10], "ref_ent_name": b[:10],
                "abscissa_spacing": 0, "abscissa_min": 0.0, "abscissa_inc": 0.0, "num_pts": len(h.frequency),
                "abscissa_spec_data_type": CODES["frequency"], "abscissa_axis_lab": "frequency", "abscissa_axis_units_lab": "Hz",
                "ordinate_spec_data_type": CODES[NUMERATORS[h.kind]], "ordinate_axis_lab": h.kind,
                "orddenom_spec_data_type": CODES[under], "z_axis_value": 0.0, "z_axis_spec_data_type": 0,
                "x": np.asarray(h.frequency, dtype=float), "data": np.asarray(h.value[i, j], dtype=complex),
            }
        )  # fmt: skip
    model = getattr(h.origin, "model", None)
    at = {}
    for name in nodes.numbers:
        if (
            hasattr(model, "items")
            and model is not None
            and name in model
            and getattr(model[name], "kind", "") in ("body", "marker")
        ):
            at[name] = np.array(model[name].values("at"))
    return [*nodes.geometry(at), *sets]


def _mode_sets(modes: ModalResult, omissions: list[Omission]) -> list[Set]:
    scene = modes.geometry
    if scene is None:
        raise ModelError("these are modes of plain matrices, which have no nodes; save them as .nc or .json")
    nodes = _Nodes()
    names = [body.name for body in scene.bodies]
    shapes = np.array([modes.body_shape(name) for name in names])  # (n_body, 6, n_mode)
    numbers = np.array([nodes.of(name) for name in names])
    ends = [(one.a, one.b) for one in scene.joints] + [(one.a, one.b) for one in scene.links]
    lines = [(a, b) for a, b in ends if a and b]
    sets = nodes.geometry({body.name: np.array(body.origin) for body in scene.bodies}, lines)
    for k, s in enumerate(modes.eigenvalue):
        shape = shapes[:, :, k]
        given: Set = {
            "type": 55, "id1": f"{_MARK}mode {k + 1}", "model_type": 1, "spec_data_type": 8, "load_case": 0, "mode_n": k + 1,
            "node_nums": numbers,
        }  # fmt: skip
        real = not np.any(shape.imag)
        columns = shape.real if real else shape
        if not real and np.any(shape[:, 3:]):
            omissions.append(Omission(f"mode {k + 1}", "rotations of a complex shape"))
        used = AXES if real else AXES[:3]
        given |= {f"r{c + 1}": np.ascontiguousarray(columns[:, c]) for c in range(len(used))}
        if real:
            zeta = 0.0 if s == 0 else float(-s.real / abs(s))
            given |= {
                "analysis_type": 2,
                "data_ch": 3,
                "freq": abs(s) / (2.0 * math.pi),
                "modal_damp_vis": zeta,
                "modal_m": 1.0,
            }
        else:
            given |= {"analysis_type": 3, "data_ch": 2, "eig": complex(s), "modal_a": 0j, "modal_b": 0j}
        sets.append(given)
    return sets


for _ending in (".uff", ".unv"):
    register(Format(_ending, "result", "universal file", read, write))
