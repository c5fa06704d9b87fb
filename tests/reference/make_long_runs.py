"""Make `dde_long_runs.json`: two long nonlinear runs, each by two methods in 64-bit mantissas.

* Mackey and Glass (Science 197, 1977): y' = 0.2 z/(1 + z^10) - 0.1 y, z = y(t - 17), history 0.5,
  to t = 1000, where the solution is chaotic;
* the network of `dde_problems.json` (`network50`) to t = 50.

Both methods use elements that divide the delay, so that the delayed solution is known in the same
form. One expands every element in a Taylor series by recurrences; the other collocates at Chebyshev
points through an integration matrix. They share nothing but the equations. Run from this folder.
"""

import json
from pathlib import Path

import numpy as np

LONG = np.longdouble
PI = 4 * np.arctan(LONG(1))


# Taylor series: coefficients along axis 0, components along axis 1.


def power(z, exponent):
    """z^a from z p' = a p z'."""
    p = np.zeros_like(z)
    p[0] = z[0] ** exponent
    for j in range(1, len(z)):
        weights = np.array([LONG(exponent * i - (j - i)) for i in range(1, j + 1)])[:, None]
        p[j] = (weights * z[1 : j + 1] * p[j - 1 :: -1][:j]).sum(axis=0) / (j * z[0])
    return p


def quotient(a, b):
    """a/b from b q = a."""
    q = np.zeros_like(a)
    for j in range(len(a)):
        q[j] = (a[j] - (b[1 : j + 1] * q[j - 1 :: -1][:j]).sum(axis=0)) / b[0]
    return q


def tanh(v):
    """T = tanh v from T' = (1 - T^2) v'."""
    t, square = np.zeros_like(v), np.zeros_like(v)
    t[0] = np.tanh(v[0])
    square[0] = 1 - t[0] ** 2
    steps = np.arange(len(v), dtype=LONG)[:, None]
    for j in range(1, len(v)):
        t[j] = (steps[1 : j + 1] * v[1 : j + 1] * square[j - 1 :: -1][:j]).sum(axis=0) / j
        square[j] = -(t[: j + 1] * t[j::-1]).sum(axis=0)
    return t


def taylor(forcing, rate, start, delay, parts, degree, times):
    """y' = forcing(y(t - delay)) - rate y by Taylor series, `parts` elements a delay."""
    h = LONG(delay) / parts
    constant = np.zeros((degree + 1, len(start)), dtype=LONG)
    constant[0] = start
    elements = [constant] * parts
    value = start
    for _ in range(int(np.ceil(float(max(times) / h))) + 1):
        known = forcing(elements[-parts])
        c = np.zeros_like(constant)
        c[0] = value
        for j in range(degree):
            c[j + 1] = h * (known[j] - rate * c[j]) / (j + 1)
        elements.append(c)
        value = c[::-1].cumsum(axis=0)[-1]
    found = []
    for t in times:
        k = min(int(t / h), len(elements) - parts - 1)
        sigma = LONG(t) / h - k
        sum_ = np.zeros_like(value)
        for c in elements[k + parts][::-1]:
            sum_ = sum_ * sigma + c
        found.append(sum_)
    return np.array(found)


# Chebyshev collocation: nodes along axis 0, components along axis 1.


def chebyshev(n):
    """Points on [0, 1], the matrix that integrates from 0, and the one that gives coefficients."""
    angle = PI * np.arange(n + 1, dtype=LONG) / n
    x = -np.cos(angle)
    values = np.cos(np.outer(PI - angle, np.arange(n + 1, dtype=LONG)))
    ends = np.ones(n + 1, dtype=LONG)
    ends[[0, -1]] = LONG(1) / 2
    coefficients = 2 / LONG(n) * (ends[:, None] * values.T * ends[None, :])
    # Antiderivative of T_j: T_{j+1}/(2(j+1)) - T_{j-1}/(2(j-1)).
    primitive = np.zeros((n + 2, n + 1), dtype=LONG)
    primitive[1, 0] = 1
    primitive[2, 1] = LONG(1) / 4
    for j in range(2, n + 1):
        primitive[j + 1, j] = 1 / LONG(2 * (j + 1))
        primitive[j - 1, j] = -1 / LONG(2 * (j - 1))
    wide = np.cos(np.outer(PI - angle, np.arange(n + 2, dtype=LONG)))
    integral = wide @ (primitive @ coefficients)
    integral -= integral[0]
    return (x + 1) / 2, integral / 2, coefficients


def collocation(forcing, rate, start, delay, parts, degree, times):
    """The same equation by collocation, the linear part by fixed-point iteration."""
    h = LONG(delay) / parts
    _, integral, coefficients = chebyshev(degree)
    elements = [np.repeat(start[None, :], degree + 1, axis=0)] * parts
    for _ in range(int(np.ceil(float(max(times) / h))) + 1):
        known = forcing(elements[-parts])
        first = elements[-1][-1]
        y = elements[-1]
        for _ in range(60):
            y = first + h * (integral @ (known - rate * y))
        elements.append(y)
    found = []
    for t in times:
        k = min(int(t / h), len(elements) - parts - 1)
        place = 2 * (LONG(t) / h - k) - 1
        basis = np.cos(np.arange(degree + 1, dtype=LONG) * np.arccos(place))
        found.append(basis @ (coefficients @ elements[k + parts]))
    return np.array(found)


def mackey_glass(method, parts, degree, times):
    def by_series(z):
        p = power(z, 10)
        p[0] += 1
        return quotient(LONG(2) / 10 * z, p)

    def by_nodes(z):
        return LONG(2) / 10 * z / (1 + z**10)

    forcing = by_series if method is taylor else by_nodes
    start = np.array([LONG(1) / 2])
    return method(forcing, LONG(1) / 10, start, 17, parts, degree, times)


def network(method, parts, degree, times):
    problems = json.loads(Path("dde_problems.json").read_text())["problems"]
    data = next(p["parameters"] for p in problems if p["id"] == "network50")
    weights = np.zeros((50, 50), dtype=LONG)
    for i, (sources, row) in enumerate(zip(data["idx"], data["W"], strict=True)):
        for j, weight in zip(sources, row, strict=True):
            weights[i, j] += LONG(str(weight))
    start = np.array([LONG(str(y)) for y in data["y0"]])
    squash = tanh if method is taylor else np.tanh
    return method(lambda z: squash(z @ weights.T), LONG(1), start, 1, parts, degree, times)


def record(name, run, coarse, fine, times):
    """Take the collocation; the largest difference from the series and from itself are kept."""
    values = run(collocation, *fine, times)
    series = run(taylor, *coarse, times)
    again = run(collocation, *coarse, times)
    difference = float(np.abs(values - series).max())
    other = float(np.abs(values - again).max())
    print(f"{name}: two methods agree within {difference:.1e}, two meshes within {other:.1e}")
    return {
        "id": name,
        "times": [str(t) for t in times],
        "values": [[np.format_float_positional(v, precision=17) for v in row] for row in values],
        "agreement": difference,
    }


if __name__ == "__main__":
    runs = [
        record("mackey_glass_17", mackey_glass, (68, 26), (85, 24), range(50, 1001, 50)),
        record("network50_long", network, (20, 24), (25, 20), range(5, 51, 5)),
    ]
    Path("dde_long_runs.json").write_text(json.dumps({"runs": runs}, indent=1) + "\n")
