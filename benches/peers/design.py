"""`deadtime.design` for velocity feedback: CPU time and calls of whole designs.

It is not compared with a peer. Run ``OPENBLAS_NUM_THREADS=1 python benches/peers/design.py
[--quick]``: threads of OpenBLAS wait for one another with the processor busy, which would count.
"""

from __future__ import annotations

import argparse
import cProfile
import pstats
import time
from collections.abc import Callable
from typing import Any

import deadtime as dtm

LOOP = dtm.ControlLoop(dtm.Integrator(), dtm.PV(1.0, 0.1), delay=0.36, sample_time=0.065)
SMOOTH = dtm.PV(1.0, 0.1, dtm.DerivativeFilter(38.0))
LATE = (0.3, 0.4)

#: Loop and further arguments of each design.
DESIGNS: dict[str, tuple[dtm.ControlLoop, dict[str, Any]]] = {
    "load": (LOOP, {"objective": "load"}),
    "load, continuous": (LOOP.continuous(), {"objective": "load"}),
    "load, over an interval": (LOOP, {"objective": "load", "delay": LATE, "gain": (0.8, 1.2)}),
    "sampled": (LOOP, {}),
    "continuous": (LOOP.continuous(), {}),
    "over an interval of delays": (LOOP, {"delay": LATE}),
    "with margins": (LOOP, {"delay": LATE, "gain_margin": 2.0, "phase_margin": 45.0}),
    "continuous, with margins": (
        LOOP.continuous(),
        {"controller": SMOOTH, "delay": LATE, "gain_margin": 4.0},
    ),
    "damping": (LOOP.continuous(), {"objective": "damping", "delay": LATE, "gain_margin": 2.0}),
    "settling time": (LOOP, {"objective": "settling_time", "delay": LATE}),
}


def counted(run: Callable[[], object]) -> tuple[int, int]:
    """Calls of functions of Python, and of the native part."""
    profile = cProfile.Profile()
    profile.runcall(run)
    python = native = 0
    for (file, _, name), (_, calls, *_) in pstats.Stats(profile).stats.items():  # type: ignore[attr-defined]
        python += calls if file != "~" else 0
        native += calls if file == "~" and "deadtime._deadtime" in name else 0
    return python, native


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="one call each")
    calls = 1 if parser.parse_args().quick else 6
    print(f"{'PV around an integrator':28}{'CPU ms':>8}{'Python':>9}{'native':>8}  gains")
    for name, (loop, given) in DESIGNS.items():
        options = {"controller": dtm.PV, "objective": "abscissa", **given}
        least = float("inf")
        for _ in range(calls):
            begin = time.process_time()
            found = dtm.design(loop, **options)
            least = min(least, time.process_time() - begin)
        python, native = counted(lambda loop=loop, options=options: dtm.design(loop, **options))
        gains = ", ".join(f"{key} {value:.5g}" for key, value in found.gains.items())
        print(f"{name:28}{1e3 * least:8.0f}{python:9}{native:8}  {gains}", flush=True)


if __name__ == "__main__":
    main()
