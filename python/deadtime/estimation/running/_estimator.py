"""`OnlineEstimator`: the delay of a loop, row by row while it runs."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np

import deadtime.estimation.running._bank as bank
from deadtime._base.errors import DeadtimeError, NotIdentifiableError
from deadtime._base.validation import finite, non_negative, positive
from deadtime.estimation._estimate import estimate_delay
from deadtime.estimation._native import BankAnswer, OnlineBank
from deadtime.estimation._result import DelayEstimate
from deadtime.estimation.methods._output_error import OutputError
from deadtime.estimation.running._bank import OnlineEstimate
from deadtime.experiments import FlightNoise, Noise
from deadtime.loops import ControlLoop
from deadtime.recordings import Recording

#: Rows of an online estimator: time, output or None where it was lost, command or None.
Row = tuple[float, float | None, float | None]

#: First rows from which the noise is learned: from so many seconds, again after as many, and for
#: the last time after so many. Where they tell nothing, no more than these are kept.
LEARN, LAST = 10.0, 30.0

#: Fewest rows that the noise is learned from.
FEWEST = 40

#: After so many seconds in doubt, a change is one of what the plant lacks. A jump of the delay
#: itself is found sooner; a longer time reports more changes that are none.
IN_DOUBT = 2.0

#: The range of delays by default, s, and how far it goes beyond a fitted one.
RANGE, BEYOND = (0.0, 0.6), 2.0

#: Rows that count for the deviation of noise that was given by its model.
GIVEN = 200.0

#: The largest number of rows that count for that of a fit.
MOST_FITTED = 500.0

#: Lags of a layer: standard errors on either side of the fit.
AROUND = 2.0


class OnlineEstimator:
    """The delay of a loop with its interval, at every row while the loop runs.

    A Kalman filter for each delay of a range, and each lag where that is not known, holds the
    states of plant, air and trim, and the gain. Their weights are the posterior. The delay is a
    random walk, and may jump: a jump is reported. Both need information: while the command does
    not change, nothing is forgotten.

    Parameters
    ----------
    loop : ControlLoop
        What is known of the plant; controller and delay do not count.
    delays : (low, high) or (low, high, n) or array_like
        The delay is between these, s.

        Those of the filters, 50 by default. A delay outside cannot be found, but that it may be
        outside is said.
    lags : (low, high) or (low, high, n), optional
        Lags of the filters, s, in place of the first lag of the plant; 5 of them by default.
        Without: the lag of the plant is known.
    noise : float or FlightNoise, optional
        What is expected. Its scale is estimated as rows come; the ratio of its parts is not.
        Without, it is learned from the first ten seconds or more in which the command changes, by
        `deadtime.estimate_delay`; that update takes as long as the fit does.
    gain : (float, float), optional
        Mean and standard deviation of the gain before the first row. By default the gain of the
        plant and half of it.
    drift : float
        Standard deviation of the change of the delay in one second, s.

        The delay is a random walk with this parameter, s/√s.
    gain_drift : float
        The same for the gain, in parts of it.
    false_alarms_per_hour : float
        Largest number of false alarms per hour, which report a change of the delay without one.

        In the mean; zero for no search.
    memory : float
        Over how many seconds the scale of the noise is estimated again.
    width : float
        Walk and jumps have half their size where five seconds of rows tell the delay with this
        standard error, s.
    at_rest : bool
        Whether the plant is at rest before the first command. Otherwise rows count from the time
        when that has arrived at every delay.
    level : float
        Of the intervals.

    Raises
    ------
    ValueError
        If a number is out of its range, or the plant is not linear.

    Notes
    -----
    The filters are mixed as interacting multiple models; where nothing drifts the posterior is
    that of the likelihood of `deadtime.estimate_delay`. A change is reported when the likelihood
    ratio, summed over the times and new delays of a change, passes what its mean time between false
    alarms asks for.

    References
    ----------
    H. A. P. Blom and Y. Bar-Shalom, "The interacting multiple model algorithm for systems with
    Markovian switching coefficients", IEEE Transactions on Automatic Control 33 (1988).
    M. Pollak, "Optimal detection of a change in distribution", Annals of Statistics 13 (1985).

    Examples
    --------
    >>> import numpy as np
    >>> import deadtime as dtm
    >>> from deadtime.estimation import OnlineEstimator
    >>> loop = dtm.ControlLoop(
    ...     dtm.Integrator(0.85), dtm.P(1.6), delay=0.3, sample_time=0.065, limit=1.0
    ... )
    >>> flight = dtm.Experiment.prbs(20.0, 0.5, 0.8, seed=2).run(loop, noise=0.005, seed=1)
    >>> estimator = OnlineEstimator(loop, noise=0.005)
    >>> for row in zip(flight.time, flight.output, flight.command):
    ...     now = estimator.update(*row)
    >>> now.verdict, bool(now.ci[0] < 0.3 < now.ci[1])
    ('reliable', True)
    """

    def __init__(
        self,
        loop: ControlLoop,
        *,
        delays: Any = RANGE,
        lags: Any = None,
        noise: Noise | None = None,
        gain: tuple[float, float] | None = None,
        drift: float = 0.001,
        gain_drift: float = 0.0,
        false_alarms_per_hour: float = 1.0,
        memory: float = 60.0,
        width: float = 0.05,
        at_rest: bool = False,
        level: float = 0.95,
    ) -> None:
        self._loop = loop
        points = bank.points_of_range("delays", delays, bank.DELAYS)
        self._lags = None if lags is None else bank.points_of_range("lags", lags, bank.LAGS)
        model = bank.linear_plant(loop, ("delay", "gain"))
        known = loop.parameters.get("gain")
        size = abs(known) if known else 1.0
        self._settings = bank.BankSettings(
            plant=model,
            delays=points.tolist(),
            follow=bank.is_range(delays),
            layers=[
                (tau, model.zero, [0.0] * points.size) for tau in bank.lag_sets(model, self._lags)
            ],
            gain=(float(known or 1.0), 0.5 * size) if gain is None else gain,
            memory=positive("memory", memory),
            drift=non_negative("drift", drift),
            gain_walk=non_negative("gain_drift", gain_drift * size),
            width=positive("width", width),
            alarm=bank.alarm_of(false_alarms_per_hour),
            every=bank.coarser(points),
            at_rest=at_rest,
            level=level,
            freedom=GIVEN,
        )
        self._doubts: tuple[str, ...] = ()
        self._bank: OnlineBank | None = None
        self._changes: list[float] = []
        self._doubted_since = math.inf
        self._noise: FlightNoise | None = None
        self._rows: list[tuple[float, float | None]] = []
        self._commands: deque[tuple[float, float]] = deque()
        self._next_fit = math.inf
        self._reason = "the noise is being estimated"
        # The settings are checked now, not with the first row. It says what is known before one.
        self._blank = OnlineBank(self._settings)
        if noise is not None:
            self._begin(_flight_noise(noise))

    @classmethod
    def from_estimate(cls, fit: DelayEstimate, **options: Any) -> OnlineEstimator:
        """An estimator that begins with plant, gain, lags and noise of a fit.

        Parameters
        ----------
        fit : DelayEstimate
            Of an earlier recording of the same loop.
        **options
            As of the class. `delays` is by default the range from zero to twice the fitted delay,
            at least to 0.6 s; every delay of it is as probable before the first row. Where the lag
            was fitted, `lags` goes two standard errors to either side of it.

        Returns
        -------
        OnlineEstimator
        """
        noise = options.pop("noise", None)
        error = fit.stderr.get("lag", 0.0)
        if "lags" not in options and fit.lag and error > 0.0 and math.isfinite(error):
            low = max(fit.lag - AROUND * error, 0.1 * fit.lag)
            options["lags"] = (low, fit.lag + AROUND * error, bank.LAGS)
        options.setdefault("delays", (0.0, max(RANGE[1], BEYOND * fit.delay)))
        spread = fit.stderr.get("gain", 0.0)
        if fit.gain and "gain" not in options and 0.0 < spread < math.inf:
            options["gain"] = (fit.gain, 3.0 * spread)
        found = cls(fit.loop, **options)
        if found._lags is not None and error > 0.0 and fit.lag:
            prior = (-0.5 * ((found._lags - fit.lag) / error) ** 2).tolist()
            layers = [
                (lags, zero, [weight] * len(flat))
                for (lags, zero, flat), weight in zip(found._settings.layers, prior, strict=True)
            ]
            found._settings = found._settings._replace(layers=layers)
        found._begin_after(fit, "the initial fit of the estimator", noise)
        return found

    @property
    def noise(self) -> FlightNoise | None:
        """The noise that is expected; None while it is being learned."""
        return self._noise

    @property
    def delays(self) -> tuple[float, float]:
        """The range of delays, s."""
        return self._settings.delays[0], self._settings.delays[-1]

    def update(
        self, time: float, output: float | None, command: float | None = None
    ) -> OnlineEstimate:
        """Take in one row.

        Parameters
        ----------
        time : float
            When the output was measured, s; later than that of the row before.
        output : float or None
            None (or NaN) where the row was lost.
        command : float, optional
            Sent at this time, after the output was read, and after any limit; it holds until the
            next. None where none was sent, or where `command` told of it.

        Returns
        -------
        OnlineEstimate

        Raises
        ------
        ValueError
            If a number is not finite or the time does not increase.
        """
        seen = None if output is None or math.isnan(output) else output
        if self._bank is None:
            return self._learn(finite("time", time), seen, command)
        answer = self._bank.row(time, seen)
        if command is not None:
            self._bank.command(time, command)
        return self._estimate(answer)

    def command(self, time: float, value: float) -> None:
        """Tell of a command that was sent at a time of its own, s.

        Parameters
        ----------
        time : float
            When it was sent, s; later than the command before.
        value : float
            After any limit.

        Raises
        ------
        ValueError
            If a number is not finite or the time does not increase.
        """
        if self._bank is None:
            self._commands.append((finite("time", time), finite("value", value)))
        else:
            self._bank.command(time, value)

    def run(self, rows: Iterable[Row]) -> Iterator[OnlineEstimate]:
        """An estimate for each row of an iterator, as it comes.

        Parameters
        ----------
        rows : iterable of (time, output, command)
            As of `update`.

        Yields
        ------
        OnlineEstimate
        """
        for time, output, command in rows:
            yield self.update(time, output, command)

    def _estimate(self, answer: BankAnswer) -> OnlineEstimate:
        assert self._noise is not None
        if answer.changed:
            self._changes.append(answer.time)
        self._changes = [time for time in self._changes if time > answer.time - bank.MINUTE]
        found = bank.estimate_of(
            answer, self._noise.white, self.delays, self._doubts, changes=len(self._changes)
        )
        late = found.time - self._doubted_since > IN_DOUBT
        in_doubt = late or bank.is_restless(len(self._changes))
        # The kernel forgets its doubts at a change: they begin again after the next rows.
        if found.verdict == "indication":
            self._doubted_since = min(self._doubted_since, found.time)
        elif not found.changed:
            self._doubted_since = math.inf
        return replace(found, changed=found.changed and not in_doubt)

    def _begin(self, noise: FlightNoise) -> None:
        self._bank = OnlineBank(self._settings.under(noise))
        self._noise = noise

    def _begin_after(self, fit: DelayEstimate, what: str, noise: Noise | None = None) -> None:
        """Begin with the noise of a fit, or with one that was given."""
        freedom = min(MOST_FITTED, float(fit.residuals.size))
        self._settings = self._settings._replace(freedom=freedom)
        if fit.verdict != "reliable":
            self._doubts = (f"{what} was not reliable ({fit.message})",)
        fitted = FlightNoise(white=fit.rms) if fit.noise is None else fit.noise
        self._begin(fitted if noise is None else _flight_noise(noise))

    def _learn(self, time: float, output: float | None, command: float | None) -> OnlineEstimate:
        """Keep a row until the noise is known; then go over all that were kept."""
        if self._rows and time <= self._rows[-1][0]:
            raise ValueError(
                f"the time {time} s comes after {self._rows[-1][0]} s: give increasing times"
            )
        if not self._rows:
            self._next_fit = time + LEARN
        self._rows.append((time, None if output is None else finite("output", output)))
        if command is not None:
            self.command(time, command)
        if time >= self._next_fit and len(self._rows) >= FEWEST:
            self._next_fit = time + LEARN
            try:
                fit = self._fit()
            except DeadtimeError as error:
                self._reason = str(error)
                if not self._settings.at_rest:
                    self._forget(time - LAST)
            else:
                if fit.verdict == "reliable" or time - self._rows[0][0] >= LAST:
                    return self._replay(fit)
                self._reason = fit.message
        found = bank.estimate_of(self._blank.row(time), self._settings.white, self.delays)
        return replace(found, message=f"no estimate yet: {self._reason}")

    def _forget(self, time: float) -> None:
        """Forget what was before `time`, but for the command that held then."""
        self._rows = [row for row in self._rows if row[0] >= time]
        while len(self._commands) > 1 and self._commands[1][0] < time:
            self._commands.popleft()

    def _fit(self) -> DelayEstimate:
        """The batch estimate of the rows so far."""
        rows = np.array([row for row in self._rows if row[1] is not None], dtype=float)
        sent = np.array(self._commands).reshape(-1, 2)
        if not sent.size or np.ptp(sent[:, 1]) == 0.0:
            raise NotIdentifiableError("the command has not changed")
        rows = rows[rows[:, 0] >= sent[0, 0]]
        held = sent[np.searchsorted(sent[:, 0], rows[:, 0], side="right") - 1, 1]
        recording = Recording(rows[:, 0], held, rows[:, 1], sent=(sent[:, 0], sent[:, 1]))
        free = ("delay", "gain") if self._lags is None else ("delay", "gain", "lag")
        loop = self._loop.replace(delay=None)
        return estimate_delay(recording, loop, method=OutputError(rivals=False), free=free)

    def _replay(self, fit: DelayEstimate) -> OnlineEstimate:
        """Begin with the noise of a fit, and give the bank what was kept."""
        self._begin_after(fit, f"the fit of the first {LAST:.0f} s")
        assert self._bank is not None
        for time, output in self._rows:
            while self._commands and self._commands[0][0] < time:
                self._bank.command(*self._commands.popleft())
            answer = self._bank.row(time, output)
        while self._commands:
            self._bank.command(*self._commands.popleft())
        self._rows.clear()
        return self._estimate(answer)


def _flight_noise(noise: Noise) -> FlightNoise:
    if isinstance(noise, FlightNoise):
        return noise
    if isinstance(noise, (int, float)):
        return FlightNoise(white=positive("noise", noise))
    raise TypeError(f"noise must be a number or a FlightNoise, not {type(noise).__name__}")
