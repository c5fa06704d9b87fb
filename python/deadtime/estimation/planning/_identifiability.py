"""`identifiability`: how well a planned experiment will determine the parameters of a loop."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

import deadtime.estimation.planning._planned_bound as planned
from deadtime._base.digits import stated
from deadtime._base.drawing import Axes, Figure, empty_figure
from deadtime._base.errors import NotIdentifiableError
from deadtime._base.frozen import ReadOnlyArrays
from deadtime._base.notebook import Pictured
from deadtime._base.progress import Progress
from deadtime._base.validation import finite, positive, whole_number
from deadtime.estimation._estimate import estimate_delay, method_of
from deadtime.estimation._least_squares import unit_of
from deadtime.estimation.data._checks import VEHICLE_PARAMETERS, checked_names
from deadtime.estimation.methods._method import Method
from deadtime.estimation.methods._output_error import OutputError
from deadtime.estimation.methods._waveform import CTA, Grid, Waveform
from deadtime.estimation.planning._monte_carlo import SLOW, MonteCarlo, Trials, with_sums
from deadtime.estimation.planning._planned_bound import PlannedBound
from deadtime.experiments import Experiment, FlightNoise, NoiseModel
from deadtime.loops import ControlLoop
from deadtime.recordings import Recording


@dataclass(frozen=True, eq=False, repr=False)
class Identifiability(ReadOnlyArrays, Pictured):
    """Smallest possible errors of the parameters of a loop, from a planned experiment.

    Attributes
    ----------
    loop : ControlLoop
        The assumed loop.
    experiment : Experiment
        The planned experiment.
    free : tuple of str
        What is to be fitted.
    noise : FlightNoise
        The noise of the run.
    initial_output : float or None
        The output at the start where it is known, None where it is fitted too.
    recording : Recording
        The expected recording, without noise.
    command_logged : PlannedBound or None
        The bound where the command is in the log, whether or not the controller acts on the noise.
        It also holds where the command can be computed from the rest of the log.
    reference_only : PlannedBound or None
        The bound where only reference and output are known, and the controller does not act on the
        noise.
    remarks : tuple of str
        Why one of the bounds is None.
    """

    loop: ControlLoop
    experiment: Experiment
    free: tuple[str, ...]
    noise: FlightNoise
    initial_output: float | None
    recording: Recording
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
        method: str | Method = "auto",
        *,
        seed: int = 0,
        level: float = 0.95,
        noise_in_loop: bool = True,
        known: ControlLoop | None = None,
        processes: int | None = None,
        progress: Progress = False,
    ) -> MonteCarlo:
        """Simulate the experiment many times with noise, and estimate from each run.

        Parameters
        ----------
        runs : int
            Number of runs.
        method : str or Method
            As for `estimate_delay`.
        seed : int
            Seed of all of the noise; results do not depend on `processes`.
        level : float
            Of the intervals whose coverage is counted.
        noise_in_loop : bool
            As for `Experiment.run`.
        known : ControlLoop, optional
            What the estimator is given; by default the loop without its delay, or with it where
            that is not free.
        processes : int, optional
            Processes to work in; by default as many as there are processors, and none but this
            one for few runs. They are started anew, so a script that asks for them keeps what it
            does under ``if __name__ == "__main__":``.
        progress : bool or callable
            True for a progress bar; or called now and then with the number of runs done.

        Returns
        -------
        MonteCarlo

        Raises
        ------
        ValueError
            If an argument is out of its range, or the method does not exist.
        NotIdentifiableError
            If all runs were refused, with the most frequent reason.

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
        informed = self._informed(method_of(method, [self.recording]))
        trials = Trials(
            with_sums(self.loop),
            partial(self.experiment.run, self.loop, self.noise, noise_in_loop=noise_in_loop),
            partial(estimate_delay, loop=known, method=informed, free=self.free),
            seed,
            level,
        )
        return trials.run(informed.name, runs, processes, progress)

    def _informed(self, method: Method) -> Method:
        """The method, with the output at the start where that is known and it has the option."""
        if isinstance(method, (OutputError, Waveform, Grid, CTA)) and method.initial_output is None:
            return replace(method, initial_output=self.initial_output)
        return method

    def summary(self) -> str:
        """The bounds as a few lines of text."""
        lines = [
            f"{self.experiment.name}: {len(self.experiment)} samples, "
            f"{self.experiment.time[0]:g} to {self.experiment.time[-1]:g} s, {self.noise}; "
            f"free: {', '.join(self.bound.free)}",
            "  assumed values, and the smallest standard errors that are possible",
            f"  {'':<20}{'command logged':>20}{'reference only':>20}",
        ]
        known = with_sums(self.loop)
        for name in self.stderr:
            cells = [
                "-" if bound is None else stated(known[name], bound.stderr[name], unit_of(name))
                for bound in (self.command_logged, self.reference_only)
            ]
            lines.append(f"  {name:<20}{''.join(f'{cell:>20}' for cell in cells)}")
        if self.correlation is not None:
            lines.append(f"  correlation of delay and lag: {self.correlation:.3f}")
        lines += [f"  {remark}" for remark in self.remarks]
        return "\n".join(lines)

    def plot(self, ax: Sequence[Axes] | None = None) -> list[Axes]:
        """Draw the expected recording, the effect of each quantity on it, and delay against lag.

        Needs matplotlib.

        Parameters
        ----------
        ax : sequence of matplotlib.axes.Axes, optional
            One for the recording, one for the effects, and one for delay against lag where both
            are free. By default those of a new figure.

        Returns
        -------
        list of matplotlib.axes.Axes

        Raises
        ------
        ValueError
            If `ax` holds another number of axes.
        """
        from deadtime.estimation._plots import plot_identifiability

        return plot_identifiability(self, ax)

    def _picture(self) -> Figure:
        from deadtime.estimation._plots import planned_axes

        figure = empty_figure(10.0, 5.0)
        self.plot(planned_axes(self, figure))
        return figure

    def __repr__(self) -> str:
        known = with_sums(self.loop)
        errors = ", ".join(
            f"{name} {stated(known[name], error, unit_of(name))}"
            for name, error in self.stderr.items()
        )
        return f"<Identifiability of {self.experiment.name}: {errors}>"


def identifiability(
    loop: ControlLoop,
    experiment: Experiment,
    *,
    noise: float | FlightNoise,
    free: Sequence[str] | None = None,
    initial_output: float | None = None,
    runs: int = 0,
    seed: int = 0,
) -> Identifiability:
    """Find how well a planned experiment will determine delay, gain and lag.

    Parameters
    ----------
    loop : ControlLoop
        The assumed loop, its delay included.
    experiment : Experiment
        The planned experiment.
    noise : float or FlightNoise
        Standard deviation of the white noise on the measured output, in the output's unit; or a
        noise with air, trim and coloured noise of the sensor, such as that of an estimate.
    free : sequence of str, optional
        What is to be fitted: any of ``"delay"``, ``"gain"``, ``"lag"`` and ``"time_constant"``. By
        default all of them that the loop has, a lag only where it is above zero.
    initial_output : float, optional
        0.0 where the output at the start is known, as experiments start at zero; by default it
        is fitted too.
    runs : int
        Noise that the controller acts on moves the command, which adds information. By default
        this is left out, and the bound is that of the run without noise; a number above zero takes
        the mean information of so many runs with noise instead, for the command logged.
    seed : int
        Seed of the noise of these runs.

    Returns
    -------
    Identifiability

    Raises
    ------
    NotIdentifiableError
        If the parameters cannot be determined: the experiment does not excite the loop, the command
        is at its limit throughout, the output does not move before the end, or two of the
        parameters have the same effect.
    ValueError
        If the delay of the loop is None, the loop has no parameter of a name in `free`, or the
        experiment's samples are not those of the loop.

    Notes
    -----
    The bound is Cramér and Rao's: no unbiased estimator has a smaller standard error, whatever
    method it uses, and ``estimate_delay(method="output_error")`` reaches it. It holds for small
    noise: where the bound on a lag is as large as the lag itself, estimates pile up at zero.

    Air hides the response to the command wherever the two have the same frequencies. The trim is
    fitted beside the parameters where the noise has one, and where the air walks at random, whose
    value at the start no estimator knows. The deviations and time constants of the noise are taken
    as known; in few samples they are not, and estimates scatter more.

    The loop may be unstable or in a limit cycle: the bound depends on the recording alone.

    Examples
    --------
    A step hardly tells delay and lag apart; a random binary sequence does. Both determine their
    sum:

    >>> import deadtime as dtm
    >>> loop = dtm.ControlLoop(
    ...     dtm.Integrator(lag=0.06), dtm.P(1.31), delay=0.36, sample_time=0.065, limit=1.0
    ... )
    >>> for experiment in (dtm.Experiment.step(), dtm.Experiment.prbs(20.0, 0.4, hold=0.4)):
    ...     plan = dtm.identifiability(loop, experiment, noise=0.01, initial_output=0.0)
    ...     print({name: round(1e3 * plan.stderr[name], 1) for name in ("delay", "delay+lag")})
    {'delay': 18.3, 'delay+lag': 2.8}
    {'delay': 4.2, 'delay+lag': 1.1}

    Gusts of 0.1 m/s that last a second make both worse:

    >>> from deadtime.experiments import FlightNoise
    >>> wind = FlightNoise(white=0.01, air=0.1, air_time=1.0)
    >>> plan = dtm.identifiability(loop, experiment, noise=wind, initial_output=0.0)
    >>> {name: round(1e3 * plan.stderr[name], 1) for name in ("delay", "delay+lag")}
    {'delay': 7.2, 'delay+lag': 3.1}
    """
    if not isinstance(loop, ControlLoop):
        raise TypeError(f"loop is a {type(loop).__name__}: give a ControlLoop")
    if not isinstance(experiment, Experiment):
        raise TypeError(f"experiment is a {type(experiment).__name__}: give an Experiment")
    if free is None:
        free = ["delay", *(name for name, value in loop.plant.parameters.items() if value)]
    known = tuple(dict.fromkeys([*VEHICLE_PARAMETERS, *loop.plant.parameters]))
    names = checked_names(free, loop, known)
    noise = _noise_with_covariance(noise)
    if initial_output is not None and finite("initial_output", initial_output) != 0.0:
        raise ValueError(
            f"initial_output={initial_output}: an experiment starts at rest, with an output "
            "of zero. Give 0.0 if the start is known, or None if the start is fitted"
        )
    count = whole_number("runs", runs, least=0)
    offset = initial_output is None
    run_loop = experiment.loop_in_run(loop)
    recording = experiment.run(loop)
    _check_excitation(run_loop, recording, names)
    seeds = np.random.SeedSequence(seed).spawn(count)
    recordings = [experiment.run(loop, noise, number) for number in seeds] or [recording]
    asked = run_loop, names, offset, noise
    remarks: list[str] = []

    def found(label: str, of: Callable[..., PlannedBound], *given: Any) -> PlannedBound | None:
        """A bound, or a remark why there is none."""
        try:
            return of(*asked, *given)
        except (NotIdentifiableError, ValueError) as refusal:
            remarks.append(f"{label}: {refusal}")
        return None

    logged = found("command logged", planned.bound_with_command, recordings)
    alone = found("reference only", planned.bound_with_reference, experiment, recording)
    if logged is None and (alone is None or run_loop.is_sampled):
        raise NotIdentifiableError("; ".join(remarks))
    return Identifiability(
        loop, experiment, names, noise, initial_output, recording, logged, alone, tuple(remarks)
    )


def _noise_with_covariance(noise: float | FlightNoise) -> FlightNoise:
    """The noise, checked to have a covariance that is known and regular."""
    if isinstance(noise, FlightNoise):
        positive("noise.white", noise.white)
        return noise
    if isinstance(noise, NoiseModel):
        raise TypeError(
            f"noise is a {type(noise).__name__}, so its covariance is "
            "not known: give a standard deviation or a FlightNoise"
        )
    return FlightNoise(positive("noise", noise))


def _check_excitation(loop: ControlLoop, recording: Recording, names: tuple[str, ...]) -> None:
    """Refuse experiments from which no parameter can be estimated."""
    command = recording.command
    assert command is not None
    if not command.any():
        raise NotIdentifiableError(
            "the command is 0 throughout, so this experiment does not excite the loop"
        )
    if float(np.ptp(recording.output)) == 0.0:
        raise NotIdentifiableError(
            "until the end of the experiment at "
            f"{recording.time[-1]:g} s the output does not move: make "
            f"the experiment longer than the delay of {loop.delay:g} s"
        )
    if loop.is_sampled and float(np.ptp(command)) == 0.0:
        raise NotIdentifiableError(
            f"the command stays at its limit, {command[0]:g}: "
            "use a smaller step, or a longer experiment"
        )
    slow = [name for name in SLOW if name in names]
    if slow and "delay" in names and loop.parameters[slow[0]] == 0.0:
        raise NotIdentifiableError(
            f"at {slow[0]}=0 the {slow[0]} has the same effect as a "
            "delay, so the recording cannot separate the two. Assume a "
            f"{slow[0]} above zero, such as loop.replace({slow[0]}=0.05)"
        )
