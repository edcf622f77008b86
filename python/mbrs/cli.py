"""The command line: ``mbrs demo``, ``doctor``, ``check``, ``convert``, a command for each analysis. Heavy imports wait for the command."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

import mbrs as mb

_KINDS = ("receptance", "mobility", "accelerance", "transmissibility")
_INTERRUPTED = 130
_FUNCTIONS = "--functions"
_PAGES = (".html", ".htm")


class _Group(click.Group):
    """Turns errors of mbrs into one message and exit code 1, and Ctrl-C into 130; wrong usage stays at click's 2."""

    def invoke(self, ctx: click.Context) -> Any:
        from .errors import MbrsError

        try:
            return super().invoke(ctx)
        except MbrsError as problem:
            _say("error", "red", str(problem))
            ctx.exit(1)
        except KeyboardInterrupt:
            _say("stopped", "yellow", "interrupted by Ctrl-C, before there was a result")
            ctx.exit(_INTERRUPTED)


def _so_far(analysis: Callable[..., Any], *args: Any, **options: Any) -> Any:
    """Result of an analysis, or its partial result after Ctrl-C; `_deliver` then ends with the exit code of an interrupt."""
    from .errors import Interrupted

    try:
        return analysis(*args, **options)
    except Interrupted as cut:
        if cut.result is None:
            raise
        _say("stopped", "yellow", f"{cut}; this is the result so far")
        click.get_current_context().meta["interrupted"] = True
        return cut.result


def _say(word: str, colour: str, text: str) -> None:
    """One message on standard error, its first word coloured on a terminal."""
    from rich.console import Console
    from rich.text import Text

    Console(stderr=True, soft_wrap=True).print(Text(f"{word}: ", style=f"bold {colour}") + Text(text))


def _show_warning(message: Any, category: Any, *rest: Any) -> None:
    _say("warning", "yellow", str(message))


@click.group(cls=_Group, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
@click.version_option(None, "--version", package_name="mbrs-dynamics", prog_name="mbrs")
def main() -> None:
    """Vibration and motion of spatial multibody systems from the shell.

    Models are TOML files as written by Model.save, or files of other programs (URDF, MJCF). Exit code 0: done; 1: an error of the
    model or the analysis;
    2: wrong usage; 130: interrupted by Ctrl-C, after what there is so far was printed and saved.
    """
    import warnings

    from .errors import MbrsWarning

    warnings.simplefilter("always", MbrsWarning)
    warnings.showwarning = _show_warning  # type: ignore[assignment]


def _model_argument(command: Callable[..., Any]) -> Callable[..., Any]:
    path = click.Path(exists=True, dir_okay=False, path_type=Path)
    trusted = click.option(
        _FUNCTIONS, is_flag=True, expose_value=False, is_eager=True, callback=_trust,
        help="Import the Python functions that the file names, which runs their code.",
    )  # fmt: skip
    return click.argument("model", type=path, metavar="MODEL")(trusted(command))


def _trust(context: Any, parameter: Any, value: bool) -> None:
    context.meta[_FUNCTIONS] = value


def _known_ending(context: Any, parameter: Any, out: Path | None) -> Path | None:
    """Refuse an ending that says nothing before anything is computed."""
    from ._lib.formats import known

    return _with_ending(out, (*known("result", "write"), *_PAGES))


def _with_ending(out: Path | None, known: tuple[str, ...]) -> Path | None:
    if out is not None and out.suffix.lower() not in known:
        raise click.BadParameter(
            f"the ending {out.suffix!r} of {out.name!r} is not known; known are {', '.join(known)}"
        )
    return out


def _analysis_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Options that every analysis has."""
    at = (
        "State from which the motion starts."
        if command.__name__ == "simulate"
        else "State about which the model is linearised."
    )
    for option in (
        click.option("--at", type=click.Choice(["drawn", "equilibrium"]), default="drawn", show_default=True, help=at),
        click.option("--without", multiple=True, metavar="EFFECT", help="Leave an effect out; repeat for more."),
        click.option("--json", "as_json", is_flag=True, help="Print the result as JSON."),
        click.option("--out", type=click.Path(dir_okay=False, path_type=Path), metavar="FILE",
                     callback=_known_ending,
                     help="Save: .nc, .json (mbrs.load reads them), .csv, .html (a page), .pkl (a pickle), .uff."),
    ):  # fmt: skip
        command = option(command)
    return _model_argument(command)


@main.command()
@click.option("--out", type=click.Path(dir_okay=False, path_type=Path), default="mbrs-demo.html", show_default=True,
metavar="FILE",
              help="The page to write.")  # fmt: skip
def demo(out: Path) -> None:
    """Modes, transfer functions and sensitivities of a vibration isolator, and a page of them."""
    from .examples.demo import run

    click.echo(run(out))


@main.command()
@_model_argument
@click.option("--json", "as_json", is_flag=True, help="Print as JSON.")
def check(model: Path, as_json: bool) -> None:
    """Degrees of freedom, loops, redundant constraints and effects of a model."""
    m = _load(model)
    system, effects = mb.System(m), mb.effects(m)
    if as_json:
        from ._lib.jsonable import dumps, system_data

        click.echo(dumps({"analysis": "check", "file": str(model), **system_data(system, effects)}))
    else:
        click.echo(f"{system}\n\n{effects}")


@main.command()
@click.option("--json", "as_json", is_flag=True, help="Print as JSON.")
def doctor(as_json: bool) -> None:
    """Versions, threads, BLAS, optional packages and self-checks of this installation; exit code 1 where one fails."""
    from ._lib.jsonable import dumps
    from .studies.doctor import examine

    report = examine()
    click.echo(dumps(report.data()) if as_json else str(report))
    if not report.passed:
        click.get_current_context().exit(1)


@main.command()
@_model_argument
@click.argument("out", type=click.Path(dir_okay=False, path_type=Path), metavar="OUT")
def convert(model: Path, out: Path) -> None:
    """Write a model in the format that the ending of OUT says; what that format cannot hold is named."""
    from ._lib.formats import find

    find(out, "model", "write")
    try:
        _load(model).save(out)
    except OSError as problem:
        raise click.ClickException(f"cannot write {out}: {problem.strerror or problem}") from None
    click.echo(f"wrote {out}", err=True)


@main.command()
@_analysis_options
@click.option("--n", type=click.IntRange(min=1), help="How many of the lowest modes; all of them by default.")
@click.option("--shapes", is_flag=True, help="Put the mode shapes into the JSON as well.")
def modal(
    model: Path, at: str, without: tuple[str, ...], as_json: bool, out: Path | None, n: int | None, shapes: bool
) -> None:
    """Natural frequencies, damping ratios and mode shapes."""
    m = _load(model)
    result = mb.modes(m, **_state(m, at), **_without(without), **_count(n))
    _say_fewer(n, result)
    names = (
        "frequency",
        "frequency_damped",
        "damping",
        "eigenvalue",
        "kind",
        "groups",
        "backward_error",
        "coordinates",
    )
    _deliver("modal", model, result, (*names, "shape") if shapes else names, as_json, out)


@main.command()
@_analysis_options
@click.option("--input", "inputs", multiple=True, required=True, metavar="PORT",
              help="Such as payload.force.z, or base.z; repeat for more.")  # fmt: skip
@click.option("--output", "outputs", multiple=True, required=True, metavar="PORT",
              help="Such as payload.motion.z; repeat for more.")  # fmt: skip
@click.option("--frequency", required=True, metavar="HZ",
              help="1:200 (sampled as needed), 1:200:500 (evenly), or 1,2,5 (these).")  # fmt: skip
@click.option("--kind", type=click.Choice(_KINDS), help="Receptance by default; transmissibility for a base motion.")
def frf(
    model: Path, at: str, without: tuple[str, ...], as_json: bool, out: Path | None,
    inputs: tuple[str, ...], outputs: tuple[str, ...], frequency: str, kind: str | None,
) -> None:  # fmt: skip
    """Transfer functions between named inputs and outputs."""
    points = parse_frequency(frequency)
    if kind is None:
        kind = "transmissibility" if all(name.startswith("base.") for name in inputs) else "receptance"
    m = _load(model)
    result = mb.frf(
        m, inputs=list(inputs), outputs=list(outputs), frequency=points, kind=kind, **_state(m, at), **_without(without)
    )
    _deliver("frf", model, result, ("kind", "inputs", "outputs", "frequency", "value"), as_json, out)


@main.command()
@_analysis_options
@click.option("--parameter", "parameters", multiple=True, required=True, metavar="ADDRESS",
              help="Such as k_leg, payload.mass, leg0.at_b[2]; repeat for more.")  # fmt: skip
@click.option("--n", type=click.IntRange(min=1), help="How many of the lowest modes; all of them by default.")
def sens(
    model: Path,
    at: str,
    without: tuple[str, ...],
    as_json: bool,
    out: Path | None,
    parameters: tuple[str, ...],
    n: int | None,
) -> None:
    """Derivatives of natural frequencies and damping ratios by parameters."""
    m = _load(model)
    modes = mb.modes(m, **_state(m, at), **_without(without), **_count(n))
    _say_fewer(n, modes)
    result = mb.sensitivity(modes, list(parameters))
    _deliver(
        "sens",
        model,
        result,
        ("parameters", "labels", "units", "shapes", "values", "frequency", "damping"),
        as_json,
        out,
    )


@main.command()
@_analysis_options
@click.option("--input", "inputs", multiple=True, required=True, metavar="PORT",
              help="A force or torque such as payload.force.z; repeat for more.")  # fmt: skip
@click.option("--amplitude", "amplitudes", multiple=True, type=float, metavar="N",
              help="Amplitude of each input in N or N m, in their order; one for all of them. 1 by default.")  # fmt: skip
@click.option("--output", "outputs", multiple=True, required=True, metavar="MOTION",
              help="Such as payload.motion.z, or the name of a coordinate; repeat for more.")  # fmt: skip
@click.option("--frequency", required=True, metavar="HZ",
              help="1:40 (followed through folds), 1,2,5 (these), or one number with --level a:b.")  # fmt: skip
@click.option("--down", is_flag=True, help="Follow the range from its upper end.")
@click.option("--level", default="1", show_default=True, metavar="FACTOR", help="On the forces; 0.1:2 follows it.")
@click.option("--harmonics", default="auto", show_default=True, metavar="H", help="A number, 1,3,5 (these), or auto.")
@click.option(
    "--tol", type=float, metavar="ERROR", help="Largest estimated error called resolved; 1e-6 with auto, else 0.1."
)
@click.option("--no-stability", is_flag=True, help="Leave the Floquet exponents out.")
def nlfr(
    model: Path, at: str, without: tuple[str, ...], as_json: bool, out: Path | None, inputs: tuple[str, ...],
    amplitudes: tuple[float, ...], outputs: tuple[str, ...], frequency: str, down: bool, level: str, harmonics: str,
    tol: float | None, no_stability: bool,
) -> None:  # fmt: skip
    """Periodic response of a nonlinear model over frequency, by harmonic balance."""
    if len(amplitudes) not in (0, 1, len(inputs)):
        raise click.BadParameter(f"{len(amplitudes)} for {len(inputs)} inputs", param_hint="--amplitude")
    points, factor = parse_frequency(frequency), parse_level(level)
    if down and isinstance(points, tuple):
        points = points[::-1]
    m = _load(model)
    curve = _so_far(
        mb.frequency_response,
        m,
        inputs=list(inputs),
        amplitude=None if not amplitudes else amplitudes[0] if len(amplitudes) == 1 else list(amplitudes),
        frequency=float(points[0]) if isinstance(factor, tuple) and len(points) == 1 else points,
        level=factor,
        harmonics=parse_harmonics(harmonics),
        tol=tol,
        stability=not no_stability,
        **_state(m, at),
        **_without(without),
    )
    names = ("omega", "frequency", "level", "stable")
    extra = {
        "inputs": inputs,
        "outputs": outputs,
        "amplitude": [curve.amplitude(name) for name in outputs],
        "largest": [curve.amplitude(name, None) for name in outputs],
        "events": [
            {"kind": e.kind, "frequency": e.frequency, "level": e.level, "index": e.index,
             "amplitude": [curve.event_amplitude(e, name) for name in outputs]}
            for e in curve.events
        ],
    }  # fmt: skip
    _deliver("nlfr", model, curve, names, as_json, out, extra, curve.table(*outputs))


@main.command()
@_analysis_options
@click.option("--t", "times", required=True, metavar="S",
              help="10 (the end; outputs are the steps), 0:10:1001 (evenly), or 0,0.5,2 (these).")  # fmt: skip
@click.option("--method", default="auto", show_default=True, metavar="NAME",
              help="auto, explicit, generalized-alpha, radau, bdf, bdf-bfgs or ali3p.")  # fmt: skip
@click.option("--rtol", type=float, metavar="TOL", help="Tolerance of the controlled steps; 1e-7 by default.")
@click.option("--step", type=float, metavar="S", help="Fixed steps instead.")
@click.option("--output", "outputs", multiple=True, metavar="NAME",
              help="A body or marker (its position) or a joint (its coordinate) for the JSON and the table; repeat "
              "for more. All bodies by default.")  # fmt: skip
def simulate(
    model: Path, at: str, without: tuple[str, ...], as_json: bool, out: Path | None, times: str, method: str,
    rtol: float | None, step: float | None, outputs: tuple[str, ...],
) -> None:  # fmt: skip
    """Motion in time; --out page.html writes a page that plays it."""
    t = parse_times(times)
    m = _load(model)
    traj = _so_far(mb.simulate, m, t=t, method=method, rtol=rtol, step=step, **_state(m, at), **_without(without))
    curves = {name: _curve(traj, name) for name in outputs or traj.bodies}
    extra = {"outputs": {name: curve.tolist() for name, curve in curves.items()}, "energy": traj.energy.total.tolist()}
    text = f"{traj}\n{_extremes(traj, curves)}"
    _deliver("simulate", model, traj, ("t", "method", "residual"), as_json, out, extra, text)


def _known_data(context: Any, parameter: Any, out: Path | None) -> Path | None:
    """Endings of files of data."""
    from ._lib.result_files import WRITERS

    return _with_ending(out, tuple(WRITERS))


@main.command()
@click.argument("study", type=click.Path(exists=True, dir_okay=False, path_type=Path), metavar="STUDY.TOML")
@click.option("--threads", type=click.IntRange(min=1), help="Threads; as the file says by default, else one.")
@click.option(
    "--functions", is_flag=True, help="Let the file and its model name Python functions, which runs their code."
)
@click.option("--json", "as_json", is_flag=True, help="Print designs and outputs as JSON.")
@click.option("--out", type=click.Path(dir_okay=False, path_type=Path), metavar="FILE", callback=_known_data,
              help="Save: .nc, .json (mbrs.load reads them), .csv, .pkl (a pickle).")  # fmt: skip
def sweep(study: Path, threads: int | None, functions: bool, as_json: bool, out: Path | None) -> None:
    """Outputs of a model for many designs; Ctrl-C stops, and the same command goes on."""
    from .design.study import read

    found = read(study, functions)
    runs = _so_far(found.run, **({} if threads is None else {"executor": threads}))
    columns = {name: runs.designs[name] for name in runs.designs.names}
    extra = {
        "designs": columns,
        "outputs": dict(runs.outputs),
        "states": runs.states.tolist(),
        "store": str(found.store),
    }
    _deliver("sweep", study, runs, ("seconds",), as_json, out, extra)


def _curve(traj: Any, name: str) -> Any:
    """Over time: where a body or marker is, or the coordinate of a joint."""
    tables = traj.snapshot.tables
    if name in traj.bodies:
        return traj.position(name)
    return traj.point(name) if name in tables["marker_name"] else traj.joint(name)


def _extremes(traj: Any, curves: dict[str, Any]) -> str:
    from ._lib.text import table

    rows = []
    for name, curve in curves.items():
        columns = curve.reshape(len(traj.t), -1).T if len(traj.t) else []
        kinds = ("",) if len(columns) == 1 else tuple(f".{i}" for i in range(len(columns)))
        if name in traj.bodies or name in traj.snapshot.tables["marker_name"]:
            kinds = (".x", ".y", ".z")
        rows += [[name + kind, c[0], c[-1], c.min(), c.max()] for kind, c in zip(kinds, columns, strict=True)]
    return table(["m or rad", "start", "end", "least", "largest"], rows)


def _numbers(text: str, option: str, hint: str, least: float = float("-inf")) -> tuple[list[float], bool]:
    """The finite numbers of "a:b:n" (a range: true) or of "a,b,c"; the last of three in a range is a whole number."""
    import math

    parts = text.split(":")
    try:
        numbers = [float(part) for part in (parts if len(parts) > 1 else text.split(","))]
    except ValueError:
        numbers = [math.nan]
    counted = len(parts) != 3 or (
        math.isfinite(numbers[-1]) and numbers[-1] == int(numbers[-1]) and 2 <= numbers[-1] <= 1e8
    )
    if not all(math.isfinite(x) and x >= least for x in numbers) or len(parts) > 3 or not counted:
        raise click.BadParameter(f"{text!r} is not {hint}", param_hint=option)
    return numbers, len(parts) > 1


def parse_times(text: str) -> Any:
    """``"10"`` is the end, ``"0:10:1001"`` so many even times, ``"0,0.5,2"`` these, all in s.

    Raises ``click.BadParameter`` for anything else.
    """
    import numpy as np

    hint = "a valid time; use 10, 0:10:1001 or 0,0.5,2 (in s)"
    numbers, range_ = _numbers(text, "--t", hint)
    if range_ and len(numbers) == 2:
        raise click.BadParameter(f"{text!r} is not {hint}", param_hint="--t")
    if range_:
        return np.linspace(numbers[0], numbers[1], int(numbers[2]))
    return numbers[0] if len(numbers) == 1 else np.array(numbers)


def parse_level(text: str) -> Any:
    """``"1"`` is a number, ``"0.1:2"`` a range. Raises ``click.BadParameter`` for anything else."""
    hint = "a factor; write 1 or 0.1:2"
    numbers, range_ = _numbers(text, "--level", hint)
    if len(numbers) != (2 if range_ else 1):
        raise click.BadParameter(f"{text!r} is not {hint}", param_hint="--level")
    return (numbers[0], numbers[1]) if range_ else numbers[0]


def parse_harmonics(text: str) -> Any:
    """``"auto"``, ``"7"``, or ``"1,3,5"``. Raises ``click.BadParameter`` for anything else."""
    if text == "auto":
        return text
    try:
        numbers = [int(part) for part in text.split(",")]
    except ValueError:
        raise click.BadParameter(f"{text!r} is neither auto nor a number nor 1,3,5", param_hint="--harmonics") from None
    return numbers[0] if len(numbers) == 1 else numbers


def parse_frequency(text: str) -> Any:
    """``"1:200"`` is a range (tuple), ``"1:200:500"`` 500 even points, ``"1,2,5"`` these points, all in Hz.

    Raises ``click.BadParameter`` for anything else.
    """
    import numpy as np

    hint = "a frequency; write 1:200, 1:200:500 (so many points, at least two) or 1,2,5 (in Hz)"
    numbers, range_ = _numbers(text, "--frequency", hint, least=0.0)
    if not range_:
        return np.array(numbers)
    if numbers[1] <= numbers[0]:
        raise click.BadParameter(
            f"{text!r} does not rise: the second frequency must be above the first", param_hint="--frequency"
        )
    if len(numbers) == 2:
        return (numbers[0], numbers[1])
    return np.linspace(numbers[0], numbers[1], int(numbers[2]))


def _load(path: Path) -> Any:
    return mb.Model.load(path, functions=bool(click.get_current_context().meta.get(_FUNCTIONS)))


def _state(model: Any, at: str) -> dict[str, Any]:
    return {} if at == "drawn" else {"at": mb.equilibrium(model)}


def _without(names: tuple[str, ...]) -> dict[str, Any]:
    return {"without": names} if names else {}


def _count(n: int | None) -> dict[str, Any]:
    return {} if n is None else {"n": n}


def _say_fewer(n: int | None, modes: Any) -> None:
    found = len(modes.eigenvalue)
    if n is not None and found < n:
        _say("note", "yellow", f"--n asked for {n} modes; there are {found}")


def _deliver(
    analysis: str,
    model: Path,
    result: Any,
    names: tuple[str, ...],
    as_json: bool,
    out: Path | None,
    extra: dict[str, Any] | None = None,
    text: str | None = None,
) -> None:
    """Print the result, as text or JSON, and save it if asked to; ``extra`` data belong into the JSON as well.

    Ends with the exit code of an interrupt where the result was cut by one.
    """
    _print_and_save(analysis, model, result, names, as_json, out, extra, text)
    context = click.get_current_context()
    if context.meta.get("interrupted"):
        context.exit(_INTERRUPTED)


def _print_and_save(
    analysis: str,
    model: Path,
    result: Any,
    names: tuple[str, ...],
    as_json: bool,
    out: Path | None,
    extra: dict[str, Any] | None,
    text: str | None,
) -> None:
    from ._lib.jsonable import dumps, result_data

    if as_json:
        click.echo(dumps({"analysis": analysis, "file": str(model), **result_data(result, names), **(extra or {})}))
    else:
        click.echo(text or str(result))
    if out is None:
        return
    try:
        if out.suffix.lower() in _PAGES:
            from ._lib.files import write_atomic
            from .examples.demo import result_page

            outputs = tuple((extra or {}).get("outputs", ()))
            write_atomic(out, result_page(analysis, model.stem, result, outputs).encode())
        else:
            result.save(out)
    except ImportError as problem:
        install = "pip install 'mbrs-dynamics[xarray]'"
        raise click.ClickException(f"{out.suffix} needs {problem.name}, which is not installed: {install}") from None
    except OSError as problem:
        raise click.ClickException(f"cannot write {out}: {problem.strerror or problem}") from None
    click.echo(f"wrote {out}", err=True)


if __name__ == "__main__":
    sys.exit(main())
