"""All roots of a region beside qpmr: time of both, alternated in one process, and their errors.

Errors are the largest distance of a certified root from the nearest one found; `missed` counts
those further than 1e-6 from any. Run ``python benches/peers/roots.py [--quick]``.
"""

from __future__ import annotations

import argparse
import json
import logging
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import deadtime as dtm
import numpy as np

try:
    import qpmr
except ImportError as error:
    raise SystemExit("qpmr is missing: pip install qpmr") from error

CASES = Path(__file__).parents[2] / "tests" / "reference" / "root_cases.json"
QUICK = ("armah_K2", "armah_neutral_Kv0.3", "mackey_glass")
MORE = (
    "qpmr_ex1",
    "qpmr_ex1_tall",
    "qpmr_ex3_neutral",
    "humphries_k3",
    "ring_cars_5",
    "near_double",
    "peec",
    "delay_1e3",
)
FAR = 1e-6


def seconds(call: Callable[[], object]) -> float:
    start = time.perf_counter()
    call()
    return time.perf_counter() - start


def judge(found: Any, case: dict[str, Any]) -> tuple[float, int]:
    """Largest error of a root that was found, and how many were not."""
    roots = np.array([complex(re, im) for re, im, _ in case["roots"]])
    found = np.asarray(found)
    if not len(found):
        return np.nan, len(roots)
    distances = np.abs(roots[:, None] - found[None, :]).min(axis=1)
    near = distances[distances < FAR]
    return float(near.max(initial=0.0)), int(np.sum(distances >= FAR))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="a moment's run, rough numbers")
    quick = parser.parse_args().quick
    names, rounds = (QUICK, 3) if quick else (QUICK + MORE, 7)
    logging.disable(logging.CRITICAL)
    warnings.simplefilter("ignore")
    cases = {c["name"]: c for c in json.loads(CASES.read_text(encoding="utf-8"))["cases"]}

    print(f"median of {rounds} alternated rounds")
    head = ("roots", "qpmr ms", "ours ms", "ratio", "qpmr err", "missed", "err", "missed")
    print(f"{'case':22s}" + "".join(f"{title:>10s}" for title in head))
    for name in names:
        case = cases[name]
        h = dtm.QuasiPolynomial(case["coefs"], case["delays"])
        a, b, c, d = case["region"]
        coefficients, delays = np.array(case["coefs"]), np.array(case["delays"])

        def theirs(
            coefficients: Any = coefficients, delays: Any = delays, region: Any = (a, b, c, d)
        ) -> Any:
            return qpmr.qpmr(coefficients, delays, region=region)[0]

        def ours(h: Any = h, re: Any = (a, b), im: Any = (c, d)) -> Any:
            return h.roots(re=re, im=im)

        errors = (*judge(theirs(), case), *judge(ours(), case))
        # Slow cases are not repeated beyond what a coffee takes.
        repeat = rounds if seconds(theirs) < 1.0 else 1
        times = np.median([(seconds(theirs), seconds(ours)) for _ in range(repeat)], axis=0) * 1e3
        print(
            f"{name:22s}{len(case['roots']):10d}{times[0]:10.2f}{times[1]:10.3f}"
            f"{times[0] / times[1]:10.0f}{errors[0]:10.1e}{errors[1]:10d}"
            f"{errors[2]:10.1e}{errors[3]:10d}"
        )


if __name__ == "__main__":
    main()
