"""Margins of loops with a delay beside python-control with Padé approximants: time and error.

Both get the same loops, alternated in one process. python-control has no delays, so it gets the
delay as a Padé approximant of order 5 or 20, which is made beforehand and not timed. The error is
that of its gain margin relative to the proved one.
Run ``python benches/peers/margins.py [--quick]``.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable

import deadtime as dtm

try:
    import control
except ImportError:
    control = None

ORDERS = (5, 20)

#: Name, numerator and denominator in descending powers of s, delay in s.
LOOPS = [
    ("2/s, 0.36 s", [2.0], [1.0, 0.0], 0.36),
    ("lag and PI, 0.3 s", [0.36, 1.2, 0.6], [0.15, 1.0, 0.0, 0.0], 0.3),
    ("1/(s + 1)^3, 2 s", [0.8], [1.0, 3.0, 3.0, 1.0], 2.0),
]


def seconds(call: Callable[[], object], calls: int) -> float:
    start = time.perf_counter()
    for _ in range(calls):
        call()
    return (time.perf_counter() - start) / calls


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="a moment's run, rough numbers")
    rounds = 2 if parser.parse_args().quick else 15
    if control is None:
        print("python-control is not installed: pip install control")
    print(
        f"{'loop':20s}{'Padé':>6s}{'peer us':>10s}{'ours us':>10s}{'ratio':>8s}{'its error':>12s}"
    )
    for name, num, den, delay in LOOPS:
        loop = dtm.TransferFunction(num, den, delay=delay)
        exact = loop.margin().gain_margin
        for order in ORDERS if control is not None else ():
            peer = control.tf(num, den) * control.tf(*control.pade(delay, order))
            best = [float("inf")] * 2
            for _ in range(rounds):
                best[0] = min(best[0], seconds(lambda peer=peer: control.margin(peer), 20))
                best[1] = min(best[1], seconds(loop.margin, 200))
            error = abs(control.margin(peer)[0] / exact - 1.0)
            theirs, ours = (1e6 * value for value in best)
            print(
                f"{name:20s}{order:6d}{theirs:10.0f}{ours:10.1f}{theirs / ours:8.1f}{error:12.1e}"
            )


if __name__ == "__main__":
    main()
