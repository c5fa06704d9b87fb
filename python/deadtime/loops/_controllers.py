r"""Controllers: what turns the reference r and the measured output y into the command u.

Each is linear in its gains: u = R(s) r - F(s) y. Weights of the reference and a feed-forward make
the two differ, and act on the response to the reference alone. The derivative is either ideal, H(s)
= s, or filtered, H(s) = \ :math:`\omega^2 s / (s^2 + 2 \zeta \omega s + \omega^2)`. In a sampled
loop filter and integrator stay continuous and are sampled with the rest: this is exact.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import cache, wraps
from typing import Any, NamedTuple, TypeVar

from deadtime._base.validation import finite, positive
from deadtime.loops._derivative_filter import DerivativeFilter, Discretisation
from deadtime.loops._given_plants import transfer_function_of
from deadtime.loops._native import feedback_polynomials
from deadtime.systems import TransferFunction

#: Numbers that a controller may have besides its gains and its filter, in the kernel's order.
_EXTRAS = ("weight", "derivative_weight", "feed_forward")

#: Parts of a controller that are no gains.
_OTHERS = frozenset((*_EXTRAS, "filter", "anti_windup"))


C = TypeVar("C", bound="Controller")


class ControllerForm(NamedTuple):
    """The form of a controller as the kernel takes it."""

    kind: str
    is_filtered: bool = False
    #: How its filter runs in a sampled loop; None: continuous.
    rule: Discretisation | None = None
    #: Names of further numbers: weights, feed-forward, tracking time.
    extras: tuple[str, ...] = ()
    #: Whether the integral stops while it would drive the command further out of its bounds.
    stops: bool = False


#: What a gain is of a time that other forms have.
_OF_TIMES = {"Ti": ("Ki", "Ki = Kp/Ti"), "Td": ("Kd", "Kd = Kp Td")}


@dataclass(frozen=True)
class BackCalculation:
    """Anti-windup by back-calculation: the integral follows the command behind its limits.

    The integral of a controller gains (v - u)/tracking_time, v the command after all limits and u
    the one before (Åström and Hägglund, Advanced PID Control, 2006, section 3.5). A time between
    those of derivative and integral action is usual, sqrt(Ti Td); for PI, Ti.

    Parameters
    ----------
    tracking_time : float
        Time constant Tt in s: a short one unwinds fast, and lets short peaks of the command reset
        the integral.

    Raises
    ------
    ValueError
        If it is not positive.

    Examples
    --------
    >>> import deadtime as dtm
    >>> guarded = dtm.PI(Kp=1.0, Ki=0.5, anti_windup=dtm.loops.BackCalculation(tracking_time=2.0))
    >>> loop = dtm.ControlLoop(dtm.Integrator(), guarded, delay=0.1, limit=0.2)
    >>> plain = loop.replace(controller=dtm.PI(Kp=1.0, Ki=0.5))
    >>> round(loop.step_response().info()["overshoot"])
    13
    >>> round(plain.step_response().info()["overshoot"])
    68
    """

    tracking_time: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "tracking_time", positive("tracking_time", self.tracking_time))


@dataclass(frozen=True)
class ConditionalIntegration:
    """Anti-windup by conditional integration: the integral stops while it would make it worse.

    It stops while the command is beyond a limit and the control error would drive it further. In
    continuous time the command may stay at the limit; the integral then follows from that.

    Examples
    --------
    >>> import deadtime as dtm
    >>> guarded = dtm.PI(Kp=1.0, Ki=0.5, anti_windup=dtm.loops.ConditionalIntegration())
    >>> loop = dtm.ControlLoop(dtm.Integrator(), guarded, delay=0.1, limit=0.2)
    >>> round(loop.step_response().info()["overshoot"])
    4
    """


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
            raise ValueError(
                f"{gains}: a loop whose gains are all zero is open. Give a gain other than zero"
            )
        smooth = self._filter
        if smooth is not None and not isinstance(smooth, DerivativeFilter):
            raise TypeError(f"filter={smooth!r}: give a DerivativeFilter or None")
        for name in _EXTRAS:
            given = getattr(self, name, None)
            if given is not None:
                object.__setattr__(self, name, finite(name, given))
        guard = getattr(self, "anti_windup", None)
        if isinstance(guard, (int, float)):
            guard = BackCalculation(guard)
            object.__setattr__(self, "anti_windup", guard)
        if not isinstance(guard, (BackCalculation, ConditionalIntegration, type(None))):
            raise TypeError(
                f"anti_windup={guard!r}: give a BackCalculation, a ConditionalIntegration or None"
            )

    def __repr__(self) -> str:
        given = {part.name: getattr(self, part.name) for part in fields(self)}
        shown = [
            f"{name}={value!r}"
            for name, value in given.items()
            if value is not None or name == "filter" or name not in _OTHERS
        ]
        return f"{type(self).__name__}({', '.join(shown)})"

    @classmethod
    @cache
    def _gains(cls) -> tuple[str, ...]:
        """Names of the gains."""
        return tuple(field.name for field in fields(cls) if field.name not in _OTHERS)

    @property
    def gains(self) -> dict[str, float]:
        """The gains by name."""
        return {name: getattr(self, name) for name in self._gains()}

    @property
    def _filter(self) -> DerivativeFilter | None:
        return getattr(self, "filter", None)

    @property
    def parameters(self) -> dict[str, float]:
        """The named numbers: the gains, and those of the other parts that there are.

        A filter has ``omega`` and ``damping``. ``weight``, ``derivative_weight`` and
        ``feed_forward`` are there where they are given, ``tracking_time`` with back-calculation.
        """
        numbers, smooth = self.gains, self._filter
        if smooth is not None:
            numbers |= {"omega": smooth.omega, "damping": smooth.damping}
        return numbers | self._extras

    @property
    def _extras(self) -> dict[str, float]:
        """Weights, feed-forward and tracking time, where they are given, in the kernel's order."""
        given = {name: getattr(self, name, None) for name in _EXTRAS}
        numbers = {name: value for name, value in given.items() if value is not None}
        guard = getattr(self, "anti_windup", None)
        if isinstance(guard, BackCalculation):
            numbers["tracking_time"] = guard.tracking_time
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

    @property
    def _is_guarded(self) -> bool:
        """Whether it has parts that its gains and its filter do not show."""
        return bool(self._extras) or getattr(self, "anti_windup", None) is not None

    def _replace(self, numbers: Mapping[str, float]) -> Controller:
        """Return the same controller with other numbers."""
        changed: dict[str, Any] = {n: numbers.get(n, getattr(self, n)) for n in self._gains()}
        if self._filter is not None:
            changed["filter"] = DerivativeFilter(
                omega=numbers.get("omega", self._filter.omega),
                damping=numbers.get("damping", self._filter.damping),
                discretisation=self._filter.discretisation,
            )
        extras = self._extras
        changed |= {name: numbers.get(name, extras[name]) for name in _EXTRAS if name in extras}
        guard = getattr(self, "anti_windup", None)
        if isinstance(guard, BackCalculation):
            guard = BackCalculation(numbers.get("tracking_time", guard.tracking_time))
        if guard is not None:
            changed["anti_windup"] = guard
        return type(self)(**changed)

    @property
    def _form(self) -> ControllerForm:
        """What it is without its numbers."""
        kind, smooth = type(self).__name__, self._filter
        stops = isinstance(getattr(self, "anti_windup", None), ConditionalIntegration)
        rule = None if smooth is None else smooth.discretisation
        return ControllerForm(kind, smooth is not None, rule, tuple(self._extras), stops)


def _explains_names(kind: type[C]) -> type[C]:
    """The kind of controller, which says what it takes where it is given another name."""
    make = kind.__init__
    names = [part.name for part in fields(kind)]
    takes = f"it takes {', '.join(names)}"

    @wraps(make)
    def checked(self: C, *values: Any, **given: Any) -> None:
        for name in given:
            if name not in names:
                gain, words = _OF_TIMES.get(name, ("", ""))
                hint = f"; {words}" if gain in names else ""
                raise TypeError(f"{kind.__name__} has no {name!r}: {takes}{hint}")
        make(self, *values, **given)

    setattr(kind, "__init__", checked)  # noqa: B010
    return kind


@_explains_names
@dataclass(frozen=True, repr=False)
class P(Controller):
    """Proportional controller, u = Kp (r - y).

    Parameters
    ----------
    Kp : float
        Gain, not zero.
    feed_forward : float, optional
        Gain of the reference past the controller, added to the command.

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
    feed_forward: float | None = None


@_explains_names
@dataclass(frozen=True, repr=False)
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
    feed_forward : float, optional
        Gain of the reference past the controller, added to the command.

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
    feed_forward: float | None = None


@_explains_names
@dataclass(frozen=True, repr=False)
class PD(Controller):
    """Proportional and derivative controller, u = Kp e + Kd H e with e = r - y.

    Parameters
    ----------
    Kp, Kd : float
        Gains, not both zero.
    filter : DerivativeFilter, optional
        H(s); without it the derivative is ideal, and a step of the reference is an impulse of the
        command, which a limited or sampled loop does not see.
    weight : float, optional
        Weight b of the reference in the proportional term, Kp (b r - y); one without it. Below one,
        a step of the reference overshoots less; responses to loads stay as they are.
    derivative_weight : float, optional
        Weight c of the reference in the derivative, Kd H (c r - y); one without it.
    feed_forward : float, optional
        Gain of the reference past the controller, added to the command.

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
    weight: float | None = None
    derivative_weight: float | None = None
    feed_forward: float | None = None


@_explains_names
@dataclass(frozen=True, repr=False)
class PI(Controller):
    """Proportional and integral controller, u = Kp e + Ki ∫ e dt with e = r - y.

    Parameters
    ----------
    Kp, Ki : float
        Gains, not both zero.
    weight : float, optional
        Weight b of the reference in the proportional term, Kp (b r - y); one without it. Below one,
        a step of the reference overshoots less; responses to loads stay as they are.
    feed_forward : float, optional
        Gain of the reference past the controller, added to the command.
    anti_windup : BackCalculation, ConditionalIntegration or float, optional
        What keeps the integral from winding up while the command is limited; a number is the
        tracking time of back-calculation in s. Without it the integral does not stop.

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
    weight: float | None = None
    feed_forward: float | None = None
    anti_windup: BackCalculation | ConditionalIntegration | float | None = None


@_explains_names
@dataclass(frozen=True, repr=False)
class PID(Controller):
    """Proportional, integral and derivative controller, u = Kp e + Ki ∫ e dt + Kd H e, e = r - y.

    Parameters
    ----------
    Kp, Ki, Kd : float
        Gains, not all zero.
    filter : DerivativeFilter, optional
        H(s); without it the derivative is ideal, and a step of the reference is an impulse of the
        command, which a limited or sampled loop does not see.
    weight : float, optional
        Weight b of the reference in the proportional term, Kp (b r - y); one without it. Below one,
        a step of the reference overshoots less; responses to loads stay as they are.
    derivative_weight : float, optional
        Weight c of the reference in the derivative, Kd H (c r - y); one without it.
    feed_forward : float, optional
        Gain of the reference past the controller, added to the command.
    anti_windup : BackCalculation, ConditionalIntegration or float, optional
        What keeps the integral from winding up while the command is limited; a number is the
        tracking time of back-calculation in s. Without it the integral does not stop.

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
    weight: float | None = None
    derivative_weight: float | None = None
    feed_forward: float | None = None
    anti_windup: BackCalculation | ConditionalIntegration | float | None = None
