"""Rate-and-state parameters of an interface as the input of other programs: QDYN, tandem, DiaBayes, rsfmodel."""

from __future__ import annotations

import os
from typing import Literal, get_args

from stickslip.errors import InputError, instance, number, shown
from stickslip.io import files
from stickslip.model.quantities import read_quantity
from stickslip.model.units import Scales, engineering
from stickslip.rate_state.verdict import RateAndStateFit

Program = Literal["qdyn", "tandem", "diabayes", "rsfmodel"]

_AGEING_ONLY: tuple[Program, ...] = ("tandem", "diabayes")
"""Programs that know the ageing law only."""


def export_rate_and_state(
    fit: RateAndStateFit,
    program: Program,
    *,
    scales: Scales,
    load: str | float,
    area: str | float | None = None,
    path: str | os.PathLike[str] | None = None,
) -> str:
    """Write the rate-and-state parameters of an interface as the input of another program.

    Forces become coefficients of friction: those of the contacts, times ``N f_s``, over the normal load. The file
    begins with the protocol of the fit and with what the parameters get wrong: the critical stiffness beside the exact
    one.

    Parameters
    ----------
    fit : RateAndStateFit
        From `rate_and_state`.
    program : {"qdyn", "tandem", "diabayes", "rsfmodel"}
    scales : Scales
        What ``N f_s``, ``x_s`` and the unit of time are.
    load : str or float
        Normal load, ``"2 kN"`` or in N.
    area : str or float, optional
        Of the surface, ``"1 cm^2"`` or in m^2: for the normal stress that QDYN and tandem take.
    path : path, optional
        Where to write it.

    Returns
    -------
    str
        The text of the file.

    Raises
    ------
    InputError
        If the interface is not rate-and-state-like, the program does not know the law, or a quantity is missing.
    """
    instance("fit", fit, RateAndStateFit, "what rate_and_state() gives")
    instance("scales", scales, Scales, "Scales(force=..., stretching=..., time=...)")
    if program not in get_args(Program):
        raise InputError(f"program = {shown(program)}: must be one of {', '.join(get_args(Program))}")
    if not fit.holds:
        raise InputError(f"fit: is not rate-and-state ({fit.reason}); there are no parameters to export")
    if fit.law == "slip" and program in _AGEING_ONLY:
        raise InputError(
            f"program = {program!r}: knows the ageing law only, and the interface follows the slip law; use 'qdyn' or "
            "'rsfmodel', or fit law='ageing'"
        )
    weight = positive("load", load, "N", "2 kN")
    stress = weight / positive("area", area, "m^2", "1 cm^2") if area is not None else None
    if stress is None and program in ("qdyn", "tandem"):
        raise InputError(f"area: is missing; {program} takes the normal stress, the load over an area such as '1 cm^2'")
    per_load = scales.force / weight
    distance, velocity = fit.distance * scales.stretching, fit.velocity * scales.unit("velocity")
    spring = fit.contact_stiffness * per_load / scales.stretching  # between load point and surface: the contacts
    mark = "--" if program == "tandem" else "#"
    text = "".join(f"{mark} {line}\n" for line in _notes(fit, program, scales)) + _TEMPLATES[program].format(
        a=fit.a * per_load,
        b=fit.b * per_load,
        mu=fit.kinetic_friction * per_load,
        distance=distance,
        distance_in_um=distance * 1e6,
        velocity=velocity,
        velocity_in_um=velocity * 1e6,
        state=distance / velocity,
        spring=spring,
        spring_per_um=spring * 1e-6,
        stress=stress,
        stress_in_mpa=(stress or 0.0) / 1e6,
        theta_law=1 if fit.law == "ageing" else 2,
        relation="DieterichState" if fit.law == "ageing" else "RuinaState",
    )
    if path is not None:
        files.write(path, text.encode())
    return text


def positive(name: str, value: str | float, unit: str, example: str) -> float:
    """Read a quantity above 0, in words or in SI units."""
    if isinstance(value, str):
        try:
            value = read_quantity(value, unit, example)
        except InputError as error:
            raise InputError(f"{name} = {shown(value)}: {error}") from None
    return number(name, value, above=0, hint=f"in {unit}")


def _notes(fit: RateAndStateFit, program: str, scales: Scales) -> list[str]:
    def speed(value: float) -> str:
        return engineering(scales.si(value, "velocity"), "m/s")

    step = (
        "a small step" if fit.step is None else f"a step from {speed(fit.velocity)} to {speed(fit.velocity * fit.step)}"
    )
    return [
        f"Rate-and-state parameters of an interface of contacts, for {program}, written by stickslip.",
        f"Fit of the {fit.law} law to {step} over six breaking displacements; forces are those of all contacts.",
        *str(fit.in_scales(scales)).splitlines(),
    ]


_QDYN = """\
set_dict = {{
    "SIGMA": {stress!r},  # Pa
    "V_PL": {velocity!r},  # m/s
    "SET_DICT_RSF": {{
        "RNS_LAW": 0,
        "THETA_LAW": {theta_law},  # 1 ageing, 2 slip
        "A": {a!r},
        "B": {b!r},
        "DC": {distance!r},  # m
        "MU_SS": {mu!r},
        "V_SS": {velocity!r},  # m/s
        "V_0": {velocity!r},
        "TH_0": {state!r},  # s
    }},
}}
"""

_TANDEM = """\
-- A scenario in 2D, antiplane: type = "poisson", scenario = "fault" in the parameter file (TOML), which tandem takes
-- besides, as it does a mesh in km.
-- MPa, GPa, m, m/s. Friction is that of the contacts, the rock around them was not told to stickslip: replace
-- shear_modulus and density by yours (granite stands there, as in SEAS BP1).
local Fault = {{}}
Fault.__index = Fault

Fault.b = {b!r}
Fault.V0 = {velocity!r}
Fault.f0 = {mu!r}
Fault.shear_modulus = 32.04  -- GPa, assumed
Fault.density = 2.67  -- g/cm^3, assumed

function Fault:new(o) return setmetatable(o or {{}}, Fault) end
function Fault:boundary(x, y, t)
    if x > 1.0 then return self.V0 / 2.0 * t elseif x < -1.0 then return -self.V0 / 2.0 * t end
    return self.V0 * t
end
function Fault:mu(x, y) return self.shear_modulus end
function Fault:eta(x, y) return math.sqrt(self:mu(x, y) * self.density) / 2.0 end  -- MPa s/m: radiation damping
function Fault:a(x, y) return {a!r} end
function Fault:L(x, y) return {distance!r} end
function Fault:sn_pre(x, y) return {stress_in_mpa!r} end
function Fault:Vinit(x, y) return self.V0 end
-- Steady sliding at V0; the traction opposes slip, which tandem counts as negative.
function Fault:tau_pre(x, y) return -(self.f0 * self:sn_pre(x, y) + self:eta(x, y) * self.V0) end

fault = Fault:new()
"""

_DIABAYES = """\
from diabayes.typedefs import RSFConstants, RSFParams, SpringBlockConstants

params = RSFParams(a={a!r}, b={b!r}, Dc={distance!r})  # m
constants = RSFConstants(v0={velocity!r}, mu0={mu!r})  # m/s
block_constants = SpringBlockConstants(k={spring!r}, v_lp={velocity!r})  # 1/m, m/s
"""

_RSFMODEL = """\
from rsfmodel import rsf, staterelations

model = rsf.Model()  # um and s
model.mu0 = {mu!r}
model.a = {a!r}
model.k = {spring_per_um!r}  # 1/um
model.v = {velocity_in_um!r}
model.vref = {velocity_in_um!r}
state = staterelations.{relation}()
state.b = {b!r}
state.Dc = {distance_in_um!r}
model.state_relations = [state]
"""

_TEMPLATES = {"qdyn": _QDYN, "tandem": _TANDEM, "diabayes": _DIABAYES, "rsfmodel": _RSFMODEL}
