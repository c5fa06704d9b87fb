"""The generator, the bound and the field's tools of `benches/estimation.py --rates` are right."""

import ast
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import lfilter

BENCHES = Path(__file__).resolve().parents[2] / "benches"
sys.path.append(str(BENCHES))

from rate_loops import bound, field_tools, table  # noqa: E402
from rate_loops.generator import ROWS, SAMPLE, fly, low_pass, record  # noqa: E402


def test_only_the_table_uses_the_package():
    for name in ("generator", "bound", "field_tools"):
        tree = ast.parse((BENCHES / "rate_loops" / f"{name}.py").read_text(encoding="utf-8"))
        used = [node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)]
        used += [one.name for n in ast.walk(tree) if isinstance(n, ast.Import) for one in n.names]
        assert not any(module.startswith("deadtime") for module in used)


@pytest.mark.parametrize("order", [1, 2])
def test_without_noise_the_run_is_the_exact_response_behind_the_filter(order):
    vehicle = record(order, 0).vehicle
    setpoint = np.where(SAMPLE * np.arange(400) < 0.02, 0.0, 1.0)
    measured, command = fly(vehicle, setpoint, None)
    time = SAMPLE * np.arange(400)
    # Each change of the command moves the rate as a step into an integrator with a lag does.
    since = np.maximum(time[:, None] - vehicle.delay - time, 0.0)
    step = since + vehicle.lag * np.expm1(-since / vehicle.lag)
    rate = vehicle.gain * step @ np.diff(command, prepend=0.0)
    exact = lfilter(*low_pass(order), rate)
    np.testing.assert_allclose(measured, exact, rtol=0, atol=1e-9)


@pytest.mark.parametrize("order", [1, 2])
def test_the_filter_follows_a_slow_signal_by_its_lag(order):
    b, a = low_pass(order)
    ramp = lfilter(b, a, SAMPLE * np.arange(2000.0))
    vehicle = record(order, 0).vehicle
    assert SAMPLE * 1999 - ramp[-1] == pytest.approx(vehicle.filter_lag, rel=1e-9)


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


@pytest.mark.parametrize("order", [pytest.param(1, marks=pytest.mark.survey), 2])
def test_the_package_answers_within_its_interval(order):
    log = record(order, 0)
    least = bound.deviation_of_sum(bound.covariance(log))
    found = table.ours(log, least)
    assert found.reliable
    assert found.held
    assert abs(found.error) < 3.0 * least
