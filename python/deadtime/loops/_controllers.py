r"""Controllers: what turns the reference r and the measured output y into the command u.

Each is linear in its gains and is known in two forms: as polynomials, u = R(s) r - F(s) y, for
characteristic functions, and as equations

    x' = A x + B y + E r,   u = C x + p y + q y' + M r,

for simulation. The derivative is either ideal, H(s) = s, or filtered,
H(s) = \ :math:`\omega^2 s / (s^2 + 2 \zeta \omega s + \omega^2)`. In a sampled loop the filter
and the integrator stay continuous and are sampled with the rest: the discretisation is exact.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from deadtime._base.arrays import Array
from deadtime._base.validation import finite
from deadtime.loops._derivative_filter import DerivativeFilter, Discretisation, discretised
from deadtime.loops._entries import Polynomial, matrix, multiplied, vector
from deadtime.loops._given_plants import transfer_function_of
from deadtime.systems import TransferFunction


class ControllerEquations(NamedTuple):
    """x' = A x + B y + E r, u = C x + p y + q y' + M r, and an impulse where r jumps.

    With `update` a discretised filter has the last two states.
    """

    A: Array
    B: Array
    E: Array
    C: Array
    p: Any
    q: Any
    M: Any
    impulse: Any
    update: FilterUpdate | None = None


class FilterUpdate(NamedTuple):
    """What a sample does to the last two states: x becomes F x + G y + H r.

    They give the row C to u, and y itself `direct`.
    """

    F: Array
    G: Array
    H: Array
    row: Array
    direct: float


def _sampled(
    block: list[list[Any]],
    into: list[Any],
    out: list[Any],
    sample_time: float,
    rule: Discretisation,
    on_error: float,
) -> FilterUpdate:
    F, G, C = (np.array(part, dtype=np.float64) for part in (block, into, out))
    found = discretised(F, G, C, sample_time, rule)
    return FilterUpdate(found.F, found.G, -on_error * found.G, found.C, found.D)


@dataclass(frozen=True)
class Controller(ABC):
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
        return TransferFunction(*self._feedback(self.parameters))

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

    @abstractmethod
    def _terms(self, values: Mapping[str, Any]) -> _Terms:
        """Gains on the proportional, integral and derivative terms."""

    def _feedback(self, values: Mapping[str, Any]) -> tuple[Polynomial, Polynomial]:
        """F = num/den, descending, in numbers or symbols of `values`."""
        terms = self._terms(values)
        return self._rational(values, terms.proportional, terms.integral, terms.derivative)

    def _reference(self, values: Mapping[str, Any]) -> tuple[Polynomial, Polynomial]:
        """R = num/den over the denominator of F."""
        terms = self._terms(values)
        derivative = terms.derivative if terms.derivative_of_error else 0.0
        return self._rational(values, terms.proportional, terms.integral, derivative)

    def _rational(
        self, values: Mapping[str, Any], p: Any, i: Any, d: Any
    ) -> tuple[Polynomial, Polynomial]:
        """Sum of p, i/s and d H(s) over one denominator."""
        terms = self._terms(values)
        integral = [1.0, 0.0] if terms.integrates else [1.0]
        if self._filter is None or not terms.differentiates:
            rolled_off, slope = [1.0], [d, 0.0]
        else:
            omega, damping = values["omega"], values["damping"]
            rolled_off = [1.0, 2.0 * (damping * omega), omega * omega]
            slope = [omega * omega * d, 0.0]
        num = _scaled(p, multiplied(integral, rolled_off))
        if terms.differentiates:
            num = _summed(num, multiplied(integral, slope))
        if terms.integrates:
            num = _summed(num, _scaled(i, rolled_off))
        return num, multiplied(integral, rolled_off)

    def _equations(self, values: Mapping[str, Any]) -> ControllerEquations:
        """Equations of the states: integral of the error first, filter after it."""
        terms = self._terms(values)
        on_error = 1.0 if terms.derivative_of_error else 0.0
        update = None
        blocks: list[list[list[Any]]] = []
        drive: list[Any] = []
        along: list[Any] = []
        row: list[Any] = []
        p, q, through = -terms.proportional, 0.0, 0.0
        if terms.integrates:
            blocks.append([[0.0]])
            drive.append(-1.0)
            along.append(1.0)
            row.append(terms.integral)
        if terms.differentiates and self._filter is None:
            q = -terms.derivative
        elif terms.differentiates and self._filter is not None:
            omega, damping = values["omega"], values["damping"]
            # The second state is the derivative over omega, so that both are of one size.
            block = [[0.0, omega], [-omega, -2.0 * damping * omega]]
            into, out = [0.0, omega], [0.0, -terms.derivative * omega]
            rule, sample_time = self._filter.discretisation, values.get("sample_time")
            if rule is not None and sample_time is not None:
                # Between samples the states hold; the samples move them.
                update = _sampled(block, into, out, sample_time, rule, on_error)
                block, into, out = [[0.0, 0.0], [0.0, 0.0]], [0.0, 0.0], update.row.tolist()
                p, through = p + update.direct, -on_error * update.direct
            blocks.append(block)
            drive += into
            # The filter sees y, or y - r for a derivative of the error.
            along += [-on_error * entry for entry in into]
            row += out
        rows: list[list[Any]] = []
        for block in blocks:
            before = len(rows)
            after = len(drive) - before - len(block)
            rows += [[0.0] * before + line + [0.0] * after for line in block]
        return ControllerEquations(
            matrix(rows),
            vector(drive),
            vector(along),
            vector(row),
            p,
            q,
            terms.proportional + through,
            -on_error * q,
            update,
        )

    def _rest(
        self, values: Mapping[str, Any], output: float, reference: float, command: Any
    ) -> Array:
        """States after a long time at constant `output` and `reference`, giving `command`.

        The integral takes the value at which the controller takes over without a bump.
        """
        terms = self._terms(values)
        states: list[Any] = []
        if terms.integrates:
            missing = command - terms.proportional * (reference - output)
            states.append(missing / terms.integral if terms.integral != 0.0 else 0.0)
        if terms.differentiates and self._filter is not None:
            seen = output - reference if terms.derivative_of_error else output
            states += [seen, 0.0]
        return vector(states)


class _Terms(NamedTuple):
    """u = p (r - y) + i ∫(r - y) - d H y, or + d H (r - y)."""

    proportional: Any
    integral: Any = 0.0
    derivative: Any = 0.0
    integrates: bool = False
    differentiates: bool = False
    derivative_of_error: bool = False


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

    def _terms(self, values: Mapping[str, Any]) -> _Terms:
        return _Terms(values["Kp"])


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

    def _terms(self, values: Mapping[str, Any]) -> _Terms:
        return _Terms(values["Kp"], derivative=values["Kv"], differentiates=True)


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

    def _terms(self, values: Mapping[str, Any]) -> _Terms:
        return _Terms(
            values["Kp"], derivative=values["Kd"], differentiates=True, derivative_of_error=True
        )


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

    def _terms(self, values: Mapping[str, Any]) -> _Terms:
        return _Terms(values["Kp"], integral=values["Ki"], integrates=True)


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

    def _terms(self, values: Mapping[str, Any]) -> _Terms:
        return _Terms(
            values["Kp"],
            integral=values["Ki"],
            derivative=values["Kd"],
            integrates=True,
            differentiates=True,
            derivative_of_error=True,
        )


def _summed(p: Polynomial, q: Polynomial) -> Polynomial:
    """Sum of two polynomials."""
    if len(p) < len(q):
        p, q = q, p
    head = len(p) - len(q)
    return p[:head] + [a + b for a, b in zip(p[head:], q, strict=True)]


def _scaled(factor: Any, p: Polynomial) -> Polynomial:
    """A polynomial times a number or symbol."""
    return [factor * a for a in p]
