r"""Controllers: what turns the reference r and the measured output y into the command u.

Each is linear in its gains: u = R(s) r - F(s) y. The derivative is either ideal, H(s) = s, or
filtered, H(s) = \ :math:`\omega^2 s / (s^2 + 2 \zeta \omega s + \omega^2)`. In a sampled
loop filter and integrator stay continuous and are sampled with the rest: this is exact.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import cache
from typing import Any, NamedTuple

from deadtime._base.validation import finite
from deadtime.loops._derivative_filter import DerivativeFilter, Discretisation
from deadtime.loops._given_plants import transfer_function_of
from deadtime.loops._native import feedback_polynomials
from deadtime.systems import TransferFunction


class ControllerForm(NamedTuple):
    """The form of a controller as the kernel takes it."""

    kind: str
    is_filtered: bool = False
    #: How its filter runs in a sampled loop; None: continuous.
    rule: Discretisation | None = None


@dataclass(frozen=True)
class Controller:
    """Base of all controllers: gains, and a filter where there is a derivative."""

    # NumPy and packages built on it leave `G * controller` to this class.
    __array_ufunc__ = None

    def __post_init__(self) -> None:
        is_open = True
        for name in self._gains():
            value = finite(name, getattr(self, name))
            object.__setattr__(self, name, value)
            is_open = is_open and value == 0.0
        if is_open:
            gains = ", ".join(f"{name}=0" for name in self._gains())
            raise ValueError(f"{gains}: the loop is open, give a gain other than zero")
        smooth = self._filter
        if smooth is not None and not isinstance(smooth, DerivativeFilter):
            raise TypeError(f"filter={smooth!r}: give a DerivativeFilter or None")

    @classmethod
    @cache
    def _gains(cls) -> tuple[str, ...]:
        """Names of the gains."""
        return tuple(field.name for field in fields(cls) if field.name != "filter")

    @property
    def gains(self) -> dict[str, float]:
        """The gains by name."""
        return {name: getattr(self, name) for name in self._gains()}

    @property
    def _filter(self) -> DerivativeFilter | None:
        return getattr(self, "filter", None)

    @property
    def parameters(self) -> dict[str, float]:
        """The gains, and ``omega`` and ``damping`` of the filter where there is one."""
        numbers, smooth = self.gains, self._filter
        if smooth is not None:
            numbers |= {"omega": smooth.omega, "damping": smooth.damping}
        return numbers

    def transfer_function(self) -> TransferFunction:
        """Return the feedback F(s) of u = R(s) r - F(s) y.

        Returns
        -------
        TransferFunction

        Examples
        --------
        >>> import deadtime as dtm
        >>> dtm.PI(Kp=2.0, Ki=0.5).transfer_function()
        (0.5 + 2 s) / s

        A product with a plant is the loop gain:

        >>> 0.9 / dtm.s * dtm.delay(0.36) * dtm.PV(Kp=2.0, Kv=0.3)
        (1.8 + 0.27 s) exp(-0.36 s) / s
        """
        return TransferFunction(*feedback_polynomials(self._form, [*self.parameters.values()]))

    def __mul__(self, other: object) -> TransferFunction:
        """Loop gain of this feedback and a plant, a transfer function or a system."""
        G = transfer_function_of(other)
        return NotImplemented if G is None else G * self.transfer_function()

    __rmul__ = __mul__

    def _replace(self, numbers: Mapping[str, float]) -> Controller:
        """Return the same controller with other numbers."""
        changed: dict[str, Any] = {n: numbers.get(n, getattr(self, n)) for n in self._gains()}
        if self._filter is not None:
            changed["filter"] = DerivativeFilter(
                omega=numbers.get("omega", self._filter.omega),
                damping=numbers.get("damping", self._filter.damping),
                discretisation=self._filter.discretisation,
            )
        return type(self)(**changed)

    @property
    def _form(self) -> ControllerForm:
        """What it is without its numbers."""
        kind, smooth = type(self).__name__, self._filter
        if smooth is None:
            return ControllerForm(kind)
        return ControllerForm(kind, True, smooth.discretisation)


@dataclass(frozen=True)
class P(Controller):
    """Proportional controller, u = Kp (r - y).

    Parameters
    ----------
    Kp : float
        Gain, not zero.

    Raises
    ------
    ValueError
        If a gain is not finite, or all of them are zero.

    Examples
    --------
    >>> import deadtime as dtm
    >>> dtm.ControlLoop(dtm.Integrator(), dtm.P(Kp=2.0), delay=0.36).characteristic()
    s + 2 exp(-0.36 s)
    """

    Kp: float


@dataclass(frozen=True)
class PV(Controller):
    """Proportional and velocity controller, u = Kp (r - y) - Kv H y.

    The derivative is that of the measurement alone, so steps of the reference do not kick.

    Parameters
    ----------
    Kp, Kv : float
        Gains, not both zero.
    filter : DerivativeFilter, optional
        H(s); without it the derivative is ideal and the loop is neutral where the plant's
        relative degree is one.

    Raises
    ------
    ValueError
        If a gain is not finite, or all of them are zero.

    Examples
    --------
    >>> import deadtime as dtm
    >>> dtm.ControlLoop(dtm.Integrator(), dtm.PV(Kp=2.0, Kv=0.3), delay=0.36).characteristic()
    s + (2 + 0.3 s) exp(-0.36 s)
    """

    Kp: float
    Kv: float
    filter: DerivativeFilter | None = None


@dataclass(frozen=True)
class PD(Controller):
    """Proportional and derivative controller, u = Kp e + Kd H e with e = r - y.

    Parameters
    ----------
    Kp, Kd : float
        Gains, not both zero.
    filter : DerivativeFilter, optional
        H(s); without it the derivative is ideal, and a step of the reference is an impulse of the
        command, which a limited or sampled loop does not see.

    Raises
    ------
    ValueError
        If a gain is not finite, or all of them are zero.

    Examples
    --------
    >>> import deadtime as dtm
    >>> loop = dtm.ControlLoop(dtm.Integrator(), dtm.PD(Kp=2.0, Kd=0.3), delay=0.36)
    >>> loop.parameters
    {'gain': 1.0, 'lag': 0.0, 'Kp': 2.0, 'Kd': 0.3, 'delay': 0.36}
    """

    Kp: float
    Kd: float
    filter: DerivativeFilter | None = None


@dataclass(frozen=True)
class PI(Controller):
    """Proportional and integral controller, u = Kp e + Ki ∫ e dt with e = r - y.

    Parameters
    ----------
    Kp, Ki : float
        Gains, not both zero. The integral does not stop while the command is limited.

    Raises
    ------
    ValueError
        If a gain is not finite, or all of them are zero.

    Examples
    --------
    >>> import deadtime as dtm
    >>> dtm.ControlLoop(dtm.Integrator(), dtm.PI(Kp=2.0, Ki=0.5), delay=0.36).characteristic()
    s^2 + (0.5 + 2 s) exp(-0.36 s)
    """

    Kp: float
    Ki: float


@dataclass(frozen=True)
class PID(Controller):
    """Proportional, integral and derivative controller, u = Kp e + Ki ∫ e dt + Kd H e, e = r - y.

    Parameters
    ----------
    Kp, Ki, Kd : float
        Gains, not all zero. The integral does not stop while the command is limited.
    filter : DerivativeFilter, optional
        H(s); without it the derivative is ideal, and a step of the reference is an impulse of the
        command, which a limited or sampled loop does not see.

    Raises
    ------
    ValueError
        If a gain is not finite, or all of them are zero.

    Examples
    --------
    >>> import deadtime as dtm
    >>> dtm.PID(Kp=2.0, Ki=0.5, Kd=0.1).gains
    {'Kp': 2.0, 'Ki': 0.5, 'Kd': 0.1}
    """

    Kp: float
    Ki: float
    Kd: float
    filter: DerivativeFilter | None = None
