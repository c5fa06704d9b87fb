"""Recordings of the estimation benchmark: one step of an integrator with sensor noise."""

import deadtime as dtm
import numpy as np

TS = 0.065


def record_step(
    delay=0.36,
    gain=1.0,
    lag=0.0,
    Kp=1.31,
    noise=0.0,
    seed=0,
    ts=TS,
    dt=None,
    limit=1.0,
    duration=5.0,
    rest=0.5,
    size=1.0,
    noise_in_loop=True,
):
    """Simulate a recording of a step with its command; return it and its loop without the delay."""
    loop = dtm.ControlLoop(
        dtm.Integrator(gain, lag), dtm.P(Kp), delay=delay, sample_time=ts, limit=limit
    )
    step = dt or ts
    time = np.arange(round((duration + rest) / step)) * step
    reference = np.where(time < rest - 1e-9, 0.0, size)
    error = np.random.default_rng(seed).normal(0.0, noise, time.size) if noise else 0.0 * time
    seen = reference - error if noise_in_loop else reference
    run = loop.simulate(time, seen, reference_time=time, initial_output=0.0, reference_before=0.0)
    known = loop.replace(delay=None, lag=0.0)
    return dtm.Recording(time, reference, run.outputs + error, run.inputs), known


def replace_signals(recording, **signals):
    """Return the recording with some of its signals replaced."""
    parts = {name: getattr(recording, name) for name in ("time", "reference", "output", "command")}
    return dtm.Recording(**parts | signals)


def noise_for_output(recording, seed=0):
    """Return the recording with its output replaced by white noise."""
    random = np.random.default_rng(seed)
    return replace_signals(recording, output=random.normal(size=len(recording)))


#: The rows of the benchmark: the parameters of each recording.
CASES = {
    "continuous, Kp 1.31": {"ts": None, "dt": 0.01, "limit": None, "noise": 0.01},
    "continuous, Kp 3": {"ts": None, "dt": 0.01, "limit": None, "noise": 0.01, "Kp": 3.0},
    "continuous, limit, 65 ms, 0.3 %": {"ts": None, "dt": TS, "noise": 0.003},
    "0.3 %": {"noise": 0.003},
    "1 %": {"noise": 0.01},
    "3 %": {"noise": 0.03},
    "1 %, Kp 3": {"noise": 0.01, "Kp": 3.0},
    "1 %, Kp 3, no limit": {"noise": 0.01, "Kp": 3.0, "limit": None},
    "1 %, Kp 0.8": {"noise": 0.01, "Kp": 0.8},
    "10 ms, Kp 4, Td 0.05": {"noise": 0.01, "Kp": 4.0, "ts": 0.01, "delay": 0.05},
}


def delay_errors(case, runs, method, **options):
    """Errors of the delay, ms, over recordings with different noise, and the estimates."""
    what = CASES[case]
    noise_in_loop = what.get("ts", TS) is not None
    found, errors = [], []
    for seed in range(runs):
        recording, known = record_step(
            seed=seed, rest=options.get("rest", 0.0), noise_in_loop=noise_in_loop, **what
        )
        keywords = {name: value for name, value in options.items() if name == "free"}
        fit = dtm.estimate_delay(recording, known, method=method, **{"free": ("delay",)} | keywords)
        found.append(fit)
        errors.append(1e3 * (fit.delay - what.get("delay", 0.36)))
    return np.array(errors), found


def root_mean_square(errors):
    return float(np.sqrt(np.mean(np.square(errors))))
