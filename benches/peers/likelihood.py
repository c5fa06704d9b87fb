"""Likelihood of an integrator in air beside the Kalman filter of statsmodels: time and error.

Both evaluate the likelihood of one recording for the same state space: an integrator behind an
Ornstein-Uhlenbeck process, and white noise. Ours also computes the mean and filters four columns in
the same call: output, gain, offset and the derivative by the delay. The peer filters the residuals
of one given mean. The difference is that of the log likelihoods of these residuals.
Run ``python benches/peers/likelihood.py [--quick]``.
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Callable

import numpy as np
from deadtime._deadtime import FlightFit, FlightPlant, FlightRows, PlantNumbers, RowNoise

try:
    from statsmodels.tsa.statespace.kalman_filter import KalmanFilter
except ImportError:
    KalmanFilter = None

ROW, AIR, AIR_TIME, DELAY, GAIN = 0.065, 2.0, 1.5, 0.3, 0.85


def recording(count: int, offset: bool = False) -> FlightRows:
    """An integrator that answers a square wave, with white noise."""
    rng = np.random.default_rng(3)
    moment = ROW * np.arange(count)
    command = np.where(np.sin(0.9 * moment) > 0.0, 1.0, -0.4)
    output = GAIN * ROW * np.cumsum(command) + 0.005 * rng.standard_normal(count)
    used = np.ones(count, dtype=bool)
    return FlightRows(moment, output, used, moment, command, [], offset)


def plant(free: bool) -> FlightPlant:
    """An integrator whose delay and gain are free, or known."""
    return FlightPlant([1.0], [1.0, 0.0], [], [], ["delay", "gain"] if free else [])


def peer_filter(residuals: np.ndarray) -> object:
    """The Kalman filter of statsmodels for the same process and residuals."""
    decay, rate, variance = math.exp(-ROW / AIR_TIME), 1.0 / AIR_TIME, AIR**2
    moved = -math.expm1(-rate * ROW) / rate
    own = 2.0 * variance / rate * (ROW - 2.0 * moved - 0.5 * math.expm1(-2.0 * rate * ROW) / rate)
    cross = variance * rate * moved**2
    model = KalmanFilter(k_endog=1, k_states=2)
    model.bind(residuals.copy())
    model["design"] = np.array([[1.0, 0.0]])
    model["transition"] = np.array([[1.0, moved], [0.0, decay]])
    model["selection"] = np.eye(2)
    model["state_cov"] = np.array(
        [[own, cross], [cross, -variance * math.expm1(-2.0 * rate * ROW)]]
    )
    model["obs_cov"] = np.eye(1)
    model.initialize_known(np.zeros(2), np.diag([0.0, variance]))
    return model


def seconds(call: Callable[[], object], calls: int) -> float:
    start = time.perf_counter()
    for _ in range(calls):
        call()
    return (time.perf_counter() - start) / calls


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="a moment's run, rough numbers")
    rounds = 2 if parser.parse_args().quick else 10
    if KalmanFilter is None:
        print("statsmodels is not installed: pip install statsmodels")
    numbers = PlantNumbers(DELAY, [], [RowNoise(AIR_TIME, AIR)], GAIN)
    print(f"{'rows':>8s}{'peer us':>12s}{'ours us':>12s}{'ratio':>8s}{'difference':>12s}")
    for count in (120, 300, 10_000):
        rows = recording(count)
        known = FlightFit(plant(False), [rows], False, numbers)
        free = plant(True), [recording(count, offset=True)], False, numbers
        calls = max(1, 30_000 // count)
        ours = min(
            seconds(lambda one=free: FlightFit(*one).criterion, calls) for _ in range(rounds)
        )
        if KalmanFilter is None:
            print(f"{count:8d}{'':12s}{1e6 * ours:12.1f}")
            continue
        part = known.parts[0]
        peer = peer_filter(part.residuals)
        theirs = min(seconds(peer.loglike, max(1, calls // 10)) for _ in range(rounds))
        squares = part.variance * part.freedom
        expected = -0.5 * (count * math.log(2.0 * math.pi) + part.log_det + squares)
        difference = abs(float(peer.loglike()) / expected - 1.0)
        ratio = theirs / ours
        print(f"{count:8d}{1e6 * theirs:12.1f}{1e6 * ours:12.1f}{ratio:8.1f}{difference:12.1e}")


if __name__ == "__main__":
    main()
