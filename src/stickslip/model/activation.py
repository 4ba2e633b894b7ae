"""Thermal activation: contacts that break before their threshold, at a rate set by the
remaining barrier.

A contact of threshold ``x_c`` stretched by ``x`` breaks at the rate
``attempts * exp(-barrier(x, x_c)/kT)``, and at once where ``|x| = x_c``. Each contact
keeps its threshold for its whole life.
"""

from dataclasses import dataclass
from typing import Annotated

from stickslip.errors import InputError
from stickslip.model.records import Number, Record, registry

Attempts = Annotated[float, Number("1/time", above=0, hint="attempt rate")]

ACTIVATIONS, register = registry("activation")
"""The kinds of thermal activation that rig files can name; ``@register("bell")``
gives a class its name there.
"""


class ActivationModel(Record):
    """Thermal activation of contacts: `Bell`, `Parabolic`, `Barrier`, or a model of the
    user's own.

    A user's model derives from this class and is registered under the name that rig
    files use. Solvers know only the three models above: its `form` returns one of them,
    and an `Interface` stores that form in place of the model.
    """

    def form(self) -> "Activation":
        """Return the `Bell`, `Parabolic` or `Barrier` that has this barrier and attempt
        rate.
        """
        raise InputError(
            f"Interface.activation = {self}: needs a method form() that returns a "
            "Bell or a Barrier"
        )


@register("bell")
@dataclass(frozen=True, kw_only=True)
class Bell(ActivationModel):
    """Thermal activation after Bell and Eyring: the barrier falls linearly,
    ``(x_c - x)/width`` in units of ``kT``.

    Parameters
    ----------
    width : float
        Activation width ``A``, in ``x_s``: ``kT`` over the activation length times the
        contact's stiffness times ``x_s``. It is proportional to the temperature.
    attempts : float
        Attempt rate at the threshold, where no barrier is left, in 1/time.
    """

    width: Annotated[float, Number("x_s", above=0, hint="the activation width A")]
    attempts: Attempts


@register("parabolic")
@dataclass(frozen=True, kw_only=True)
class Parabolic(ActivationModel):
    """Thermal activation over the elastic energy still missing at the threshold:
    barrier ``(x_c**2 - x**2)/(2 temperature)``, in units of ``kT``.

    Parameters
    ----------
    temperature : float
        ``kT/(k x_s**2)``.
    attempts : float
        Attempt rate at the threshold, where no barrier is left, in 1/time.
    """

    temperature: Annotated[float, Number(above=0, hint="kT/(k x_s^2)")]
    attempts: Attempts


@register("barrier")
@dataclass(frozen=True, kw_only=True)
class Barrier(ActivationModel):
    """Thermal activation over a barrier of given height:
    ``height * (1 - x/x_c)**power`` in units of ``kT``.

    Parameters
    ----------
    height : float
        Height of the barrier of an unstretched contact, in units of ``kT``.
    power : float
        1, 3/2 (a smooth potential near its limit) or 2.
    attempts : float
        Attempt rate at the threshold, where no barrier is left, in 1/time.
    kramers : bool
        Whether the rate carries Kramers' prefactor ``(1 - x/x_c)**(power - 1)``.
    """

    height: Annotated[float, Number(above=0, hint="barrier over kT")]
    attempts: Attempts
    power: Annotated[float, Number(at_least=1, at_most=2)] = 1.5
    kramers: bool = False


Activation = Bell | Parabolic | Barrier
