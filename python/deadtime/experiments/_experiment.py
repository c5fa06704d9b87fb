"""Experiments that identify a loop: a reference over time, or a relay for the controller."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from deadtime._base.arrays import Array
from deadtime._base.frozen import ReadOnlyArrays, read_only
from deadtime._base.validation import (
    finite,
    increasing,
    non_negative,
    one_dimensional,
    positive,
    whole_number,
)
from deadtime.experiments._noise import Noise, Seed, noise_model
from deadtime.experiments._noise_in_loop import disturbance_of, reference_shift
from deadtime.experiments._waves import (
    ON_A_SAMPLE,
    binary_sequence,
    excited_lines,
    hold_numbers,
    multisine,
    sample_times,
    whole_period,
)
from deadtime.loops import ControlLoop, P
from deadtime.recordings import MINIMUM_SAMPLES, Recording

#: A relay is simulated as a P controller with this gain (1/s, times the amplitude) and the
#: amplitude as its limit. The reference is higher by this share (s, times the amplitude), so that
#: the relay is up at zero error.
RELAY_GAIN, RELAY_SHIFT = 1e12, 1e-9


@dataclass(frozen=True, eq=False, repr=False)
class Experiment(ReadOnlyArrays):
    """A planned experiment: the reference over time, or a relay in the place of the controller.

    Parameters
    ----------
    time : array_like, shape (n,)
        Sample times in s, increasing. The loop is at rest before the first of them.
    reference : array_like, shape (n,)
        The reference from each sample time on.
    relay_amplitude : float, optional
        Amplitude of a relay that replaces the controller: the command is plus or minus this, with
        the sign of reference minus output.
    name : str
        Name for tables and labels.
    period : float, optional
        Period of the reference in s if it is periodic, a whole number of samples.

    Raises
    ------
    ValueError
        If times do not increase, lengths differ, a value is not finite, there are fewer than 8
        samples, or the amplitude or period is not above zero.

    Examples
    --------
    >>> import deadtime as dtm
    >>> loop = dtm.ControlLoop(
    ...     dtm.Integrator(), dtm.P(1.31), delay=0.36, sample_time=0.065, limit=1.0
    ... )
    >>> recording = dtm.Experiment.step(duration=5.0).run(loop, noise=0.01, seed=1)
    >>> recording
    <Recording from step of 1: 77 samples, 0 to 4.94 s, reference, output, command>
    >>> known = loop.replace(delay=None)
    >>> dtm.estimate_delay(recording, known, free=("delay",)).ci(0.95)[0] < 0.36
    True
    """

    time: Array
    reference: Array
    relay_amplitude: float | None
    name: str
    period: float | None

    def __init__(
        self,
        time: ArrayLike,
        reference: ArrayLike,
        relay_amplitude: float | None = None,
        name: str = "experiment",
        period: float | None = None,
    ) -> None:
        time = increasing("time", time).copy()
        reference = one_dimensional("reference", reference).copy()
        if reference.shape != time.shape:
            raise ValueError(
                f"reference has {reference.size} values, but time has {time.size}: give one "
                "value for each time"
            )
        if time.size < MINIMUM_SAMPLES:
            raise ValueError(
                f"time has {time.size} samples, but at least {MINIMUM_SAMPLES} are needed: give "
                "a longer duration"
            )
        if not np.isfinite(reference).all():
            wrong = reference[~np.isfinite(reference)][0]
            raise ValueError(f"reference contains {wrong}: give finite values")
        held = {"time": read_only(time), "reference": read_only(reference), "name": name}
        for label, number in (("relay_amplitude", relay_amplitude), ("period", period)):
            held[label] = None if number is None else positive(label, number)
        for label, value in held.items():
            object.__setattr__(self, label, value)

    def __len__(self) -> int:
        return int(self.time.size)

    def __repr__(self) -> str:
        return (
            f"<Experiment {self.name}: {len(self)} samples, {self.time[0]:g} to "
            f"{self.time[-1]:g} s>"
        )

    @classmethod
    def step(
        cls,
        duration: float = 5.0,
        amplitude: float = 1.0,
        sample_time: float = 0.065,
        rest: float = 0.0,
    ) -> Experiment:
        """A step of the reference from zero.

        Parameters
        ----------
        duration : float
            From the first sample to the end, s.
        amplitude : float
            Height of the step.
        sample_time : float
            s.
        rest : float
            Time of the step in s; with 0 the first sample has the new reference already.

        Returns
        -------
        Experiment

        Examples
        --------
        >>> import deadtime as dtm
        >>> dtm.Experiment.step(duration=1.0, amplitude=2.0, sample_time=0.1, rest=0.2).reference
        array([0., 0., 2., 2., 2., 2., 2., 2., 2., 2.])
        """
        time = sample_times(duration, sample_time)
        begin = non_negative("rest", rest)
        if begin >= time[-1]:
            raise ValueError(
                f"rest={begin} s: the step would come after the end, which is at {time[-1]:g} "
                "s. Give a shorter rest"
            )
        height = finite("amplitude", amplitude)
        reference = np.where(time < begin - ON_A_SAMPLE * sample_time, 0.0, height)
        return cls(time, reference, name=f"step of {height:g}")

    @classmethod
    def square(
        cls, duration: float, amplitude: float, hold: float, sample_time: float = 0.065
    ) -> Experiment:
        """A square wave between plus and minus `amplitude`.

        Parameters
        ----------
        duration : float
            s.
        amplitude : float
            The wave begins with plus this.
        hold : float
            Time between changes of sign in s, half of the period. Where it is no whole number of
            samples, each change is at the first sample after its time.
        sample_time : float
            s.

        Returns
        -------
        Experiment

        Examples
        --------
        >>> import deadtime as dtm
        >>> dtm.Experiment.square(0.8, 0.5, hold=0.2, sample_time=0.1).reference
        array([ 0.5,  0.5, -0.5, -0.5,  0.5,  0.5, -0.5, -0.5])
        """
        time = sample_times(duration, sample_time)
        number = hold_numbers(time, hold, sample_time)
        signs = 1.0 - 2.0 * (number % 2)
        return cls(
            time,
            finite("amplitude", amplitude) * signs,
            name=f"square wave of ±{amplitude:g} that changes every {hold:g} s",
            period=whole_period(2.0 * hold, sample_time),
        )

    @classmethod
    def prbs(
        cls,
        duration: float,
        amplitude: float,
        hold: float,
        seed: int = 0,
        sample_time: float = 0.065,
    ) -> Experiment:
        """A pseudo-random binary sequence between plus and minus `amplitude`.

        Parameters
        ----------
        duration : float
            s. The shortest maximum-length sequence that lasts as long is used.
        amplitude : float
            Half of the way between the two levels.
        hold : float
            Shortest time between changes of sign in s. Where it is no whole number of samples,
            each change is at the first sample after its time.
        seed : int
            Determines where in the sequence the experiment begins.
        sample_time : float
            s.

        Returns
        -------
        Experiment

        Examples
        --------
        >>> import deadtime as dtm
        >>> dtm.Experiment.prbs(0.8, 0.4, hold=0.1, seed=3, sample_time=0.1).reference
        array([...])
        """
        time = sample_times(duration, sample_time)
        number = hold_numbers(time, hold, sample_time)
        signs, length = binary_sequence(int(number[-1]) + 1, seed)
        return cls(
            time,
            finite("amplitude", amplitude) * signs[number],
            name=f"PRBS of {amplitude:g}, {hold:g} s hold",
            period=whole_period(length * hold, sample_time),
        )

    @classmethod
    def multisine(
        cls,
        amplitude: float,
        period: float,
        lines: int | Sequence[int],
        periods: int = 1,
        seed: int = 0,
        sample_time: float = 0.065,
        *,
        odd: bool = False,
        phases: Literal["random", "schroeder"] = "random",
    ) -> Experiment:
        """A sum of harmonics of one period, with equal amplitudes.

        Parameters
        ----------
        amplitude : float
            Its largest absolute value.
        period : float
            s, a whole number of samples.
        lines : int or sequence of int
            The excited harmonics, 1 being one oscillation a period; a number excites all up to it.
        periods : int
            Number of periods.
        seed : int
            Seed of random phases.
        sample_time : float
            s.
        odd : bool
            Leave out the even ones of `lines`: a response at these shows a nonlinearity.
        phases : {"random", "schroeder"}
            Choice of the phases.

        Returns
        -------
        Experiment

        Examples
        --------
        >>> import deadtime as dtm
        >>> wave = dtm.Experiment.multisine(0.4, period=5.2, lines=12, periods=4, odd=True)
        >>> len(wave), wave.period, round(float(abs(wave.reference).max()), 12)
        (320, 5.2, 0.4)
        """
        sample = positive("sample_time", sample_time)
        if whole_period(positive("period", period), sample) is None:
            near = max(1, round(period / sample)) * sample
            raise ValueError(
                f"period={period} s is not a whole number of samples of {sample} s, so the wave "
                f"would not be periodic. Give {near:.10g}, for example"
            )
        count = round(period / sample)
        excited = excited_lines(lines, count, odd)
        wave = finite("amplitude", amplitude) * multisine(excited, count, phases, seed)
        repeated = np.tile(wave, whole_number("periods", periods))
        return cls(
            np.arange(repeated.size) * sample,
            repeated,
            name=f"multisine with an amplitude of {amplitude:g} and {excited.size} lines",
            period=count * sample,
        )

    @classmethod
    def relay(
        cls,
        duration: float,
        amplitude: float,
        sample_time: float = 0.065,
        reference: float = 0.0,
    ) -> Experiment:
        """A relay in the place of the controller, which causes a limit cycle.

        Parameters
        ----------
        duration : float
            s.
        amplitude : float
            The command is plus or minus this, above zero. It is plus where the output equals the
            reference, as at the start.
        sample_time : float
            s.
        reference : float
            Centre of the oscillation of the output.

        Returns
        -------
        Experiment

        Examples
        --------
        The period of an integrator with delay is four times the delay:

        >>> import deadtime as dtm
        >>> loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(1.0), delay=0.36)
        >>> found = dtm.Experiment.relay(10.0, 0.5, sample_time=0.01).run(loop)
        >>> ups = found.time[1:][(found.command[1:] > 0) & (found.command[:-1] < 0)]
        >>> round(float((ups[-1] - ups[0]) / (len(ups) - 1)), 3)
        1.44
        """
        time = sample_times(duration, sample_time)
        return cls(
            time,
            np.full(time.size, finite("reference", reference)),
            relay_amplitude=amplitude,
            name=f"relay of {amplitude:g}",
        )

    def loop_in_run(self, loop: ControlLoop) -> ControlLoop:
        """The loop as it runs and is logged.

        With the relay in the place of the controller, where there is one. The output is the one
        that arrives where the controller runs, so the whole delay counts as one of the command.

        Parameters
        ----------
        loop : ControlLoop
            The loop outside this experiment.

        Returns
        -------
        ControlLoop

        Raises
        ------
        ValueError
            If the sample times are not those of a sampled loop, or its limit is below the relay's
            amplitude.
        """
        if loop.sample_time is not None:
            missed = np.abs(np.diff(self.time) - loop.sample_time)
            if (missed > ON_A_SAMPLE * loop.sample_time).any():
                raise ValueError(
                    f"the experiment has a sample every {np.median(np.diff(self.time)):g} s, "
                    f"but the loop has a sample every {loop.sample_time:g} s: make the "
                    f"experiment with sample_time={loop.sample_time:g}"
                )
        loop = loop.replace(delay_path="command")
        if self.relay_amplitude is None:
            return loop
        if loop.limit is not None and loop.limit < self.relay_amplitude:
            raise ValueError(
                f"the relay's command of {self.relay_amplitude:g} exceeds the limit of the "
                f"command, {loop.limit:g}: give an amplitude up to this limit"
            )
        gain = RELAY_GAIN * self.relay_amplitude
        return loop.replace(controller=P(gain), limit=self.relay_amplitude)

    def reference_in_run(self) -> Array:
        """The reference that is simulated: shifted for a relay, so that it is up at zero error.

        Returns
        -------
        ndarray, shape (n,)
        """
        if self.relay_amplitude is None:
            return self.reference
        return self.reference + RELAY_SHIFT * self.relay_amplitude

    def run(
        self,
        loop: ControlLoop,
        noise: Noise = 0.0,
        seed: Seed = 0,
        noise_in_loop: bool = True,
    ) -> Recording:
        """Simulate the loop under this experiment, and log what a ground station would.

        Parameters
        ----------
        loop : ControlLoop
            The true loop, at rest at zero before the first sample.
        noise : float or NoiseModel
            The standard deviation of white noise on the measured output, or a model, such as
            `FlightNoise` with moving air.
        seed : int
            Seed of the noise.
        noise_in_loop : bool
            Whether the controller acts on the noise of the sensor; otherwise that noise is in the
            log only. On the effect of air and trim it always acts, because they move the vehicle.

        Returns
        -------
        Recording
            Reference, output with its noise, and the command after the limit, at the samples.
            The output is the one that arrives at the controller, late by a delay of the
            measurement. In a continuous loop the noise holds from each sample to the next.
            Air and trim begin to act on that output at the first sample.

        Raises
        ------
        ValueError
            If the delay of the loop is None, its samples are not those of the experiment, or
            the controller takes an ideal derivative of the noise, which does not exist. With air
            or trim, also if the controller acts on the output between the samples, as continuous
            ones do and those with an integral.

        Examples
        --------
        >>> import deadtime as dtm
        >>> loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(2.0), delay=0.36, sample_time=0.065)
        >>> dtm.Experiment.prbs(20.0, 0.4, hold=0.4).run(loop).command[:3]
        array([...])
        """
        loop = self.loop_in_run(loop)
        reference = self.reference_in_run()
        model = noise_model(noise)
        error = model.sample(self.time, seed)
        moved = disturbance_of(model, self.time, seed, loop)
        read = moved + error if noise_in_loop else moved
        if read.any():
            reference = reference - reference_shift(read, loop)
        response = loop.simulate(self.time, reference, reference_time=self.time, initial_output=0.0)
        output = response.outputs + moved + error
        return Recording(self.time, self.reference, output, response.inputs, source=self.name)
