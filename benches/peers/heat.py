"""A heat equation with a delayed source: ours beside scipy's BDF by the method of steps.

u_t = D u_xx + a u(x, t - 1) on n points with u = 0 at both ends, at the same rtol and atol. BDF is
given the sparsity of the Jacobian and `vectorized`, and is restarted at every multiple of the delay
with the dense output of the interval before. The exact solution has a closed form: each sine is an
eigenvector of the difference matrix, and its factor solves a scalar delay equation in exponentials
times polynomials. Run ``python benches/peers/heat.py [--quick]``.
"""

from __future__ import annotations

import argparse
import resource
import statistics
import time
from typing import Any

import deadtime as dtm
import numpy as np
from scipy.integrate import solve_ivp
from scipy.sparse import diags_array

DIFFUSION, SOURCE, END = 1.0, 9.0, 5
RTOL, ATOL = 1e-6, 1e-9

Values = np.ndarray[Any, np.dtype[np.float64]]


def start(n: int) -> Values:
    x = np.arange(1, n + 1) / (n + 1)
    return 4.0 * x * (1.0 - x)


def spread(y: Values) -> Values:
    """D u_xx by differences, for one state or for many in columns."""
    wide = np.zeros((y.shape[0] + 2, *y.shape[1:]))
    wide[1:-1] = y
    return DIFFUSION * (y.shape[0] + 1) ** 2 * (wide[2:] - 2.0 * y + wide[:-2])


def truth(n: int) -> Values:
    """u at END, mode by mode: e^(rate s) P(s) + q on each interval, s from its start."""
    k = np.arange(1, n + 1)
    rate = -4.0 * DIFFUSION * (n + 1) ** 2 * np.sin(0.5 * np.pi * k / (n + 1)) ** 2
    modes = np.sqrt(2.0 / (n + 1)) * np.sin(np.pi * np.outer(k, k) / (n + 1))
    value = modes @ start(n)
    constant, polynomial = value, np.zeros((1, n))
    for _ in range(END):
        constant = -SOURCE * constant / rate
        powers = np.arange(1, len(polynomial) + 1)
        polynomial = np.vstack([value - constant, SOURCE * polynomial / powers[:, None]])
        value = np.exp(rate) * polynomial.sum(axis=0) + constant
    return modes @ value


def sparsity(n: int) -> Any:
    return diags_array([np.ones(n - 1), np.ones(n), np.ones(n - 1)], offsets=[-1, 0, 1])


def ours(n: int, pattern: Any = None, vectorized: bool = True) -> Values:
    found = dtm.solve_dde(
        lambda t, y, z: spread(y) + SOURCE * z[0],
        (0.0, float(END)),
        start(n),
        1.0,
        rtol=RTOL,
        atol=ATOL,
        t_eval=[float(END)],
        vectorized=vectorized,
        jac_sparsity=pattern,
    )
    if not found.success:
        raise RuntimeError(found.message)
    return found.y[:, -1]


def bdf(n: int) -> Values:
    y = start(n)
    past: Any = lambda t, y=y: y  # noqa: E731
    for step in range(END):

        def slope(t: float, y: Values, past: Any = past) -> Values:
            late = past(t - 1.0)
            return spread(y) + SOURCE * (late if y.ndim == 1 else late[:, None])

        found = solve_ivp(
            slope,
            (step, step + 1),
            y,
            "BDF",
            rtol=RTOL,
            atol=ATOL,
            dense_output=True,
            vectorized=True,
            jac_sparsity=sparsity(n),
        )
        past, y = found.sol, found.y[:, -1]
    return y


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="one small size, once")
    quick = parser.parse_args().quick
    print(f"{'n':>5}  {'what':26}{'ours ms':>10}{'BDF ms':>10}{'BDF/ours':>10}{'errors':>20}")
    for n in (20,) if quick else (50, 200):
        right = truth(n)
        for name, options in (
            ("pattern found", {}),
            ("jac_sparsity", {"pattern": sparsity(n)}),
            ("a node at a time", {"vectorized": False}),
        ):
            times: dict[str, list[float]] = {"ours": [], "bdf": []}
            for _ in range(1 if quick else 5):
                for key, run in (
                    ("ours", lambda n=n, o=options: ours(n, **o)),
                    ("bdf", lambda n=n: bdf(n)),
                ):
                    begin = time.perf_counter()
                    value = run()
                    times[key].append(time.perf_counter() - begin)
                    if key == "ours":
                        mine = np.abs(value - right).max()
                    else:
                        other = np.abs(value - right).max()
            a, b = (1e3 * statistics.median(times[key]) for key in ("ours", "bdf"))
            print(f"{n:5}  {name:26}{a:10.1f}{b:10.1f}{b / a:10.2f}{mine:10.1e}{other:10.1e}")
    n = 200 if quick else 4000
    begin = time.perf_counter()
    shift = dtm.solve_dde(
        lambda t, y, z: -y + np.roll(z[0], 1, axis=0),
        (0.0, 5.0),
        np.sin(np.arange(n)),
        1.0,
        vectorized=True,
        t_eval=[5.0],
    )
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(
        f"{n} components that are not stiff: {time.perf_counter() - begin:.2f} s, "
        f"{shift.nfev} calls, {most:.0f} MiB at most"
    )


if __name__ == "__main__":
    main()
