"""Right-hand sides of the reference problems with constant delays, for many nodes at once."""

import json
from pathlib import Path

import numpy as np

PROBLEMS = {
    problem["id"]: problem
    for problem in json.loads(
        (Path(__file__).parents[1] / "reference" / "dde_problems.json").read_text()
    )["problems"]
}


def _network():
    parameters = PROBLEMS["network50"]["parameters"]
    weights = np.zeros((50, 50))
    for row, (columns, entries) in enumerate(zip(parameters["idx"], parameters["W"], strict=True)):
        np.add.at(weights[row], columns, np.array(entries, dtype=float))
    return weights, np.array(parameters["y0"], dtype=float)


WEIGHTS, FIRING = _network()


def window(t, y, z):
    return [-3.0 * y[1] - 0.2 * y[0] ** 3, y[0] - z[0, 0]]


def predator_prey(t, y, z, dz):
    caught = y[0] ** 2 / (y[0] ** 2 + 1.0)
    return [
        y[0] * (1.0 - z[0, 0] - 2.9 * dz[0, 0]) - y[1] * caught,
        y[1] * (caught - 0.1),
    ]


# Function, history, delays, further arguments.
CASES = {
    "drone_p_step": (lambda t, y, z: 1.31 * (1.0 - z[0]), 0.0, 0.36, {}),
    "drone_pv_neutral": (
        lambda t, y, z, dz: 2.0 * (1.0 - z[0]) - 0.3 * dz[0],
        0.0,
        0.36,
        {"neutral": True},
    ),
    "drone_p_sat_continuous": (
        lambda t, y, z: np.clip(1.31 * (2.0 - z[0]), -1.0, 1.0),
        0.0,
        0.36,
        {},
    ),
    "ddeprob_1delay_jump": (lambda t, y, z: -z[0], 0.0, 1.0, {"y0": 1.0}),
    "ddeprob_2delays_jump": (
        lambda t, y, z: -z[0] - z[1],
        0.0,
        [1.0 / 3.0, 1.0 / 5.0],
        {"y0": 1.0},
    ),
    "long_lightly_damped": (lambda t, y, z: -(np.pi / 2.0 - 0.01) * z[0], 1.0, 1.0, {}),
    "kinked_history": (
        lambda t, y, z: -2.0 * z[0] + 0.5 * y,
        lambda t: abs(t + 0.5),
        1.0,
        {},
    ),
    "mackey_glass_a1": (
        lambda t, y, z: 0.2 * z[0] / (1.0 + z[0] ** 10) - 0.1 * y,
        0.5,
        14.0,
        {},
    ),
    "network50": (lambda t, y, z: -y + np.tanh(WEIGHTS @ z[0]), FIRING, 1.0, {}),
    "distributed_window": (window, [1.0, 1.0], 1.0, {}),
    "neutral_pred_prey_e2": (
        predator_prey,
        lambda t: [0.33 - t / 10.0, 2.22 + t / 10.0],
        0.42,
        {"neutral": True},
    ),
    "stiff_prothero_delay": (
        lambda t, y, z: -1000.0 * (y - np.cos(t)) - np.sin(t) + 500.0 * (z[0] - np.cos(t - 1.0)),
        np.cos,
        1.0,
        {"y0": 2.0},
    ),
}


def truth(name):
    """Span, times and values of a problem."""
    problem = PROBLEMS[name]
    times = np.array([float(time) for time in problem["times"]])
    values = np.array([[float(value) for value in row] for row in problem["values"]]).T
    return (float(problem["t0"]), float(problem["tf"])), times, values
