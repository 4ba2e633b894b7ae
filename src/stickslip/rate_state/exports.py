"""Export of rate-and-state parameters of an interface to other programs: QDYN, tandem,
DiaBayes, rsfmodel.
"""

import math
from importlib import resources
from string import Template
from typing import Literal, get_args

from stickslip.errors import InputError, instance, refused
from stickslip.io import files
from stickslip.io.files import FileName
from stickslip.model.quantities import read_value
from stickslip.model.units import Scales, engineering
from stickslip.rate_state.equivalent_law import RateAndStateFit

Program = Literal["qdyn", "tandem", "diabayes", "rsfmodel"]


def export_rate_and_state(
    fit: RateAndStateFit,
    program: Program,
    *,
    scales: Scales,
    load: str | float,
    area: str | float | None = None,
    path: FileName | None = None,
) -> str:
    """Write the rate-and-state parameters of an interface as the input of another
    program.

    Forces become coefficients of friction: forces per contact, times ``N f_s``, over
    the normal load. The file starts with how the parameters were fitted, and with their
    error: the critical stiffness beside the exact one.

    Parameters
    ----------
    fit : RateAndStateFit
        Result of `rate_and_state`.
    program : {"qdyn", "tandem", "diabayes", "rsfmodel"}
    scales : Scales
        Values of ``N f_s``, ``x_s`` and the unit of time.
    load : str or float
        Normal load, ``"2 kN"`` or in N.
    area : str or float, optional
        Area of the surface, ``"1 cm^2"`` or in m^2, for the normal stress that QDYN and
        tandem need.
    path : path, optional
        File to write; the text is returned as well.

    Raises
    ------
    InputError
        If the interface is not rate-and-state-like, the program does not have the law,
        or a quantity is missing.
    """
    instance("fit", fit, RateAndStateFit, "the result of rate_and_state()")
    instance("scales", scales, Scales, "Scales(force=..., stretching=..., time=...)")
    if program not in get_args(Program):
        known = ", ".join(get_args(Program))
        raise refused("program", program, f"must be one of {known}")
    if not fit.holds:
        raise InputError(
            f"fit: is not rate-and-state ({fit.reason}); there are no parameters to "
            "export"
        )
    if fit.law == "slip" and program in ("tandem", "diabayes"):
        raise InputError(
            f"program = {program!r}: has only the ageing law, and the interface "
            "follows the slip law; use 'qdyn' or "
            "'rsfmodel', or fit law='ageing'"
        )
    weight = read_value("load", load, "N", "2 kN")
    stress = (
        weight / read_value("area", area, "m^2", "1 cm^2")
        if area is not None
        else math.nan
    )
    if math.isnan(stress) and program in ("qdyn", "tandem"):
        raise InputError(
            f"area: is missing; {program} needs the normal stress, the load over an "
            "area such as '1 cm^2'"
        )
    si = fit.in_units(scales)
    speed = engineering(si.velocity, "m/s")
    faster = engineering(si.velocity * si.step, "m/s")
    notes = (
        (
            f"Rate-and-state parameters of an interface of contacts, for {program}, "
            "written by stickslip."
        ),
        f"Fit of the {si.law} law to a step from {speed} to {faster} over six breaking "
        "displacements; forces are those "
        "of all contacts.",
        *str(si).splitlines(),
    )
    template = resources.files(__package__) / "templates" / f"{program}.txt"
    mark = "--" if program == "tandem" else "#"
    # the contacts are the spring between load point and surface
    spring = si.contact_stiffness / weight
    text = "".join(f"{mark} {line}\n" for line in notes) + Template(
        template.read_text(encoding="utf-8")
    ).substitute(
        a=float(si.a) / weight,
        b=float(si.b) / weight,
        mu=si.kinetic_friction / weight,
        distance=float(si.distance),
        distance_in_um=float(si.distance) * 1e6,
        velocity=si.velocity,
        velocity_in_um=si.velocity * 1e6,
        state=si.distance / si.velocity,
        spring=spring,
        spring_per_um=spring * 1e-6,
        stress=stress,
        stress_in_mpa=stress / 1e6,
        theta_law=1 if si.law == "ageing" else 2,
        relation="DieterichState" if si.law == "ageing" else "RuinaState",
    )
    if path is not None:
        files.write(path, text.encode())
    return text
