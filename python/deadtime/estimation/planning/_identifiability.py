"""What an experiment will tell, before it is flown."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from deadtime._base.errors import NotIdentifiableError
from deadtime._base.frozen import ReadOnlyArrays
from deadtime._base.progress import Progress
from deadtime._base.validation import finite, positive, whole_number
from deadtime.estimation.data._evidence import OF_THE_VEHICLE, checked_names
from deadtime.estimation.planning._monte_carlo import SLOW, MonteCarlo, Plan, flown_many_times
from deadtime.estimation.planning._planned_bound import (
    PlannedBound,
    bound_of,
    from_the_command,
    from_the_reference,
)
from deadtime.experiments import Experiment
from deadtime.loops import ControlLoop
from deadtime.recordings import Recording

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["Identifiability", "identifiability"]


@dataclass(frozen=True, eq=False, repr=False)
class Identifiability(ReadOnlyArrays):
    """How well an experiment determines the numbers of a loop, at best.

    Attributes
    ----------
    loop : ControlLoop
        The loop as it is guessed to be.
    experiment : Experiment
        What is to be flown.
    free : tuple of str
        What is to be fitted.
    noise : float
        Standard deviation of the white noise on the output.
    initial_output : float or None
        The output at the start where it is known, None where it is fitted too.
    flight : Recording
        The expected flight, without noise.
    command_logged : PlannedBound or None
        The bound where the command is in the log, whether or not noise goes round the loop. It
        holds as well where the command can be computed from the rest of the log.
    reference_only : PlannedBound or None
        The bound where only reference and output are known and noise does not circulate.
    remarks : tuple of str
        Why one of the bounds is None.
    """

    loop: ControlLoop
    experiment: Experiment
    free: tuple[str, ...]
    noise: float
    initial_output: float | None
    flight: Recording
    command_logged: PlannedBound | None
    reference_only: PlannedBound | None
    remarks: tuple[str, ...]

    @property
    def bound(self) -> PlannedBound:
        """The bound with the command logged; where there is none, that of the reference alone."""
        found = self.command_logged or self.reference_only
        assert found is not None
        return found

    @property
    def stderr(self) -> dict[str, float]:
        """Smallest standard error of each free quantity, of `bound`."""
        return self.bound.stderr

    @property
    def correlation(self) -> float | None:
        """Correlation of the errors of delay and lag (or time constant), None if one is fixed."""
        slow = [name for name in SLOW if name in self.free]
        if not slow or "delay" not in self.free:
            return None
        return self.bound.correlation("delay", slow[0])

    def monte_carlo(
        self,
        runs: int = 1000,
        method: str = "auto",
        *,
        seed: int = 0,
        level: float = 0.95,
        circulates: bool = True,
        known: ControlLoop | None = None,
        processes: int | None = None,
        progress: Progress = False,
        **options: Any,
    ) -> MonteCarlo:
        """Fly the experiment many times with noise, and estimate from each flight.

        Parameters
        ----------
        runs : int
            Number of flights.
        method : str
            As for `estimate_delay`.
        seed : int
            Seed of all of the noise; results do not depend on `processes`.
        level : float
            Of the intervals whose coverage is counted.
        circulates : bool
            As for `Experiment.fly`.
        known : ControlLoop, optional
            What the estimator is given; by default the loop without its delay, or with it where
            that is not free.
        processes : int, optional
            Processes to work in; by default as many as there are processors, and none but this
            one for few runs. They are started anew, so a script that asks for them keeps what it
            does under ``if __name__ == "__main__":``.
        progress : bool or callable
            True for a progress bar; or called now and then with the number of runs done.
        **options
            Options of the method.

        Returns
        -------
        MonteCarlo

        Raises
        ------
        ValueError
            If an argument is out of its range, the method does not exist or an option is not
            one of its.
        NotIdentifiableError
            If all flights were refused, with the most frequent reason.

        Examples
        --------
        >>> import deadtime as dtm
        >>> loop = dtm.ControlLoop(
        ...     dtm.Integrator(), dtm.P(1.31), delay=0.36, sample_time=0.065, limit=1.0
        ... )
        >>> plan = dtm.identifiability(
        ...     loop, dtm.Experiment.step(), noise=0.01, free=("delay", "gain")
        ... )
        >>> tried = plan.monte_carlo(40, processes=1)
        >>> 0.7 < tried.rmse["delay"] / plan.stderr["delay"] < 1.3
        True
        """
        if known is None:
            known = self.loop.replace(delay=None) if "delay" in self.free else self.loop
        plan = Plan(
            loop=self.loop,
            experiment=self.experiment,
            noise=self.noise,
            free=self.free,
            initial_output=self.initial_output,
            known=known,
            method=method,
            options=dict(options),
            circulates=circulates,
            level=level,
        )
        return flown_many_times(plan, runs, seed, processes, progress)

    def summary(self) -> str:
        """The bounds as a few lines of text."""
        lines = [
            f"{self.experiment.name}: {len(self.experiment)} samples, "
            f"{self.experiment.time[0]:g} to {self.experiment.time[-1]:g} s, noise {self.noise:g}; "
            f"free: {', '.join(self.bound.free)}",
            "  smallest standard errors",
            f"  {'':<12}{'command logged':>16}{'reference only':>16}",
        ]
        for name in self.stderr:
            cells = [
                f"{'-' if bound is None else format(bound.stderr[name], '.3g'):>16}"
                for bound in (self.command_logged, self.reference_only)
            ]
            unit = "" if name == "gain" else " s"
            lines.append(f"  {name + unit:<12}{''.join(cells)}")
        if self.correlation is not None:
            lines.append(f"  correlation of delay and lag: {self.correlation:.3f}")
        lines += [f"  {remark}" for remark in self.remarks]
        return "\n".join(lines)

    def plot(self) -> Figure:
        """The expected flight, what each quantity does to it, and delay against lag.

        Needs matplotlib.
        """
        from deadtime.estimation.planning._plots import plot_identifiability

        return plot_identifiability(self)

    def __repr__(self) -> str:
        errors = ", ".join(f"{name} ± {error:.3g}" for name, error in self.stderr.items())
        return f"<Identifiability of {self.experiment.name}: {errors}>"


def identifiability(
    loop: ControlLoop,
    experiment: Experiment,
    *,
    noise: float,
    free: Sequence[str] | None = None,
    initial_output: float | None = None,
    flights: int = 0,
    seed: int = 0,
) -> Identifiability:
    """Find how well an experiment will determine delay, gain and lag, before it is flown.

    Parameters
    ----------
    loop : ControlLoop
        The loop as it is guessed to be, its delay included.
    experiment : Experiment
        What is to be flown.
    noise : float
        Standard deviation of the noise on the measured output, white, in the output's unit.
    free : sequence of str, optional
        What is to be fitted: any of ``"delay"``, ``"gain"``, ``"lag"`` and ``"time_constant"``. By
        default all of them that the loop has, a lag only where it is above zero.
    initial_output : float, optional
        0.0 where the output at the start is known, as experiments start at zero; by default it
        is fitted too.
    flights : int
        Noise that goes round the loop moves the command, which informs. By default that is left
        out, and the bound is that of the flight without noise; a number above zero takes the
        mean information of so many flights with noise instead, for the command logged.
    seed : int
        Of the noise of these flights.

    Returns
    -------
    Identifiability

    Raises
    ------
    NotIdentifiableError
        If the experiment cannot tell: it excites nothing, the command is at its limit throughout,
        the output does not move before the end, or two of the numbers have the same effect.
    ValueError
        If the delay of the loop is None, the loop has no number of a name in `free`, or the
        experiment's samples are not those of the loop.

    Notes
    -----
    The bound is Cramér and Rao's: no unbiased estimator has a smaller standard error, whatever
    method it uses, and ``estimate_delay(method="output_error")`` reaches it. It holds for small
    noise: where the bound on a lag is as large as the lag itself, estimates pile up at zero.

    A limit cycle or an unstable loop is no obstacle: only the path matters.

    Examples
    --------
    A step hardly tells delay and lag apart; a random binary sequence does, and either knows
    their sum:

    >>> import deadtime as dtm
    >>> loop = dtm.ControlLoop(
    ...     dtm.Integrator(lag=0.06), dtm.P(1.31), delay=0.36, sample_time=0.065, limit=1.0
    ... )
    >>> for experiment in (dtm.Experiment.step(), dtm.Experiment.prbs(20.0, 0.4, hold=0.4)):
    ...     plan = dtm.identifiability(loop, experiment, noise=0.01, initial_output=0.0)
    ...     print({name: round(1e3 * plan.stderr[name], 1) for name in ("delay", "delay+lag")})
    {'delay': 18.3, 'delay+lag': 2.8}
    {'delay': 4.2, 'delay+lag': 1.1}
    """
    if not isinstance(loop, ControlLoop):
        raise TypeError(f"loop is a {type(loop).__name__}, not a ControlLoop")
    if not isinstance(experiment, Experiment):
        raise TypeError(f"experiment is a {type(experiment).__name__}, not an Experiment")
    if free is None:
        free = ["delay", *(name for name in OF_THE_VEHICLE if loop.parameters.get(name))]
    names = checked_names(free, loop)
    level = positive("noise", noise)
    if initial_output is not None and finite("initial_output", initial_output) != 0.0:
        raise ValueError(
            f"initial_output={initial_output}: an experiment starts at rest at zero; give 0.0 "
            "where that is known, None where the start is fitted"
        )
    count = whole_number("flights", flights, least=0)
    offset = initial_output is None
    flown = experiment.flown_loop(loop)
    flight = experiment.fly(loop)
    _check_excitation(flown, flight, names)
    seeds = np.random.SeedSequence(seed).spawn(count)
    noisy = [experiment.fly(loop, level, one) for one in seeds]

    def command_logged() -> PlannedBound:
        if not flown.is_sampled:
            raise NotIdentifiableError(
                "a continuous loop changes its command between the samples of a log"
            )
        slopes = [from_the_command(flown, one, names, offset) for one in noisy or [flight]]
        return bound_of(slopes, names, level)

    def reference_only() -> PlannedBound:
        slopes = from_the_reference(flown, experiment, names, offset, level)
        return bound_of([slopes], names, level)

    found: list[PlannedBound | None] = []
    remarks: list[str] = []
    for label, bound in (("command logged", command_logged), ("reference only", reference_only)):
        try:
            found.append(bound())
        except (NotIdentifiableError, ValueError) as refusal:
            found.append(None)
            remarks.append(f"{label}: {refusal}")
    if found[0] is None and (found[1] is None or flown.is_sampled):
        raise NotIdentifiableError("; ".join(remarks))
    return Identifiability(
        loop, experiment, names, level, initial_output, flight, found[0], found[1], tuple(remarks)
    )


def _check_excitation(loop: ControlLoop, flight: Recording, names: tuple[str, ...]) -> None:
    """Refuse experiments that no number can be learnt from."""
    command = flight.command
    assert command is not None
    if not command.any():
        raise NotIdentifiableError("the experiment excites nothing: the command is 0 throughout")
    if float(np.ptp(flight.output)) == 0.0:
        raise NotIdentifiableError(
            f"the output does not move by the end of the experiment, {flight.time[-1]:g} s: fly "
            f"for longer than the delay of {loop.delay:g} s"
        )
    if loop.is_sampled and float(np.ptp(command)) == 0.0:
        raise NotIdentifiableError(
            f"the command is {command[0]:g} throughout, at its limit: fly a smaller step, or longer"
        )
    slow = [name for name in SLOW if name in names]
    if slow and "delay" in names and loop.parameters[slow[0]] == 0.0:
        raise NotIdentifiableError(
            f"at {slow[0]}=0 the plant answers to the {slow[0]} as to the delay, so the two cannot "
            f"be told apart there: guess a {slow[0]}, such as loop.replace({slow[0]}=0.05)"
        )
