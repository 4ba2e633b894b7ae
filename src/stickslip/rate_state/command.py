"""``stickslip rsf``: whether a rig is rate-and-state-like, and fits of measured
velocity steps.
"""

import json as jsonlib
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import Parameter

from stickslip.arrays import units_of
from stickslip.errors import InputError
from stickslip.io import rig_files
from stickslip.measure import read_trace
from stickslip.model import Rig
from stickslip.model.quantities import read_value
from stickslip.progress import Progress, bar
from stickslip.rate_state.equivalent_law import rate_and_state
from stickslip.rate_state.experiments import healing
from stickslip.rate_state.exports import Program, export_rate_and_state
from stickslip.rate_state.measured import StepFit, fit_rate_and_state
from stickslip.rate_state.record import RecordFit, fit_record
from stickslip.simulation.steps_and_holds import slide_hold_slide

Text = str | None


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class Options:
    """Options for a rig and for a measured trace.

    Parameters
    ----------
    law
        Which law to fit.
    velocity
        Velocity of a rig before the step; by default its own.
    step
        Ratio of the velocities.
    holds
        Also slide, hold and slide, with these hold times: '1 s, 10 s'.
    export
        Print, or write, the input of another program.
    load
        Normal load, for coefficients and the export: '2 kN'.
    area
        Area of the surface, for the export: '1 cm^2'.
    output
        Write the export to a file.
    step_at
        For a trace: fit only the step nearest to this time, '68.7 s'.
    from_
        For a trace: velocity before the step, if no displacement shows it: '3 um/s'.
    to
        For a trace: velocity after the step.
    span
        For a trace: displacements before and after each step, '5 um, 120 um'.
    trend
        For a trace: also fit a linear trend in displacement.
    stiffness
        For a trace: stiffness, '0.006 1/um'; fitted by default.
    json
        Print JSON for a machine to read.
    displacement
        For a trace: column of the displacement, by name or number.
    force
        For a trace: column of the friction, by name or number.
    plot
        Draw a trace with its steps, holds and fits, or the peaks after holds.
    """

    law: Literal["best", "ageing", "slip"] = "best"
    velocity: Text = None
    step: str = "10"
    holds: Text = None
    export: Program | None = None
    load: Text = None
    area: Text = None
    output: Annotated[Path | None, Parameter(alias="-o")] = None
    step_at: Text = None
    from_: Annotated[str | None, Parameter(name="--from")] = None
    to: Text = None
    span: Text = None
    trend: bool = True
    stiffness: Text = None
    json: Annotated[bool, Parameter(negative="")] = False
    displacement: Text = None
    force: Text = None
    plot: Path | None = None


def rsf(data: Path, *, given: Options = Options()) -> None:
    """Report whether a rig is rate-and-state-like, or fit rate and state to the
    velocity steps of a measured trace, and evaluate its holds.

    If the interface is not rate-and-state-like, the exit code is 2, and the message
    gives the number that fails.

    Parameters
    ----------
    data
        A rig file in TOML, the name of an example, or a measured trace.
    """
    named = not data.exists() and data.name in rig_files.example_names()
    if given.step_at is None and (data.suffix == ".toml" or named):
        content, words = _judged(data, given)
    elif given.holds is None:
        with bar(f"rsf {data.name}", first=10.0, every=10.0) as report:
            found = _fitted(data, given, report)
        content = found.to_dict()
        words = f"{found}\n"
        if given.plot is not None:
            from stickslip import plot

            if isinstance(found, RecordFit):
                picture = plot.steps_and_holds(found)
            else:
                length = found.step.length_unit
                picture = plot.velocity_step(found.step, [found], length=length)
            plot.save(picture, given.plot)
    else:
        raise InputError("--holds: is for a rig; a measured trace has its own")
    print(
        jsonlib.dumps(content, indent=2) + "\n" if content and given.json else words,
        end="",
    )


def _judged(path: Path, given: Options) -> tuple[dict[str, Any], str]:
    """Return the verdict on a rig as numbers and as text; for an export, text only."""
    rig = rig_files.read_rig(path)
    _check(path, rig, given)
    speed = rig.velocity
    if given.velocity is not None:
        speed = _read("--velocity", given.velocity, rig, "m/s", "1 um/s")
    fit = rate_and_state(
        rig.natural.interface,
        speed / rig.unit("x_s/time"),
        step=read_value("--step", given.step, "1", "10", bare=True),
        law=given.law,
    )
    if not fit.holds:
        raise InputError(f"{path}: not rate-and-state: {fit.reason}")
    scaled = fit.in_units(rig)
    if given.export and given.load and rig.scales:
        text = export_rate_and_state(
            scaled,
            given.export,
            scales=rig.scales,
            load=given.load,
            area=given.area,
            path=given.output,
        )
        return {}, text if given.output is None else f"{given.export}: {given.output}\n"
    content = scaled.to_dict()
    words = f"{scaled}\n"
    if given.load:
        weight = read_value("--load", given.load, "N", "2 kN")
        mu, a, b = (
            value / weight for value in (scaled.kinetic_friction, scaled.a, scaled.b)
        )
        content["coefficients"] = {"load": weight, "mu": mu, "a": a, "b": b}
        words += (
            f"coefficients under {given.load}: mu = {mu:.4g} at this speed, a = "
            f"{a:.4g}, b = {b:.4g}, a - b = {a - b:.3g}\n"
        )
    if given.holds is not None:
        times = [
            _read("--holds", one.strip(), rig, "s", "10 s")
            for one in given.holds.split(",")
        ]
        run = slide_hold_slide(rig, velocity=scaled.velocity, holds=times)
        healed = healing(run, float(scaled.b))
        content["holds"] = healed.to_dict()
        words += f"\n{healed}\n"
        if given.plot is not None:
            from stickslip import plot

            plot.save(plot.peaks_after_holds(run, healed.by_rate_and_state), given.plot)
    return content, words


def _check(path: Path, rig: Rig, given: Options) -> None:
    """Raise `InputError` for options whose other required options are missing."""
    for option, needed in {
        "plot": "holds",
        "area": "export",
        "output": "export",
        "export": "load",
    }.items():
        if (value := getattr(given, option)) and not getattr(given, needed):
            raise InputError(f"--{option} {value}: needs --{needed}")
    if given.holds and given.export:
        raise InputError("--holds: excludes --export; give one after the other")
    if given.load and not rig.scales:
        raise InputError(
            f"--load {given.load}: {path} is in natural units; a load needs a rig file "
            "in SI units"
        )


def _read(option: str, text: str, rig: Rig, unit: str, example: str) -> float:
    """Return the value of an option, with its unit; for a rig in natural units, of a
    plain number.
    """
    natural = rig.scales is None
    if natural:
        unit = "1"
        example, *_ = example.split()
    return read_value(option, text, unit, example, bare=natural)


def _fitted(path: Path, given: Options, report: Progress) -> StepFit | RecordFit:
    """Return the fit of all steps of a trace, or of one, in the units of the trace."""
    trace = read_trace(path, force=given.force, displacement=given.displacement)
    along, clock, force = (
        units_of(trace.get(name))
        for name in ("measured_displacement", "time", "spring_force")
    )
    along = along or units_of(trace.get("measured_velocity"))
    length = along.partition("/")[0] or "m"
    how: dict[str, Any] = {"law": given.law, "trend": given.trend}
    if given.span is not None:
        how["span"] = tuple(
            read_value("--span", end, length, "5 um, 120 um")
            for end in given.span.split(",")
        )
    if given.stiffness is not None:
        unit = f"{1 if 'mu' in trace else force}/{length}"
        how["stiffness"] = read_value(
            "--stiffness", given.stiffness, unit, f"0.006 {unit}"
        )
    if given.step_at is None:
        if given.from_ or given.to:
            raise InputError("--from, --to: need --step-at, the time of the step")
        return fit_record(trace, progress=report, **how)
    how["at"] = read_value(
        "--step-at", given.step_at, clock, "68.7 s", bare=True, above=None
    )
    for name, option, text in (
        ("before", "--from", given.from_),
        ("after", "--to", given.to),
    ):
        if text is not None:
            how[name] = read_value(option, text, f"{length}/{clock}", "3 um/s")
    fit = fit_rate_and_state(trace, **how)
    return replace(fit, step=replace(fit.step, length_unit=length))
