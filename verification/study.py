"""A study: a question, and a function that returns claims to answer it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from stickslip import (
    Contacts,
    FromSliding,
    Interface,
    MasterEquation,
    Output,
    Slider,
    constant,
    simulate,
)
from stickslip.model import Rig
from stickslip.paper import Claim, Measured
from verification.sources import COMPUTING


@dataclass(frozen=True, kw_only=True)
class Study:
    """A part of the programme.

    Attributes
    ----------
    name : str
        How the command line calls it.
    group : str
        The chapter of the report.
    title : str
    run : callable
        Measures, and returns the findings.
    rooms : tuple of str
        Sources that it is about: it is stale once they have changed.
    """

    name: str
    group: str
    title: str
    run: Callable[[], tuple[Claim, ...]]
    rooms: tuple[str, ...] = COMPUTING


def finding(statement: str, *measured: Measured, evidence: str) -> Claim:
    """Return a statement of ours, which holds if every number lies in its band."""
    return Claim(None, statement, measured, evidence=evidence)


def held_friction(
    interface: Interface,
    velocity: float,
    method: Contacts | MasterEquation,
    *,
    distance: float,
    after: float,
    output: Output = Output(),
) -> float:
    """Return the mean force of steady sliding in a run over a distance, after
    the displacement `after`.

    A stiff, heavily damped spring makes the slider follow the drive: the force is that
    of steady sliding.
    """
    slider = Slider(stiffness=200.0, mass=1e-2, damping=100.0)
    run = simulate(
        Rig(interface, slider, constant(velocity, distance / velocity)),
        method=method,
        start=FromSliding(),
        output=output,
    )
    drag = slider.mass * slider.damping * velocity
    return (
        float(run["spring_force"].sel(time=slice(after / velocity, None)).mean()) - drag
    )
