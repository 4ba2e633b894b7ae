"""``stickslip rsf``: whether a rig is rate-and-state-like, and fits of measured steps."""

from __future__ import annotations

import json as jsonlib
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from stickslip.errors import InputError, shown
from stickslip.rate_state.exports import Program

if TYPE_CHECKING:
    from stickslip.model.rig import Rig
    from stickslip.rate_state.holds import Healing
    from stickslip.rate_state.measured import StepFit
    from stickslip.rate_state.verdict import RateAndStateFit


def rsf(
    data: Path,
    *,
    velocity: Annotated[
        str | None, Parameter(help="Of smooth sliding before the step; the rig's own by default.")
    ] = None,
    step: Annotated[str, Parameter(help="Ratio of the velocities.")] = "10",
    law: Annotated[Literal["best", "ageing", "slip"], Parameter(help="Which law to fit.")] = "best",
    holds: Annotated[
        str | None, Parameter(help="Also slide, hold and slide, with these times of rest: '1 s, 10 s, 100 s'.")
    ] = None,
    export: Annotated[Program | None, Parameter(help="Print, or write, the input of another program.")] = None,
    load: Annotated[
        str | None, Parameter(help="Normal load, for coefficients of friction and for the export: '2 kN'.")
    ] = None,
    area: Annotated[str | None, Parameter(help="Area of the surface, for the export: '1 cm^2'.")] = None,
    output: Annotated[Path | None, Parameter(alias="-o", help="Write the export to a file.")] = None,
    step_at: Annotated[str | None, Parameter(help="Of a trace: about when the step came, '68.7 s'.")] = None,
    from_: Annotated[
        str | None, Parameter(name="--from", help="Of a trace: velocity before the step, '3 um/s'.")
    ] = None,
    to: Annotated[str | None, Parameter(help="Of a trace: velocity after the step.")] = None,
    span: Annotated[
        str | None, Parameter(help="Of a trace: displacement before and after the step, '5 um, 120 um'.")
    ] = None,
    trend: Annotated[bool, Parameter(help="Of a trace: fit a linear trend in displacement besides.")] = True,
    stiffness: Annotated[
        str | None, Parameter(help="Of a trace: between load point and surface, '0.006 1/um'; fitted by default.")
    ] = None,
    json: Annotated[bool, Parameter(help="Print JSON for a machine to read.", negative="")] = False,
    plot: Annotated[
        Path | None, Parameter(help="Draw the fit of a trace, or the peaks after holds: .png, .svg, .pdf.")
    ] = None,
) -> None:
    """Say whether a rig is rate-and-state-like, or fit rate and state to a measured velocity step.

    What is not rate-and-state-like ends with exit code 2 and the number that fails.

    Parameters
    ----------
    data
        A rig file in TOML, the name of an example, or a measured trace.
    """
    from stickslip.io import rig_files

    if step_at is None and (data.suffix == ".toml" or (not data.exists() and data.name in rig_files.example_names())):
        fit, rig = _of_rig(data, velocity, step, law)
        if not fit.holds:
            raise InputError(f"{data}: not rate-and-state: {fit.reason}")
        if plot is not None and holds is None:
            raise InputError(f"--plot {plot}: draws the fit of a trace, or the peaks after holds; give --holds")
        if export is None:
            for option, given in (("--area", area), ("--output", output)):
                if given is not None:
                    raise InputError(f"{option} {given}: is for --export; ask for one of the programs")
            told, words = _in_the_units_of(rig, fit, load)
            if holds is not None:
                healed = _after_holds(rig, fit, holds, plot)
                told, words = {**told, "holds": healed.to_dict()}, f"{words}\n\n{healed}"
            print(jsonlib.dumps(told, indent=2) if json else words)
            return
        if holds is not None:
            raise InputError("--holds: not together with --export; ask for one after the other")
        if load is None:
            raise InputError("--load: is missing; give the normal load, '2 kN'")
        if rig.scales is None:
            raise InputError(f"{data}: is in natural units; an export needs a rig file in SI units")
        from stickslip.rate_state.exports import export_rate_and_state

        text = export_rate_and_state(fit, export, scales=rig.scales, load=load, area=area, path=output)
        print(f"{export}: {output}" if output is not None else text, end="\n" if output is not None else "")
        return
    if holds is not None:
        raise InputError("--holds: is for a rig; a measured trace has its own")
    if step_at is None or from_ is None or to is None:
        raise InputError(f"{data}: of a measured trace say --step-at '68.7 s' --from '3 um/s' --to '10 um/s'")
    found = _of_trace(data, step_at, from_, to, law, plot, span, stiffness, trend=trend)
    print(jsonlib.dumps(found.to_dict(), indent=2) if json else found)


def _of_rig(
    path: Path, velocity: str | None, step: str, law: Literal["best", "ageing", "slip"]
) -> tuple[RateAndStateFit, Rig]:
    from stickslip.io.rig_files import read_rig
    from stickslip.model.quantities import read_number, read_quantity
    from stickslip.rate_state.verdict import rate_and_state

    rig = read_rig(path)
    speed = rig.natural.velocity
    if velocity is not None:
        speed = _told("--velocity", velocity, lambda text: read_quantity(text, "m/s", "1 um/s")) / rig.unit("x_s/time")
    ratio = _told("--step", step, read_number)
    return rate_and_state(rig.natural.interface, speed, step=ratio, law=law), rig


def _in_the_units_of(rig: Rig, fit: RateAndStateFit, load: str | None) -> tuple[dict[str, Any], str]:
    """Return a fit for a machine and for a person, with coefficients of friction where a load is given."""
    from stickslip.rate_state.exports import positive

    scaled = fit.in_units(rig)
    if load is None:
        return scaled.to_dict(), str(scaled)
    if rig.scales is None:
        raise InputError(f"--load {load}: is for a rig file in SI units; this one is in natural units")
    weight = positive("--load", load, "N", "2 kN")
    mu, a, b = (value / weight for value in (scaled.kinetic_friction, scaled.a, scaled.b))
    words = f"coefficients under {load}: mu = {mu:.4g} at this speed, a = {a:.4g}, b = {b:.4g}, a - b = {a - b:.3g}"
    return {**scaled.to_dict(), "coefficients": {"load": weight, "mu": mu, "a": a, "b": b}}, f"{scaled}\n{words}"


def _after_holds(rig: Rig, fit: RateAndStateFit, holds: str, plot: Path | None) -> Healing:
    """Slide, hold and slide the rigidly driven slider of a rig, at the velocity of a fit."""
    from stickslip.model.quantities import read_number, read_quantity
    from stickslip.rate_state.holds import healing
    from stickslip.simulation.steps_and_holds import slide_hold_slide

    def read(text: str) -> float:
        return read_number(text) if rig.scales is None else read_quantity(text, "s", "10 s")

    times = [_told("--holds", one.strip(), read) for one in holds.split(",")]
    run = slide_hold_slide(rig, velocity=fit.velocity * rig.unit("x_s/time"), holds=times)
    healed = healing(run, fit.b * rig.unit("f_s"))
    if plot is not None:
        from stickslip import plot as drawing

        drawing.save(drawing.peaks_after_holds(run, healed.by_rate_and_state), plot)
    return healed


def _of_trace(
    path: Path,
    at: str,
    before: str,
    after: str,
    law: Literal["best", "ageing", "slip"],
    plot: Path | None,
    span: str | None,
    stiffness: str | None,
    *,
    trend: bool,
) -> StepFit:
    from stickslip.measure import read_trace
    from stickslip.model.quantities import read_quantity
    from stickslip.rate_state.measured import fit_rate_and_state, velocity_step_in

    trace = read_trace(path)
    clock = str(trace["time"].attrs.get("units", "s"))
    length = str(trace["measured_displacement"].attrs["units"]) if "measured_displacement" in trace else "m"

    def read(option: str, text: str, unit: str, example: str, *, bare: bool = False) -> float:
        return _told(option, text, lambda given: read_quantity(given, unit, example, bare=bare))

    ends = None
    if span is not None:
        parts = span.split(",")
        if len(parts) != 2:
            raise InputError(f"--span {shown(span)}: must be two displacements, as in '5 um, 120 um'")
        ends = (read("--span", parts[0], length, "5 um"), read("--span", parts[1], length, "120 um"))
    cut = velocity_step_in(
        trace,
        at=read("--step-at", at, clock, "68.7 s", bare=True),
        before=read("--from", before, f"{length}/{clock}", "3 um/s"),
        after=read("--to", after, f"{length}/{clock}", "10 um/s"),
        span=ends,
    )
    cut = replace(cut, length_unit=length)
    spring = None
    if stiffness is not None:
        spring = read(
            "--stiffness", stiffness, f"{cut.friction_unit or 1}/{length}", f"0.006 {cut.friction_unit or 1}/um"
        )
    fit = fit_rate_and_state(cut, law=law, stiffness=spring, trend=trend)
    if plot is not None:
        from stickslip import plot as drawing

        drawing.save(drawing.velocity_step(cut, [fit], length=length), plot)
    return fit


def _told(option: str, text: str, read: Any) -> float:
    try:
        return float(read(text))
    except InputError as error:
        raise InputError(f"{option} {shown(text)}: {error}") from None
