"""Print what the online estimator achieves on simulated drifts, jumps, calm hours and quiet spells.

    python benches/online.py [--quick]

The whole takes about 20 minutes on one core, ``--quick`` about one.
"""

from __future__ import annotations

import argparse

from tracking.scores import beside_lagd, calm, changes, drifts, quiet


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="a few runs of each")
    parser.add_argument("--hours", type=float, help="calm hours instead of 100")
    quick = parser.parse_args()
    few = quick.quick
    print("drift 0.2 to 0.4 s in 200 s, walk: ", drifts(8 if few else 100), flush=True)
    print("the same, evenly:                  ", drifts(4 if few else 100, kind="ramp"), flush=True)
    for up in (True, False):
        print("up  " if up else "down", changes(16 if few else 200, up), flush=True)
    print("no change:", calm(quick.hours or (0.5 if few else 100.0)), flush=True)
    inside, after, coverage = quiet(2 if few else 20, 300.0 if few else 1200.0)
    print(
        f"20 minutes of rest: largest error {1e3 * inside:.0f} ms, after it {1e3 * after:.0f} ms, "
        f"coverage {coverage:.1%}"
    )
    for one in beside_lagd(2 if few else 20):
        print(one, flush=True)


if __name__ == "__main__":
    main()
