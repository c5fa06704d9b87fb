"""The compiled kernels of the explorer in a Python runtime, and loops as they take them."""

from __future__ import annotations

import gzip
from typing import Any

import deadtime as dtm
import numpy as np
import pytest
from deadtime._base.explorer import kernels

#: Numbers of a loop, as `control_loop::Number` lists them.
NUMBERS = ("Kp", "Ki", "Kd", "gain", "lag", "delay", "sample_time")

#: Does it integrate, differentiate, and is the derivative that of the error?
KINDS = {"P": (0, 0, 0), "PI": (1, 0, 0), "PD": (0, 1, 1), "PV": (0, 1, 0), "PID": (1, 1, 1)}


def request(state: dict[str, Any]) -> list[float]:
    """A loop as the explorer describes it, as the numbers of a request."""
    kind = KINDS[state["controller"]]
    smooth = (state["omega"], state["damping"]) if state.get("filter") else (0.0, 1.0)
    num, den = _polynomials(state)
    slope = state.get("Kv", state.get("Kd", 0.0))
    return [
        *kind,
        *smooth,
        *(state["Kp"], state.get("Ki", 0.0), slope),
        *(state[name] for name in ("gain", "lag", "delay", "sample_time")),
        state.get("weight", 1.0),
        state["limit"] or np.inf,
        state.get("low", -(state["limit"] or np.inf)),
        {"stops": np.inf, "tracking": state.get("tracking_time")}.get(state.get("guard", ""), 0.0),
        *(len(num), *num),
        *(len(den), *den),
    ]


def _polynomials(state: dict[str, Any]) -> tuple[list[float], list[float]]:
    if state["plant"] == "integrator":
        return [1.0], [1.0, 0.0]
    if state["plant"] == "first_order":
        return [1.0], [1.0]
    return state["num"], state["den"]


def axis(name: str, points: np.ndarray) -> list[float]:
    """An axis of a map in a request."""
    return [NUMBERS.index("Kd" if name == "Kv" else name), len(points), *points]


class WebKernels:
    """The module of the package, or another one, instantiated once."""

    def __init__(self, code: bytes | None = None) -> None:
        wasmtime = pytest.importorskip("wasmtime", reason="the runtime wasmtime is not installed")
        store = wasmtime.Store()
        module = wasmtime.Module(store.engine, code or gzip.decompress(kernels()))
        assert not module.imports, "the kernels of a page import nothing"
        self._store = store
        self._exports = wasmtime.Instance(store, module, []).exports(store)

    def call(self, name: str, numbers: list[float]) -> np.ndarray:
        """The answer to a request; a ValueError with the reason where there is none."""
        exports, store = self._exports, self._store
        memory = exports["memory"]
        place = exports["reserve"](store, len(numbers))
        memory.write(store, np.asarray(numbers, dtype="<f8").tobytes(), place)
        if not exports[name](store):
            begin, count = exports["message"](store), exports["message_count"](store)
            raise ValueError(memory.read(store, begin, begin + count).decode())
        begin, count = exports["answer"](store), exports["answer_count"](store)
        return np.frombuffer(memory.read(store, begin, begin + 8 * count), dtype="<f8").copy()


def recorded_step(
    seed: int, lag: float, air: float
) -> tuple[dtm.Recording, dtm.ControlLoop, float]:
    """A step of a P loop in moving air, with the commands as they were given; loop and delay."""
    rng = np.random.default_rng(seed)
    delay, gain, kp = rng.uniform(0.1, 0.4), rng.uniform(0.6, 1.2), rng.uniform(1.0, 2.2)
    period, parts, rows = 0.065, 65, 130
    time = period * np.arange(rows)
    reference = np.where(np.arange(rows) < 15, 0.0, 1.0)
    commands, outputs = np.zeros(rows), np.zeros(rows)
    height = speed = wind = 0.0
    step = period / parts
    for row in range(rows):
        outputs[row] = height + rng.normal(0.0, 0.005)
        commands[row] = np.clip(kp * (reference[row] - outputs[row]), -1.0, 1.0)
        for part in range(parts):
            sent = int(np.floor((row * period + (part + 0.5) * step - delay) / period))
            told = gain * (commands[sent] if sent >= 0 else 0.0)
            speed = told if lag == 0.0 else speed + (told - speed) * step / lag
            wind += air * np.sqrt(step) * rng.normal() - wind * step
            height += step * (speed + wind)
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(kp), sample_time=period, limit=1.0)
    return dtm.Recording(time, reference, outputs, command=commands), loop, delay
