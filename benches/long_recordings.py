"""Time and memory of estimates of short and long recordings, each with all its intervals.

Run ``python benches/long_recordings.py [ROWS ...]``; 300 and 1 000 000 rows by default. Each is a
process of its own, whose peak of memory is printed, beside the time in which the memory of the
machine could be read for the columns of one recording, once.
"""

from __future__ import annotations

import resource
import subprocess
import sys
import time

import deadtime as dtm
import numpy as np

FREES = (("delay", "gain"), ("delay", "gain", "lag"))
REPETITIONS = 5


def recorded(rows: int, lag: float) -> tuple[dtm.Recording, dtm.ControlLoop]:
    """Steps of the reference every 5 s, with noise in the loop."""
    random = np.random.default_rng(1)
    sample = 0.01 if rows > 10_000 else 0.065
    loop = dtm.ControlLoop(
        dtm.Integrator(0.85, lag), dtm.P(1.6), delay=0.3, sample_time=sample, limit=1.0
    )
    times = np.arange(rows) * sample
    each = max(1, round(5.0 / sample))
    reference = np.repeat(random.choice([0.0, 1.0], rows // each + 1), each)[:rows]
    noise = random.normal(0.0, 0.005, rows)
    run = loop.simulate(times, reference - noise, reference_time=times, initial_output=0.0)
    return dtm.Recording(times, reference, run.outputs + noise, run.inputs), loop


def measure(rows: int) -> None:
    """Print a row of the table for each set of free parameters."""
    for free in FREES:
        recording, loop = recorded(rows, 0.1 if "lag" in free else 0.0)
        spent = []
        for _ in range(REPETITIONS if rows <= 10_000 else 1):
            begin = time.process_time()
            fit = dtm.estimate_delay(recording, loop.replace(delay=None), free=free)
            for name in fit.stderr:
                fit.ci(0.95, name)
            spent.append(time.process_time() - begin)
        columns = np.ones((4, rows))
        columns.sum()
        begin = time.perf_counter()
        columns.sum()
        read = time.perf_counter() - begin
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        print(
            f"| {rows} | {', '.join(free)} | {1e3 * min(spent):.0f} ms | {peak:.0f} MiB "
            f"| {1e3 * read:.3g} ms | {fit.delay:.5f} ± {fit.stderr['delay']:.5f} |",
            flush=True,
        )


def main() -> None:
    sizes = [int(size) for size in sys.argv[1:]] or [300, 1_000_000]
    if len(sizes) == 1:
        measure(sizes[0])
        return
    print("| rows | free | CPU time | peak | columns read once | delay, s |")
    print("|---:|---|---:|---:|---:|---:|", flush=True)
    for size in sizes:
        subprocess.run([sys.executable, __file__, str(size)], check=True)


if __name__ == "__main__":
    main()
