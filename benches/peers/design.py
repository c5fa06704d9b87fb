"""`deadtime.design` for velocity feedback: CPU time of whole calls.

It is not compared with a peer. Run ``OPENBLAS_NUM_THREADS=1 python benches/peers/design.py
[--quick]``: threads of OpenBLAS wait for one another with the processor busy, which would count.
"""

from __future__ import annotations

import argparse
import time

import deadtime as dtm


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="one call each")
    calls = 1 if parser.parse_args().quick else 6
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.PV(1.0, 0.1), delay=0.36, sample_time=0.065)
    print(f"{'PV around an integrator':28}{'CPU ms':>8}  gains")
    for name, one, delay in (
        ("sampled", loop, None),
        ("continuous", loop.continuous(), None),
        ("over an interval of delays", loop, (0.3, 0.4)),
    ):
        least = float("inf")
        for _ in range(calls):
            begin = time.process_time()
            found = dtm.design(one, controller=dtm.PV, delay=delay)
            least = min(least, time.process_time() - begin)
        gains = ", ".join(f"{key} {value:.5g}" for key, value in found.gains.items())
        print(f"{name:28}{1e3 * least:8.0f}  {gains}", flush=True)


if __name__ == "__main__":
    main()
