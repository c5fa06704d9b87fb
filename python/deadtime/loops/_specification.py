"""What a control loop consists of, checked once, and the equations that follow from it.

`ControlLoop` is this specification and the questions that can be asked of it; the files that answer
them take the specification.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from deadtime._base.frozen import PickledByFields
from deadtime._base.validation import non_negative, positive
from deadtime.loops._characteristic import characteristic
from deadtime.loops._controllers import Controller
from deadtime.loops._model import LoopModel, LoopRun, rest_of, state_at_rest
from deadtime.loops._plants import Plant

if TYPE_CHECKING:
    from deadtime.loops._native import LinearLoop, LoopResponse


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
            object.__setattr__(self, "limit", positive("limit", self.limit))
        if self.delay_path not in DELAY_PATHS:
            raise ValueError(
                f"delay_path={self.delay_path!r}: give one of {', '.join(map(repr, DELAY_PATHS))}"
            )
        if self.plant.is_rational:
            # Building the model checks that its parts fit. A cached property takes a lock in Python
            # 3.11, for a tenth of the time of all this.
            vars(self)["model"] = self.model_at(self.parameters)
            return
        if not self.plant.is_linear:
            return
        for name, value in (("sample_time", self.sample_time), ("limit", self.limit)):
            if value is not None:
                raise ValueError(
                    f"{name}={value}: a hold or a limit needs a plant that is rational but for one "
                    f"delay in series, and this one has delays inside; leave {name} out"
                )

    @property
    def parameters(self) -> dict[str, float]:
        """The named numbers of plant and controller, then those of the loop that are not None."""
        numbers = self.plant.parameters | self.controller.parameters
        own = (("delay", self.delay), ("sample_time", self.sample_time), ("limit", self.limit))
        for name, value in own:
            if value is not None:
                numbers[name] = value
        return numbers

    @property
    def known_delay(self) -> float:
        """The delay in s; raises where it is None."""
        if self.delay is None:
            raise ValueError(
                "the delay of this loop is None: set it with loop.replace(delay=...) or estimate "
                "it from a recording first"
            )
        return self.delay

    @property
    def known_parts(self) -> tuple[Plant, Controller, dict[str, float]]:
        """Plant, controller and all numbers; raises where the delay is None."""
        return self.plant, self.controller, self.parameters | {"delay": self.known_delay}

    def refuse_hold(self, why: str) -> None:
        """Raise where the loop is sampled."""
        if self.sample_time is not None:
            raise ValueError(f"a loop with sample_time={self.sample_time} {why}")

    @property
    def output_lead(self) -> float:
        """How much earlier than its measurement the output is, s."""
        return self.known_delay if self.delay_path == "measurement" else 0.0

    @cached_property
    def model(self) -> LoopModel:
        """The equations of the loop with its own numbers."""
        return self.model_at(self.parameters)

    def model_at(self, values: Mapping[str, Any]) -> LoopModel:
        """The equations with other numbers, arrays of them, or complex ones."""
        return LoopModel.build(self.plant, self.controller, values)

    def abscissa_at(self, values: Mapping[str, Any]) -> float:
        """Spectral abscissa in 1/s with other numbers, also beyond what a loop may have."""
        _ = self.known_delay
        if self.sample_time is None:
            return float(self.characteristic_at(values).spectral_abscissa())
        native = self._closed_at(values).native(values["delay"], values["sample_time"])
        found = native.abscissa()
        return float(native.poles()[0].real) if found is None else found

    def _closed_at(self, values: Mapping[str, Any]) -> LoopModel:
        """Equations whose poles are those with other numbers; from parts where gains alone differ.

        The feedback is linear in the gains, and nothing else that the poles depend on has them.
        """
        gains = self.controller._gains()
        own = self.parameters
        fixed = (name for name in own if name not in (*gains, "delay", "limit"))
        if self.model.update is not None or any(values[name] != own[name] for name in fixed):
            return self.model_at(values)
        K, L = np.zeros_like(self.model.K), 0.0
        for name, (row, direct) in self._shares.items():
            K, L = K + values[name] * row, L + values[name] * direct
        return replace(self.model, K=K, L=L)

    @cached_property
    def _shares(self) -> dict[str, tuple[NDArray[np.float64], float]]:
        """The feedback K and L of each gain alone, for a gain of one."""
        gains = self.controller._gains()
        alone = {name: self.parameters | dict.fromkeys(gains, 0.0) | {name: 1.0} for name in gains}
        models = {name: self.model_at(values) for name, values in alone.items()}
        return {name: (model.K, float(model.L)) for name, model in models.items()}

    def characteristic_at(self, values: Mapping[str, Any]) -> Any:
        """The characteristic function with numbers or symbols, one for each of `parameters`."""
        return characteristic(self.plant, self.controller, values)

    @cached_property
    def native(self) -> LinearLoop:
        """The loop as the stepper holds it."""
        is_ahead = self.delay_path == "measurement"
        return self.model.native(self.known_delay, self.sample_time, self.limit, is_ahead)

    @cached_property
    def respond(self) -> Callable[[NDArray[np.float64], LoopRun | float], LoopResponse] | None:
        """The response at times to a run; None where the plant has delays inside.

        A run is a number as well: the height of a step from rest at zero.
        """
        return self.native.respond if self.plant.is_rational else None

    def rest_at(self, output: float, reference: float) -> tuple[NDArray[np.float64], float]:
        """State in which the plant rests at `output`, and the command that keeps it there."""
        if output == 0.0 and reference == 0.0:
            return self._rest_at_zero
        return self._rest_at(output, reference)

    @cached_property
    def _rest_at_zero(self) -> tuple[NDArray[np.float64], float]:
        return np.zeros(len(self.model.B)), 0.0

    def _rest_at(self, output: float, reference: float) -> tuple[NDArray[np.float64], float]:
        numbers, space = self.parameters, self.model.plant
        return state_at_rest(self.plant, self.controller, numbers, output, reference, space)

    def steady_state(self, reference: float) -> float | None:
        """Output at rest under a constant reference; None without such a rest within the limit."""
        command = self.command_at_rest(reference)
        if command is None or (self.limit is not None and abs(command) > self.limit):
            return None
        return self._rest_gains[0] * reference if self._rest_gains else None

    def command_at_rest(self, reference: float) -> float | None:
        """Command at rest under a constant reference, limit left out; None without such a rest."""
        return self._rest_gains[1] * reference if self._rest_gains else None

    @cached_property
    def _rest_gains(self) -> tuple[float, float] | None:
        """Output and command at rest under a unit reference, None where there is no such rest."""
        if self.model.update is not None:
            return self.model.rest_gains
        output, command = rest_of(self.plant, self.controller, self.parameters)
        return None if np.isnan(output) else (float(output), float(command))
