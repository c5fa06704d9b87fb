"""The integrator controlled over the Internet (section 2.1, Figure 1), in virtual time.

One computer holds the integrator z' = w, the other the controller. Every `sample_time` the first
sends its output; the answer K (r - z) arrives one round trip later and holds until a newer one
arrives. Round trips are constant or drawn from a gamma distribution; overtaken and lost answers are
dropped. Between arrivals z is linear, so the run is exact. With a constant round trip it is the
sampled `ControlLoop`, to rounding.
"""

from __future__ import annotations

import heapq
import math

import numpy as np

import deadtime as dtm
from deadtime._base.validation import non_negative, positive

#: Rest before the step, s, from which the estimators read the initial output.
REST = 1.0


def internet_loop(
    gain: float,
    delay: float = 0.1,
    *,
    sample_time: float = 0.01,
    jitter: float = 0.0,
    loss: float = 0.0,
    seed: int = 0,
    duration: float = 5.0,
) -> dtm.Recording:
    """Run the integrator over an Internet loop and log a step of its reference at time 0.

    Parameters
    ----------
    gain : float
        K of the controller, 1/s.
    delay : float
        Mean round trip, s.
    sample_time : float
        Time between two packets, s.
    jitter : float
        Standard deviation of the round trip, s; 0 for a constant one.
    loss : float
        Part of the answers that never arrive, from 0 to less than 1.
    seed : int
        Of round trips and losses.
    duration : float
        Duration of the log, s.

    Returns
    -------
    Recording
        Output and command at the samples, from a second before the step on.

    Raises
    ------
    ValueError
        If a number is out of its range.

    Examples
    --------
    The delay from the overshoot, as in Table 1, without and with the hold in the model:

    >>> import deadtime as dtm
    >>> from deadtime import paper
    >>> from deadtime.estimation import Overshoot
    >>> trial = paper.internet_loop(8.0, delay=0.1, sample_time=0.02)
    >>> loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(Kp=8.0), sample_time=0.02)
    >>> for name in ("dominant", "saturated"):
    ...     print(round(dtm.estimate_delay(trial, loop, method=Overshoot(map=name)).delay, 4))
    0.1128
    0.1
    """
    for name, value in {"gain": gain, "delay": delay, "jitter": jitter, "loss": loss}.items():
        non_negative(name, value)
    for name, value in {"sample_time": sample_time, "duration": duration}.items():
        positive(name, value)
    if loss >= 1.0:
        raise ValueError(f"loss={loss}: give a share below 1, because some answers have to arrive")
    before, after = math.ceil(REST / sample_time), math.ceil(duration / sample_time)
    time = sample_time * np.arange(-before, after + 1)
    reference = np.where(time >= 0.0, 1.0, 0.0)
    trips = _round_trips(time.size, delay, jitter, loss, seed)
    output, command = np.zeros(time.size), np.zeros(time.size)
    # Answers in transit: arrival, number of the answered packet, command.
    in_transit: list[tuple[float, int, float]] = []
    state, held, latest, clock = 0.0, 0.0, -1, float(time[0])
    for packet, now in enumerate(time.tolist()):
        while in_transit and in_transit[0][0] <= now:
            arrival, number, answer = heapq.heappop(in_transit)
            state += held * (arrival - clock)
            clock = arrival
            if number > latest:
                latest, held = number, answer
        state += held * (now - clock)
        clock = now
        output[packet] = state
        command[packet] = gain * (reference[packet] - state)
        if math.isfinite(trips[packet]):
            heapq.heappush(in_transit, (now + trips[packet], packet, float(command[packet])))
    return dtm.Recording(
        time, reference, output, command, source=f"the Internet loop with K = {gain:g}"
    )


def _round_trips(count: int, delay: float, jitter: float, loss: float, seed: int) -> list[float]:
    """Round trip of each packet in s; infinite where it is lost."""
    random = np.random.default_rng(seed)
    if jitter == 0.0 or delay == 0.0:
        trips = np.full(count, delay)
    else:
        shape = (delay / jitter) ** 2
        trips = random.gamma(shape, delay / shape, count)
    lost = random.random(count) < loss
    return [math.inf if gone else float(trip) for gone, trip in zip(lost, trips, strict=True)]
