"""Loops with a delay beside what else Python offers: time of one simulation and largest error.

Each case is run alternately by us and by a peer in one process; the times are medians. Errors are
those of the values at twenty times, against the reference solutions of the tests. Peers: scipy's
`solve_ivp` in a method of steps (restarted at every multiple of the delay, past values from its
dense output), a plain Python loop for the sampled cases, and ddeint where it is installed. Run
``python benches/peers/dde.py [--quick]``.
"""

from __future__ import annotations

import argparse
import json
import statistics
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import deadtime as dtm
import numpy as np
from scipy.integrate import solve_ivp

try:
    from ddeint import ddeint
except ImportError:
    ddeint = None

REFERENCE = Path(__file__).parents[2] / "tests" / "reference" / "dde_problems.json"
DELAY, SAMPLE_TIME = 0.36, 0.065

Values = np.ndarray[Any, np.dtype[np.float64]]


def steps(kp: float, kv: float, limit: float | None, tolerance: float) -> Callable[..., Values]:
    """Method of steps on scipy's solve_ivp: z' = sat(kp (r - z(t - Td)) - kv z'(t - Td))."""

    def run(times: Values, r: float) -> Values:
        pieces: list[tuple[float, Callable[[float], Any], Callable[[float], float]]] = []

        def past(t: float) -> tuple[float, float]:
            for start, value, slope in reversed(pieces):
                if t >= start:
                    return float(value(t)[0]), slope(t)
            return 0.0, 0.0

        def slope(t: float) -> float:
            z, dz = past(t - DELAY)
            u = kp * (r - z) - kv * dz
            return u if limit is None else min(max(u, -limit), limit)

        z, start = 0.0, 0.0
        while start < times[-1]:
            solution = solve_ivp(
                lambda t, _: [slope(t)],
                (start, start + DELAY),
                [z],
                "DOP853",
                rtol=tolerance,
                atol=tolerance,
                dense_output=True,
            )
            pieces.append((start, solution.sol, slope))
            z, start = float(solution.y[0, -1]), start + DELAY
        return np.array([past(t)[0] for t in times])

    return run


def plain_hold(kp: float) -> Callable[..., Values]:
    """Sample by sample in plain Python, exact for the integrator."""

    def run(times: Values, r: float) -> Values:
        heights, commands = [0.0], []
        for k in range(int(times[-1] / SAMPLE_TIME) + 1):
            at = k - DELAY / SAMPLE_TIME
            whole = int(np.floor(at))
            seen = 0.0
            if at > 0.0:
                seen = heights[whole] + (at - whole) * SAMPLE_TIME * commands[whole]
            commands.append(min(max(kp * (r - seen), -1.0), 1.0))
            heights.append(heights[-1] + SAMPLE_TIME * commands[-1])
        return np.interp(times, SAMPLE_TIME * np.arange(len(heights)), heights)

    return run


def scipy_hold(kp: float, delay: float) -> Callable[..., Values]:
    """Event by event with solve_ivp: one integration for each stretch of constant command."""

    def run(times: Values, r: float) -> Values:
        heights, height, commands = [], 0.0, []
        lag = int(delay / SAMPLE_TIME)
        early = delay - lag * SAMPLE_TIME
        for k in range(int(times[-1] / SAMPLE_TIME) + 1):
            heights.append(height)
            commands.append(min(max(kp * (r - height), -1.0), 1.0))
            for number, length in ((k - lag - 1, early), (k - lag, SAMPLE_TIME - early)):
                w = commands[number] if number >= 0 else 0.0
                height = float(solve_ivp(lambda t, z, w=w: [w], (0.0, length), [height]).y[0, -1])
        return np.interp(times, SAMPLE_TIME * np.arange(len(heights)), heights)

    return run


def sweeps(count: int) -> None:
    """Print the time of a trajectory in a sweep beside that of solve_ivp, on one core."""
    rng = np.random.default_rng(0)
    gains, delays = rng.uniform(0.5, 2.5, count), rng.uniform(0.1, 0.5, count)
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(1.0), sample_time=SAMPLE_TIME, limit=1.0)
    times = SAMPLE_TIME * np.arange(154)
    numbers = {"Kp": gains, "delay": delays}
    metrics = seconds(lambda: dtm.sweep(loop, numbers, times[-1], threads=1)) / count
    few = {name: array[:20] for name, array in numbers.items()}
    ours = dtm.sweep(loop, few, times, responses=True).outputs
    assert ours is not None
    peers = [scipy_hold(kp, delay) for kp, delay in zip(*few.values(), strict=True)]
    error = max(np.abs(peer(times, 1.0) - row).max() for peer, row in zip(peers, ours, strict=True))
    theirs = seconds(lambda: [peer(times, 1.0) for peer in peers]) / len(peers)
    print(
        f"sweep of {count} limited, sampled loops: {1e6 * metrics:.2f} us a trajectory with its "
        f"metrics; solve_ivp between events: {1e6 * theirs:.0f} us, {theirs / metrics:.0f} times "
        f"as much; outputs differ by {error:.0e}"
    )


def by_ddeint(kp: float, points: int) -> Callable[..., Values]:
    def run(times: Values, r: float) -> Values:
        grid = np.linspace(0.0, times[-1], points)
        found = ddeint(lambda z, t: kp * (r - z(t - DELAY)), lambda t: 0.0, grid)
        return np.interp(times, grid, np.ravel(found))

    return run


def seconds(call: Callable[[], object]) -> float:
    start = time.perf_counter()
    call()
    return time.perf_counter() - start


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="few repetitions")
    rounds = 2 if parser.parse_args().quick else 9
    problems = {p["id"]: p for p in json.loads(REFERENCE.read_text())["problems"]}

    def loop(controller: Any, **fields: Any) -> dtm.ControlLoop:
        return dtm.ControlLoop(
            dtm.Integrator(), controller, delay=DELAY, delay_path="measurement", **fields
        )

    free, limited = loop(dtm.P(1.31)), loop(dtm.P(1.31), limit=1.0)
    held = loop(dtm.P(1.31), limit=1.0, sample_time=SAMPLE_TIME)
    cases: list[tuple[str, dtm.ControlLoop, str, Callable[..., Values]]] = [
        ("drone_p_step", free, "scipy steps 1e-9", steps(1.31, 0.0, None, 1e-9)),
        ("drone_p_step", free, "scipy steps 1e-12", steps(1.31, 0.0, None, 1e-12)),
        ("drone_p_sat_continuous", limited, "scipy steps 1e-9", steps(1.31, 0.0, 1.0, 1e-9)),
        ("drone_p_sat_zoh", held, "plain Python", plain_hold(1.31)),
    ]
    if ddeint is not None:
        cases.append(("drone_p_step", free, "ddeint", by_ddeint(1.31, 1001)))

    print(f"{'problem':24}{'peer':20}{'ours us':>10}{'peer us':>12}{'ratio':>9}{'errors':>20}")
    for name, ours, peer_name, peer in cases:
        problem = problems[name]
        times = np.array([float(t) for t in problem["times"]])
        truth = np.array([float(row[0]) for row in problem["values"]])
        r = float(problem["parameters"]["r"])
        grid = np.concatenate([[0.0], times])
        # A module-level cache of the loop would flatter us: build it anew each time.
        mine: Callable[[], Values] = lambda o=ours, g=grid, r=r: o.replace().simulate(g, r).outputs  # noqa: E731
        other: Callable[[], Values] = lambda p=peer, t=times, r=r: p(t, r)  # noqa: E731
        errors = np.abs(mine()[1:] - truth).max(), np.abs(other() - truth).max()
        our_times, peer_times = [], []
        for _ in range(rounds):
            our_times.append(min(seconds(mine) for _ in range(5)))
            peer_times.append(seconds(other))
        a, b = statistics.median(our_times), statistics.median(peer_times)
        print(
            f"{name:24}{peer_name:20}{1e6 * a:10.1f}{1e6 * b:12.1f}{b / a:9.0f}"
            f"{errors[0]:11.1e}{errors[1]:9.1e}"
        )
    sweeps(10_000 if rounds == 2 else 100_000)


if __name__ == "__main__":
    main()
