"""What a control loop consists of, checked once, and the equations that follow from it.

`ControlLoop` is this specification and the questions that can be asked of it; the files that answer
them take the specification.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal, NoReturn

import numpy as np
from numpy.typing import NDArray

from deadtime._base.arrays import Array
from deadtime._base.frozen import PickledByFields
from deadtime._base.validation import non_negative, positive
from deadtime.loops._controllers import Controller
from deadtime.loops._model import LoopModel
from deadtime.loops._native import Loop
from deadtime.loops._plants import Plant
from deadtime.roots import Parameter, ParametricQuasiPolynomial, QuasiPolynomial
from deadtime.systems import TransferFunction

if TYPE_CHECKING:
    from deadtime.loops._native import LinearLoop, LoopResponse
    from deadtime.loops._runs import LoopRun


#: The names of unequal limits of the command, the least one first.
UNEQUAL = ("limit_low", "limit_high")

#: Numbers that the poles of a loop do not depend on.
_WITHOUT_POLES = (
    *("limit", *UNEQUAL, "rate_limit", "tracking_time"),
    *("weight", "derivative_weight", "feed_forward"),
)

#: Where the delay of a loop can sit.
DELAY_PATHS = ("command", "measurement")


@dataclass(frozen=True)
class LoopSpecification(PickledByFields):
    """Plant, controller, delay, hold and limit of a loop; see `ControlLoop` for each."""

    plant: Plant
    controller: Controller
    delay: float | None = None
    sample_time: float | None = None
    limit: float | None = None
    rate_limit: float | None = None
    delay_path: Literal["command", "measurement"] = "command"

    def __post_init__(self) -> None:
        if not isinstance(self.plant, Plant):
            raise TypeError(f"plant={self.plant!r}: give a plant, for example Integrator()")
        if not isinstance(self.controller, Controller):
            raise TypeError(f"controller={self.controller!r}: give a controller, such as P(Kp=1)")
        if self.delay is not None:
            object.__setattr__(self, "delay", non_negative("delay", self.delay))
        if self.sample_time is not None:
            object.__setattr__(self, "sample_time", positive("sample_time", self.sample_time))
        if self.limit is not None:
            object.__setattr__(self, "limit", _limit(self.limit))
        if self.rate_limit is not None:
            object.__setattr__(self, "rate_limit", positive("rate_limit", self.rate_limit))
        if self.delay_path not in DELAY_PATHS:
            raise ValueError(
                f"delay_path={self.delay_path!r}: give one of {', '.join(map(repr, DELAY_PATHS))}"
            )
        if self.plant.is_rational:
            self.kernel.check()
            return
        if not self.plant.is_linear:
            return
        for name in ("sample_time", "limit", "rate_limit"):
            value = getattr(self, name)
            if value is not None:
                raise ValueError(
                    f"{name}={value}: a hold or a limit needs a plant that is rational except "
                    f"for one delay in series, but this plant has delays inside. Leave {name} "
                    "out"
                )

    @property
    def parameters(self) -> dict[str, float]:
        """The named numbers of plant and controller, then those of the loop that are not None."""
        numbers = self.plant.parameters | self.controller.parameters
        numbers |= {
            name: value
            for name in ("delay", "sample_time")
            if (value := getattr(self, name)) is not None
        }
        if is_unequal(self.limit):
            numbers |= dict(zip(UNEQUAL, self.bounds, strict=True))
        elif self.limit is not None:
            numbers["limit"] = self.limit
        if self.rate_limit is not None:
            numbers["rate_limit"] = self.rate_limit
        return numbers

    @property
    def bounds(self) -> tuple[float, float]:
        """The least and the greatest command, infinite where there is none."""
        given: object = self.limit
        if isinstance(given, UnequalLimits):
            return given.low, given.high
        limit = np.inf if self.limit is None else self.limit
        return -limit, limit

    @property
    def known_delay(self) -> float:
        """The delay in s; raises where it is None."""
        if self.delay is None:
            raise ValueError(
                "the delay of this loop is None: give the delay with loop.replace(delay=...), "
                "or estimate it from a recording first"
            )
        return self.delay

    def transfer(self, of: str) -> TransferFunction:
        """The loop gain (`open`), or from the reference to `output` or `command`."""
        _ = self.known_delay
        if of == "open":
            num, den = self.kernel.gain()
            return TransferFunction(QuasiPolynomial._wrap(num), QuasiPolynomial._wrap(den))
        output, command = self.transfers("reference")
        return output if of == "output" else command

    def transfers(self, given: str) -> tuple[TransferFunction, TransferFunction]:
        """From the `reference`, a `load`, the `output` or `noise` to output and command."""
        _ = self.known_delay
        den = QuasiPolynomial._wrap(self.kernel.characteristic())
        output, command = self.kernel.transfer(given)
        return (
            TransferFunction(QuasiPolynomial._wrap(output), den),
            TransferFunction(QuasiPolynomial._wrap(command), den),
        )

    def refuse_hold(self, why: str) -> None:
        """Raise where the loop is sampled."""
        if self.sample_time is not None:
            raise ValueError(f"a loop with sample_time={self.sample_time} {why}")

    @property
    def output_lead(self) -> float:
        """How much earlier than its measurement the output is, s."""
        return self.known_delay if self.delay_path == "measurement" else 0.0

    @cached_property
    def kernel(self) -> Loop:
        """The loop of the kernel; a delay that is None counts as zero there."""
        plant, controller = self.plant, self.controller
        numbers = plant.parameters
        return Loop(
            plant._form,
            controller._form,
            ([*numbers.values()], [*controller.parameters.values()]),
            delay=0.0 if self.delay is None else self.delay,
            sample_time=self.sample_time,
            bounds=_Bounds(self),
            is_measured=self.delay_path == "measurement",
            given=plant._given(numbers),
        )

    def kernel_at(self, values: Mapping[str, float]) -> Loop:
        """The loop of the kernel with other numbers."""
        numbers = self.plant.parameters
        given = self.plant._given({**numbers, **values}) if numbers.keys() & values.keys() else None
        return self.kernel.at(dict(values), given)

    def kernels_at(self, sets: Sequence[Mapping[str, float]]) -> list[Loop]:
        """The loops of the kernel with other numbers."""
        numbers = self.plant.parameters
        given = self.plant._given(numbers)
        each = [given and self.plant._given({**numbers, **values}) for values in sets]
        return self.kernel.at_each([*map(dict, sets)], each)

    def outputs_at(
        self,
        values: Mapping[str, float],
        time: Array,
        reference: tuple[Array, Array],
        initial_output: float,
        past: tuple[Array, float],
    ) -> Array:
        """Outputs with other numbers, as `ControlLoop.simulate` with these arguments gives them.

        `reference` are values and their times, `past` the command history and the sample phase.
        """
        numbers = self.plant.parameters
        given = self.plant._given({**numbers, **values})
        return self.kernel.outputs(
            dict(values),
            time,
            *reference,
            initial_output,
            command_history=past[0],
            sample_phase=past[1],
            given=given,
        )

    def abscissa_at(self, values: Mapping[str, float]) -> float:
        """Spectral abscissa in 1/s with other numbers, also beyond what a loop may have."""
        _ = self.known_delay
        changed = self.kernel_at(values)
        if self.sample_time is None:
            return float(QuasiPolynomial._wrap(changed.characteristic()).spectral_abscissa())
        return changed.linear.abscissa()

    def polynomials_of(self, numbers: list[float]) -> tuple[list[Any], list[Any]] | None:
        """Polynomials for a gain of one, of a plant that gives them, for other numbers of it."""
        return self.plant._given(dict(zip(self.plant.parameters, numbers, strict=True)))

    def _symbols(self, names: Sequence[str]) -> Any:
        """Those polynomials, in these numbers of the loop."""
        given = self.plant._given({**self.parameters, **{n: Parameter(n) for n in names}})
        return given and tuple([_monomials(c, names) for c in part] for part in given)

    def family_of(self, names: Sequence[str]) -> ParametricQuasiPolynomial:
        """The characteristic function with these numbers as its parameters."""
        numbers_of(self.parameters, names)
        terms: dict[Any, float] = {}
        for number, powers, power, constant, slopes in self.kernel.terms(
            list(names), self._symbols(names)
        ):
            key = (_named(names, powers), power, (constant, _named(names, slopes)))
            terms[key] = terms.get(key, 0.0) + number
        return ParametricQuasiPolynomial._of(tuple(names), terms)

    def stable_range(self, name: str) -> tuple[float, float]:
        """Stable values of one number of a stable loop, around its present one."""
        return self.kernel.stable_range(name, self._symbols((name,)), self.polynomials_of)

    @cached_property
    def native(self) -> LinearLoop:
        """The loop as the stepper holds it."""
        _ = self.known_delay
        return self.kernel.linear

    @cached_property
    def model(self) -> LoopModel:
        """The equations of the loop."""
        return LoopModel.of(self.kernel.linear)

    @cached_property
    def respond(self) -> Callable[[NDArray[np.float64], LoopRun | float], LoopResponse] | None:
        """The response at times to a run; None where the plant has delays inside.

        A run is a number as well: the height of a step from rest at zero.
        """
        return self.native.respond if self.plant.is_rational else None

    def rest_at(self, output: float, reference: float) -> tuple[NDArray[np.float64], float]:
        """State in which the plant rests at `output`, and the command that keeps it there."""
        return self.kernel.rest(output, reference)

    def steady_state(self, reference: float) -> float | None:
        """Output at rest under a constant reference; None without such a rest within the limit."""
        command = self.command_at_rest(reference)
        low, high = self.bounds
        if command is None or not low <= command <= high:
            return None
        return self.kernel.rest_gains()[0] * reference

    def command_at_rest(self, reference: float) -> float | None:
        """Command at rest under a constant reference, limit left out; None without such a rest."""
        output, command = self.kernel.rest_gains()
        return None if np.isnan(output) else command * reference


class _Bounds:
    """Bounds of the command as the kernel takes them."""

    def __init__(self, loop: LoopSpecification) -> None:
        low, high = loop.bounds
        self.limit = None if loop.limit is None else high
        self.low = low if is_unequal(loop.limit) else None
        self.rate = loop.rate_limit


class UnequalLimits:
    """The least and the greatest command, where a number is asked for that neither is."""

    __array_ufunc__ = None

    def __init__(self, low: float, high: float) -> None:
        self.low, self.high = low, high

    def __repr__(self) -> str:
        return f"({self.low!r}, {self.high!r})"

    def __eq__(self, other: object) -> bool:
        return isinstance(other, UnequalLimits) and hash(self) == hash(other)

    def __hash__(self) -> int:
        return hash((self.low, self.high))

    def _refuse(self, *_: object) -> NoReturn:
        raise ValueError(
            f"limit={self!r}: this function needs the same limit for positive and negative "
            "commands, or none. Use loop.replace(limit=...) with one number"
        )

    __float__ = __neg__ = __abs__ = __format__ = _refuse
    __lt__ = __le__ = __gt__ = __ge__ = _refuse
    __add__ = __radd__ = __sub__ = __rsub__ = _refuse
    __mul__ = __rmul__ = __truediv__ = __rtruediv__ = _refuse


def is_unequal(limit: object) -> bool:
    """Whether a limit has two bounds that are not alike."""
    return isinstance(limit, UnequalLimits)


def _limit(limit: Any) -> Any:
    """Check the limit of a command; one number where both bounds are alike."""
    if isinstance(limit, UnequalLimits):
        return limit
    if not (isinstance(limit, (tuple, list)) or np.ndim(limit) == 1):
        return positive("limit", limit)
    if len(limit) != 2:
        raise ValueError(
            f"limit={limit!r}: give one number, or a pair of the least and the greatest command"
        )
    low, high = (float("nan") if x is None else float(x) for x in limit)
    if not (low < high and low <= 0.0 <= high):
        raise ValueError(
            f"limit={limit!r}: give the least and the greatest command, with zero between them. "
            "For no limit, give float('inf')"
        )
    return high if low == -high else UnequalLimits(low, high)


def numbers_of(parameters: Mapping[str, float | None], names: Collection[str]) -> dict[str, Any]:
    """Return the numbers of a loop that stability depends on; `names` must be among them."""
    values: dict[str, Any] = {**parameters}
    for name in _WITHOUT_POLES:
        values.pop(name, None)
    unknown = [name for name in names if name not in values and name != "delay"]
    if unknown:
        raise ValueError(
            f"ranges for {', '.join(unknown)}: the stability of this loop does not depend on "
            f"this parameter. It depends on {', '.join(dict.fromkeys([*values, 'delay']))}"
        )
    if "delay" not in values and "delay" not in names:
        raise ValueError(
            "the delay of this loop is None: give the delay a range, or a value with "
            "loop.replace(delay=...)"
        )
    return values


def refuse_discretised(controller: Controller, sample_time: float | None, what: str) -> None:
    """Raise where a filter runs in samples, which `what` cannot do."""
    smooth = controller._filter
    if sample_time is not None and smooth is not None and smooth.discretisation is not None:
        raise ValueError(
            f"{what} cannot have a filter that runs on samples "
            f"(discretisation={smooth.discretisation!r}): leave discretisation out, or simulate "
            "the loops one by one"
        )


def _named(names: Sequence[str], numbers: Sequence[Any]) -> tuple[tuple[str, Any], ...]:
    """Names and numbers that are not zero, by name."""
    return tuple(sorted((n, x) for n, x in zip(names, numbers, strict=True) if x))


def _monomials(coefficient: Any, names: Sequence[str]) -> list[tuple[float, list[int]]]:
    """A coefficient of a plant as factors and powers of `names`."""
    if not isinstance(coefficient, ParametricQuasiPolynomial):
        return [(float(coefficient), [])]
    found = []
    for (powers, _, _), factor in coefficient._terms.items():
        exponents = dict(powers)
        found.append((factor, [exponents.get(name, 0) for name in names]))
    return found
