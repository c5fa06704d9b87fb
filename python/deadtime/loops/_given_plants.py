"""Plants given as transfer functions or systems, of this package or of another one.

A rational transfer function with one delay in series becomes a `RationalPlant`, and the delay is
that of the loop. Anything else with delays becomes a `PlantWithDelays`.
"""

from __future__ import annotations

from dataclasses import dataclass

from deadtime._base.validation import non_zero
from deadtime.loops._plants import NO_GAIN, Plant, PlantForm, RationalPlant
from deadtime.roots import QuasiPolynomial
from deadtime.systems import DelaySystem, TransferFunction, polynomials_of


@dataclass(frozen=True)
class PlantWithDelays(Plant):
    """gain * transfer(s), a plant with delays that are not one delay in series.

    `ControlLoop` makes it from a transfer function or system with such delays. Its loop is
    continuous and has no limit: poles, margins, stable ranges, maps, crossings and exact simulation
    are there; what needs a state space of the plant is refused.

    Parameters
    ----------
    transfer : TransferFunction
        Proper and causal.
    gain : float
        Factor on the whole, not zero: the number that a map varies.

    Raises
    ------
    ValueError
        If the transfer function is not proper or not causal, or `gain` is zero.

    Examples
    --------
    A plant with a delayed state, and a delay in the loop:

    >>> import deadtime as dtm
    >>> G = 1.0 / (dtm.s + 0.5 * dtm.delay(1.0))
    >>> loop = dtm.ControlLoop(G, dtm.P(0.5), delay=0.2)
    >>> loop.characteristic()
    s + 0.5 exp(-0.2 s) + 0.5 exp(-1 s)
    >>> loop.is_stable()
    True
    """

    transfer: TransferFunction
    gain: float = 1.0

    def __post_init__(self) -> None:
        num, den = self.transfer.num, self.transfer.den
        if not self.transfer.is_proper:
            raise ValueError(
                f"plant={self.transfer!r}: the numerator has degree {num.degree}, and the "
                f"denominator only {den.degree}. A plant cannot differentiate its command, so "
                "give a denominator of at least the degree of the numerator"
            )
        if not self.transfer.is_causal:
            raise ValueError(
                f"plant={self.transfer!r}: its output would depend on later commands. Give a "
                "causal plant"
            )
        object.__setattr__(self, "gain", non_zero("gain", self.gain, NO_GAIN))

    @property
    def is_rational(self) -> bool:
        """False: it has delays inside."""
        return False

    @property
    def parameters(self) -> dict[str, float]:
        """``gain``."""
        return {"gain": self.gain}

    def transfer_function(self) -> TransferFunction:
        """Return the plant as a transfer function.

        Returns
        -------
        TransferFunction
        """
        return self.gain * self.transfer

    @property
    def _form(self) -> PlantForm:
        num, den = self.transfer.num, self.transfer.den
        return PlantForm(("gain",), delayed=(num._native, den._native))


def plant_and_delay(given: object) -> tuple[Plant, float]:
    """Return a plant, and the delay in s that was in series with it."""
    G = transfer_function_of(given)
    if G is None:
        raise TypeError(
            f"plant={given!r}: give a plant such as Integrator(), a TransferFunction, a "
            "DelaySystem, or a system of python-control or scipy.signal"
        )
    if len(G.num.delays) > 1 or len(G.den.delays) > 1:
        return PlantWithDelays(G), 0.0
    late = float(G.num.delays[0] - G.den.delays[0])
    if late < 0.0:
        raise ValueError(
            f"plant={G!r}: its output would come {-late:g} s before its command. Give a causal "
            "plant"
        )
    num, den = (h.coefficients[0, ::-1].tolist() for h in (G.num, G.den))
    return RationalPlant(num, den), late


def transfer_function_of(given: object) -> TransferFunction | None:
    """Return a system with one input and one output as a transfer function; None for others."""
    if isinstance(given, TransferFunction):
        return given
    if isinstance(given, Plant):
        return given.transfer_function()
    if isinstance(given, QuasiPolynomial):
        return TransferFunction(given)
    if isinstance(given, DelaySystem):
        if (given.n_inputs, given.n_outputs) != (1, 1):
            raise ValueError(
                f"{given!r} cannot be the plant: give a system with one input and one output, "
                "or one of its transfer functions, such as system.transfer_function(output, "
                "input)"
            )
        return given.transfer_function()
    found = polynomials_of(given)
    return None if found is None else TransferFunction(*found)
