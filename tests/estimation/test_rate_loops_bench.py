"""The generator, the bound and the field's tools of `benches/estimation.py --rates` are right."""

import ast
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

BENCHES = Path(__file__).resolve().parents[2] / "benches"
sys.path.append(str(BENCHES))

from rate_loops import bound, field_tools, table  # noqa: E402
from rate_loops.generator import ROWS, SAMPLE, fly, record  # noqa: E402


def test_only_the_table_uses_the_package():
    for name in ("generator", "bound", "field_tools"):
        tree = ast.parse((BENCHES / "rate_loops" / f"{name}.py").read_text(encoding="utf-8"))
        used = [node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)]
        used += [one.name for n in ast.walk(tree) if isinstance(n, ast.Import) for one in n.names]
        assert not any(module.startswith("deadtime") for module in used)


@pytest.mark.parametrize("order", [1, 2])
def test_without_noise_the_run_is_that_of_the_exact_simulation(order):
    log = record(order, 0)
    vehicle = log.vehicle
    setpoint = np.where(SAMPLE * np.arange(400) < 0.02, 0.0, 1.0)
    measured, _ = fly(replace(vehicle, Ki=0.0), setpoint, None)
    loop = table.known_loop(vehicle).replace(
        gain=vehicle.gain,
        lag_1=vehicle.lag,
        Kp=vehicle.Kp,
        delay=vehicle.delay,
        sample_time=SAMPLE,
    )
    time = SAMPLE * np.arange(400)
    exact = loop.simulate(time, setpoint, reference_time=time)
    np.testing.assert_allclose(measured, exact.outputs, rtol=0, atol=1e-9)


@pytest.mark.parametrize("order", [1, 2])
def test_what_is_not_the_mean_is_white_in_the_bound(order):
    log = record(order, 1)
    rest = log.response - bound.mean(log, {})
    innovations = bound.whitened(log.vehicle, rest[:, None])[200:, 0]
    one = 1.0 / np.sqrt(innovations.size)
    assert abs(np.mean(innovations**2) - 1.0) < 4 * np.sqrt(2.0) * one
    for lag in (1, 2, 5):
        correlation = np.mean(innovations[lag:] * innovations[:-lag])
        assert abs(correlation) < 4 * one


def test_the_tools_find_a_delay_alone():
    log = record(1, 2)
    late = np.concatenate([np.zeros(37), log.setpoint])[:ROWS]
    correlated = field_tools.correlation_lag(log.setpoint, late)
    assert correlated.value == pytest.approx(0.037, abs=1e-5)
    assert correlated.half < 1e-4
    crossed = field_tools.step_crossing(log.setpoint, late)
    # The deconvolved step rises over some rows, and windows of 1 s make it early.
    assert crossed.value == pytest.approx(0.037, abs=0.01)
