"""Delay equations: time at equal true error, ours beside other solvers in Python.

Every solver is run once with each of several settings, and compared with references on which two
unrelated methods agree (`tests/reference`). For 1e-6 and for 1e-9, the fastest setting whose true
error is smaller is timed, ours and the peer's in turn. Compilation (JiTCDDE, numba) is not
included. Single calls of one loop follow, and a sparse network of 2000 components beside its
right-hand side alone; the last lines are sweeps: CPU time of a set. All times are CPU times. Run
``python benches/peers/dde.py [--quick]``.
"""

from __future__ import annotations

import argparse
import json
import statistics
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import deadtime as dtm
import numpy as np
from drivers import by_hand, dde as peers
from drivers.dde import Run, Values
from scipy.sparse import random_array

try:
    from numba import carray, cfunc, types
except ImportError:
    cfunc = None

REFERENCE = Path(__file__).parents[2] / "tests" / "reference"
DELAY, SAMPLE_TIME = 0.36, 0.065
TARGETS = (1e-6, 1e-9)
#: A run of so many seconds is timed once, and shorter ones are repeated to fill the second time.
LONG, ENOUGH = 1.0, 5e-3
#: Microseconds of the same numbers in C with AVX-512, with the call from Python.
LIMITS = {"P loop, 10 s": 0.6, "Mackey-Glass, t = 1000": 8.6}


@dataclass
class Problem:
    """One problem: the times at which the solution is known, the solvers and their settings."""

    name: str
    times: Values
    truth: Values
    ours: dict[str, list[Run]]
    peers: dict[str, list[Run]] = field(default_factory=dict)


def ladder(low: int, high: int) -> list[float]:
    """Tolerances from 10^-low to 10^-high in half decades."""
    return [10.0 ** (-0.5 * k) for k in range(2 * low, 2 * high + 1)]


def known(file: str, name: str) -> tuple[Values, Values, dict[str, Any]]:
    content = json.loads((REFERENCE / file).read_text())
    entries = content["problems" if "problems" in content else "runs"]
    entry = next(e for e in entries if e["id"] == name)
    times = np.array([float(t) for t in entry["times"]])
    return times, np.array([[float(x) for x in row] for row in entry["values"]]), entry


def loops() -> Iterable[Problem]:
    def simulated(times: Values, controller: Any, **fields: Any) -> Run:
        # The loop is constructed before the timing starts, as the peers' equations are.
        loop = dtm.ControlLoop(
            dtm.Integrator(), controller, delay=DELAY, delay_path="measurement", **fields
        )

        # The run starts at the first of its times.
        grid = np.append(0.0, times)

        def simulate(times: Values) -> Values:
            return loop.simulate(grid).outputs[1:, None]

        return simulate

    start = np.zeros(1)
    times, truth, _ = known("dde_problems.json", "drone_p_step")
    problem = Problem("P loop, 10 s", times, truth, {"exact": [simulated(times, dtm.P(1.31))]})
    fun = lambda t, y, z: 1.31 * (1.0 - z)  # noqa: E731
    vectorised = lambda t, y, z: 1.31 * (1.0 - z[0])  # noqa: E731
    problem.ours["solve_dde"] = solve(vectorised, 0.0, DELAY, ladder(5, 11))
    problem.peers["scipy steps"] = [
        peers.scipy_steps(fun, start, DELAY, tol) for tol in ladder(5, 11)
    ]
    if peers.ddeint is not None:
        problem.peers["ddeint"] = [peers.by_ddeint(fun, start, DELAY, n) for n in (301, 1001, 3001)]
    if by_hand.njit is not None:
        by_numba = lambda y, z: 1.31 * (1.0 - z)  # noqa: E731
        problem.peers["numba RK4"] = [
            by_hand.rk4(by_numba, 0.0, DELAY, n) for n in (6, 9, 12, 18, 24, 36)
        ]
    if peers.jitcdde is not None:
        y, t = peers.jitcdde.y, peers.jitcdde.t
        compiled = peers.Jitcdde([1.31 * (1 - y(0, t - DELAY))], start, DELAY)
        problem.peers["JiTCDDE"] = [compiled.run(tol, 6) for tol in ladder(5, 12)]
    yield problem

    times, truth, _ = known("dde_problems.json", "drone_pv_neutral")
    problem = Problem(
        "neutral PV, 10 s", times, truth, {"exact": [simulated(times, dtm.PV(2.0, 0.3))]}
    )
    if peers.jitcdde is not None:
        y, t, dy = peers.jitcdde.y, peers.jitcdde.t, peers.jitcdde.dy
        equation = 2.0 * (1 - y(0, t - DELAY)) - 0.3 * dy(0, t - DELAY)
        compiled = peers.Jitcdde([equation], start, DELAY)
        problem.peers["JiTCDDE"] = [compiled.run(tol, 27) for tol in ladder(5, 12)]
    yield problem

    times, truth, _ = known("dde_problems.json", "drone_p_sat_zoh")
    held = simulated(times, dtm.P(1.31), limit=1.0, sample_time=SAMPLE_TIME)
    problem = Problem("hold + limit, 10 s", times, truth, {"exact": [held]})
    problem.peers["scipy a sample"] = [peers.scipy_samples(1.31, DELAY, SAMPLE_TIME, 1.0)]
    yield problem


def solve(
    fun: Any, history: Any, delay: float, tolerances: list[float], vectorized: bool = True
) -> list[Run]:
    """`solve_dde` for several tolerances; `fun` takes all nodes at once, or is compiled."""

    def at(tolerance: float) -> Run:
        def simulate(times: Values) -> Values:
            found = dtm.solve_dde(
                fun,
                (0.0, float(times[-1])),
                history,
                [delay],
                rtol=tolerance,
                atol=tolerance,
                t_eval=times,
                vectorized=vectorized,
            )
            return found.y.T

        return simulate

    return [at(tolerance) for tolerance in tolerances]


def mackey_glass() -> Problem:
    times, truth, _ = known("dde_long_runs.json", "mackey_glass_17")
    fun = lambda t, y, z: 0.2 * z / (1.0 + z**10) - 0.1 * y  # noqa: E731
    vectorised = lambda t, y, z: 0.2 * z[0] / (1.0 + z[0] ** 10) - 0.1 * y  # noqa: E731
    problem = Problem("Mackey-Glass, t = 1000", times, truth, {})
    problem.ours["numpy"] = solve(vectorised, 0.5, 17.0, ladder(7, 12))
    if cfunc is not None:
        pointer = types.CPointer(types.float64)
        signature = types.void(types.float64, pointer, pointer, pointer, pointer, types.voidptr)

        @cfunc(signature)
        def compiled_slope(t, y, z, dz, dy, user):  # type: ignore[no-untyped-def]
            late = carray(z, 1)[0]
            square = late * late
            fourth = square * square
            out = carray(dy, 1)
            out[0] = 0.2 * late / (1.0 + fourth * fourth * square) - 0.1 * carray(y, 1)[0]

        problem.ours["compiled"] = solve(compiled_slope, 0.5, 17.0, ladder(7, 12), vectorized=False)
    if by_hand.njit is not None:

        def source(z: float) -> float:
            square = z * z
            fourth = square * square
            return 0.2 * z / (1.0 + fourth * fourth * square)

        production = by_hand.njit(source)
        slope = lambda y, z: production(z) - 0.1 * y  # noqa: E731
        problem.peers["numba RK4"] = [
            by_hand.rk4(slope, 0.5, 17.0, 17 * n) for n in (6, 10, 16, 20, 25, 30, 40)
        ]
        problem.peers["numba spectral"] = [
            by_hand.spectral(source, 0.1, 0.5, 17.0, n) for n in (24, 32, 40, 44, 48, 56)
        ]
    start = np.array([0.5])
    problem.peers["scipy steps"] = [
        peers.scipy_steps(fun, start, 17.0, tol) for tol in ladder(7, 11)
    ]
    if peers.ddeint is not None:
        problem.peers["ddeint"] = [peers.by_ddeint(fun, start, 17.0, 10001)]
    if peers.jitcdde is not None:
        y, t = peers.jitcdde.y, peers.jitcdde.t
        late = y(0, t - 17)
        compiled = peers.Jitcdde([0.2 * late / (1 + late**10) - 0.1 * y(0)], start, 17.0)
        problem.peers["JiTCDDE"] = [compiled.run(tol, 8) for tol in ladder(7, 14)]
    return problem


def network() -> Problem:
    times, truth, _ = known("dde_long_runs.json", "network50_long")
    data = known("dde_problems.json", "network50")[2]["parameters"]
    weights = np.zeros((50, 50))
    for i, (sources, row) in enumerate(zip(data["idx"], data["W"], strict=True)):
        for j, weight in zip(sources, row, strict=True):
            weights[i, j] += float(weight)
    start = np.array([float(x) for x in data["y0"]])
    fun = lambda t, y, z: np.tanh(weights @ z) - y  # noqa: E731
    vectorised = lambda t, y, z: np.tanh(weights @ z[0]) - y  # noqa: E731
    problem = Problem("network of 50, t = 50", times, truth, {})
    problem.ours["numpy"] = solve(vectorised, start, 1.0, ladder(5, 11))
    problem.peers["scipy steps"] = [
        peers.scipy_steps(fun, start, 1.0, tol) for tol in ladder(5, 10)
    ]
    if peers.jitcdde is not None:
        from symengine import tanh

        y, t = peers.jitcdde.y, peers.jitcdde.t
        equations = [
            tanh(sum(float(w) * y(j, t - 1) for j, w in zip(sources, row, strict=True))) - y(i)
            for i, (sources, row) in enumerate(zip(data["idx"], data["W"], strict=True))
        ]
        compiled = peers.Jitcdde(equations, start, 1.0)
        problem.peers["JiTCDDE"] = [compiled.run(tol, 8) for tol in ladder(6, 12)]
    return problem


def seconds(call: Callable[..., object], *arguments: Any) -> float:
    """CPU time of a call, the mean of as many as fill `ENOUGH`."""
    count = 1
    while True:
        start = time.process_time()
        for _ in range(count):
            call(*arguments)
        took = time.process_time() - start
        if took >= ENOUGH:
            return took / count
        count *= 4


def tried(problem: Problem, runs: list[Run]) -> list[tuple[float, float, Run]]:
    """(seconds, true error, run) of every setting, coarse to fine, until the finest target is met.

    Once warm, unless the run is so long that warmth is no matter.
    """
    found = []
    for run in runs:
        start = time.process_time()
        value = run(problem.times)
        took = time.process_time() - start
        error = float(np.abs(value - problem.truth).max())
        found.append((took if took > LONG else seconds(run, problem.times), error, run))
        if error <= min(TARGETS):
            break
    return found


def compare(problem: Problem, rounds: int) -> None:
    """Print one line for each target, each of our methods and each peer."""
    ours = {name: tried(problem, runs) for name, runs in problem.ours.items()}
    others = {name: tried(problem, runs) for name, runs in problem.peers.items()}
    for target in TARGETS:
        for name, mine in ours.items():
            best = min((t for t in mine if t[1] <= target), default=None, key=lambda t: t[0])
            if best is None:
                print(f"{problem.name:24}{target:7.0e}  ours ({name}): not reached")
                continue
            for peer, theirs in others.items():
                row = f"{problem.name:24}{target:7.0e}  {name:10}{peer:16}"
                reached = [t for t in theirs if t[1] <= target]
                if not reached:
                    closest = min(t[1] for t in theirs)
                    print(f"{row}{1e6 * best[0]:12.1f}   not reached (at best {closest:.0e})")
                    continue
                other = min(reached, key=lambda t: t[0])
                a, b = [], []
                for _ in range(rounds if other[0] <= LONG else 1):
                    a.append(seconds(best[2], problem.times))
                    b.append(seconds(other[2], problem.times))
                mine_s, other_s = min(a), min(b)
                limit = LIMITS.get(problem.name)
                print(
                    f"{row}{1e6 * mine_s:12.1f}{1e6 * other_s:14.1f}{other_s / mine_s:10.2f}"
                    f"{best[1]:10.0e}{other[1]:9.0e}"
                    + ("" if limit is None else f"  {1e6 * mine_s / limit:.1f} x C")
                )


#: Microseconds of a set in C with AVX-512: the sampled P loop alone, and behind a lag, the
#: overshoot of which is then equal to 4e-5 %.
CEILINGS = {"P": 0.138, "P, lag": 0.158}


def swept() -> dict[str, tuple[dtm.ControlLoop, tuple[float, float]]]:
    """Loops of up to four states, with a hold and a limit or continuous, and gains for them."""
    held = {"delay": DELAY, "limit": 1.0, "sample_time": SAMPLE_TIME}
    smooth = dtm.DerivativeFilter(38.0)
    lagging = dtm.Integrator(1.0, 0.2)
    first, second = dtm.FirstOrder(2.0, 0.5), dtm.FactoredPlant([0.2, 0.1])
    return {
        "P": (dtm.ControlLoop(dtm.Integrator(), dtm.P(1.3), **held), (0.5, 2.0)),
        "PI": (dtm.ControlLoop(dtm.Integrator(), dtm.PI(1.3, 0.1), **held), (0.5, 2.0)),
        "filtered PV": (
            dtm.ControlLoop(dtm.Integrator(), dtm.PV(1.3, 0.2, smooth), **held),
            (0.5, 2.0),
        ),
        "P, lag": (dtm.ControlLoop(lagging, dtm.P(1.3), **held), (0.5, 2.0)),
        "PI, first order": (dtm.ControlLoop(first, dtm.PI(0.3, 0.2), **held), (0.1, 0.6)),
        "PI, two lags": (dtm.ControlLoop(second, dtm.PI(0.3, 1.0), **held), (0.1, 0.6)),
        "filtered PV, lag": (
            dtm.ControlLoop(lagging, dtm.PV(1.3, 0.2, smooth), **held),
            (0.5, 2.0),
        ),
        "continuous P": (dtm.ControlLoop(dtm.Integrator(), dtm.P(1.3), delay=DELAY), (0.5, 2.0)),
        "continuous PI": (
            dtm.ControlLoop(dtm.Integrator(), dtm.PI(1.3, 0.1), delay=DELAY),
            (0.5, 2.0),
        ),
        "continuous P, lag": (dtm.ControlLoop(lagging, dtm.P(1.3), delay=DELAY), (0.5, 2.0)),
        "continuous P, limit": (
            dtm.ControlLoop(dtm.Integrator(), dtm.P(1.3), delay=DELAY, limit=1.0),
            (0.5, 2.0),
        ),
    }


def numba_sweep() -> Callable[[Values, Values], Values] | None:
    """The P loop with hold and limit as a user would write it for numba: peak, settling, rise."""
    try:
        from numba import njit
    except ImportError:
        return None

    @njit(cache=False)
    def swept(gains: Values, delays: Values) -> Values:
        found = np.empty((gains.size, 3))
        steps = int(np.ceil(10.0 / SAMPLE_TIME))
        for i in range(gains.size):
            whole = int(delays[i] / SAMPLE_TIME)
            early = delays[i] - whole * SAMPLE_TIME
            commands = np.zeros(whole + 2)
            y, peak, settled, risen = 0.0, 0.0, 0.0, -1.0
            for k in range(steps):
                u = min(max(gains[i] * (1.0 - y), -1.0), 1.0)
                commands[k % (whole + 2)] = u
                for part in range(2):
                    length = early if part == 0 else SAMPLE_TIME - early
                    y += commands[(k + 1 + part) % (whole + 2)] * length
                    time = k * SAMPLE_TIME + (early if part == 0 else SAMPLE_TIME)
                    peak = max(peak, y)
                    if risen < 0.0 and y >= 0.9:
                        risen = time
                    if abs(y - 1.0) > 0.02:
                        settled = time
            found[i] = peak, settled, risen
        return found

    return swept


def sweeps(sets: int, rounds: int) -> None:
    """Step metrics of many sets, their gain and delay varied: CPU time a set in one thread."""

    def cpu(call: Callable[[], object]) -> float:
        times = []
        for _ in range(rounds):
            start = time.process_time()
            call()
            times.append(time.process_time() - start)
        return min(times)

    delays = np.linspace(0.2, 0.4, sets)
    times = np.linspace(0.0, 10.0, 11)
    one = peers.scipy_samples(1.31, DELAY, SAMPLE_TIME, 1.0)
    other = statistics.median(seconds(one, times) for _ in range(rounds))
    by_numba = numba_sweep()
    for name, (loop, bounds) in swept().items():
        count = sets if loop.is_sampled else max(sets // 10, 1)
        varied = {"Kp": np.linspace(*bounds, count), "delay": delays[:: sets // count][:count]}
        mine = cpu(lambda loop=loop, varied=varied: dtm.sweep(loop, varied, 10.0, threads=1))
        line = f"sweep of {count} sets, {name}: {1e6 * mine / count:.3f} us a set"
        if name in CEILINGS:
            ceiling = CEILINGS[name]
            line += f"; C {ceiling:.3f} us: ratio {1e6 * mine / count / ceiling:.1f}"
        if name == "P":
            if by_numba is not None:
                by_numba(*varied.values())
                loops = cpu(lambda varied=varied: by_numba(*varied.values()))
                line += f"; numba {1e6 * loops / count:.3f} us: ratio {loops / mine:.1f}"
            line += f"; scipy a sample {1e6 * other:.0f} us: ratio {other / mine * count:.0f}"
        print(line)


def single_calls(rounds: int) -> None:
    """The P loop at 101 times: one call, one of a loop made anew, and a loop written by hand."""
    times = np.linspace(0.0, 10.0, 101)
    parts = (dtm.Integrator(), dtm.P(1.31))
    loop = dtm.ControlLoop(*parts, delay=DELAY)

    def anew() -> Values:
        made = dtm.ControlLoop(dtm.Integrator(), dtm.P(1.31), delay=DELAY)
        return made.simulate(times).outputs

    calls = {
        "one call, outputs read": lambda: loop.simulate(times).outputs,
        "with commands, breaks and reference": lambda: vars_of(loop.simulate(times)),
        "with the loop made anew": anew,
    }
    if by_hand.njit is not None:
        by_numba = by_hand.rk4(lambda y, z: 1.31 * (1.0 - z), 0.0, DELAY, 18)
        calls["numba RK4, 18 steps a delay"] = lambda: by_numba(times)
    best = dict.fromkeys(calls, np.inf)
    for _ in range(rounds):
        for name, call in calls.items():
            best[name] = min(best[name], seconds(call))
    limit = LIMITS["P loop, 10 s"]
    for name, took in best.items():
        print(f"P loop, 101 times, {name}: {1e6 * took:.2f} us, {1e6 * took / limit:.1f} x C")


def vars_of(found: dtm.Response) -> tuple[Values, ...]:
    """All that a response of a loop holds."""
    return found.outputs, found.inputs, found.breaks, found.reference


def sparse_network(components: int, rounds: int) -> None:
    """A network with five inputs each: CPU time beside that of its right-hand side alone."""
    rng = np.random.default_rng(1)
    weights = random_array((components, components), density=5 / components, rng=rng, format="csr")
    weights.data = 0.6 * rng.normal(size=weights.nnz)
    start = rng.normal(size=components)
    alone = 0.0

    def slope(t: Values, y: Values, z: Values) -> Values:
        nonlocal alone
        before = time.process_time()
        found = np.tanh(weights @ z[0]) - y
        alone += time.process_time() - before
        return found

    for tolerance in TARGETS:
        best = (np.inf, np.inf)
        for _ in range(rounds):
            alone, before = 0.0, time.process_time()
            found = dtm.solve_dde(
                slope,
                (0.0, 10.0),
                start,
                [1.0],
                rtol=tolerance,
                atol=tolerance,
                t_eval=[10.0],
                vectorized=True,
            )
            best = min(best, (time.process_time() - before, alone))
        print(
            f"network of {components}, t = 10, {tolerance:.0e}: {1e3 * best[0]:.1f} ms of CPU time "
            f"in {found.nfev} calls, which alone take {1e3 * best[1]:.1f} ms: "
            f"ratio {best[0] / best[1]:.1f}"
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="few settings and repetitions")
    quick = parser.parse_args().quick
    print(
        f"{'problem':24}{'error':>7}  {'ours':10}{'peer':16}{'ours us':>12}{'peer us':>14}"
        f"{'ratio':>10}{'true errors':>19}"
    )
    problems = [*loops(), mackey_glass(), network()]
    for problem in problems:
        if quick:
            for runs in (*problem.ours.values(), *problem.peers.values()):
                runs[:] = runs[-3:-2] or runs[:1]
        compare(problem, 1 if quick else 7)
    single_calls(2 if quick else 20)
    sparse_network(2000, 2 if quick else 8)
    sweeps(1000 if quick else 100_000, 1 if quick else 3)


if __name__ == "__main__":
    main()
