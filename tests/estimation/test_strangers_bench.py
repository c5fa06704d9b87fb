"""The generator, the sizes and the truth of `benches/estimation.py --strangers` are right."""

import ast
import json
import math
import pickle
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import deadtime as dtm
import numpy as np
import pytest

BENCHES = Path(__file__).resolve().parents[2] / "benches"
sys.path.append(str(BENCHES))

from strangers import sizes, table, truth  # noqa: E402
from strangers.estimates import estimates, numbers  # noqa: E402
from strangers.faults import FAULTS, named_size  # noqa: E402
from strangers.gains import sensitivity  # noqa: E402
from strangers.least_squares import data_of, fitted, standard_errors  # noqa: E402
from strangers.margins import DEMANDED, margin_met  # noqa: E402
from strangers.plants import KINDS, drawn  # noqa: E402
from strangers.rows import chosen, lot, rows  # noqa: E402
from strangers.simulate import logged, mean  # noqa: E402


def some(kind, number=6):
    return drawn(KINDS[kind], [f"test {kind} {i}" for i in range(number)])


def exact_plant(linear, i):
    above, below = np.array([linear.gain[i]]), np.ones(1)
    for zero in linear.zeros[i]:
        above = np.polymul(above, [zero, 1.0])
    for lag in linear.lags[i]:
        below = np.polymul(below, [lag, 1.0])
    for w, damping in linear.pairs[i].reshape(-1, 2):
        below = np.polymul(below, [w**-2, 2.0 * damping / w, 1.0])
    return dtm.RationalPlant(above, np.polymul(below, [1.0] + [0.0] * linear.integrators))


def test_the_generator_does_not_use_the_package():
    for path in (BENCHES / "strangers").glob("*.py"):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        used = [node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)]
        used += [one.name for n in ast.walk(tree) if isinstance(n, ast.Import) for one in n.names]
        asks = path.stem in ("estimates", "gains", "margins")
        assert asks or not any(each.startswith("deadtime") for each in used)


def test_rows_differ_in_name_and_their_sizes_are_known():
    everything = rows()
    assert pickle.loads(pickle.dumps(everything))[1].name == everything[1].name  # to processes
    assert len({row.name for row in everything}) == len(everything)
    assert [len(faults) for faults in lot().values()] == [4] * len(KINDS)
    known = json.loads(sizes.FILE.read_text(encoding="utf-8"))
    for row in everything:
        if row.fault:
            own = known[row.kind.name][row.fault.name]
            assert 0.0 < own[row.size]["size"] <= row.fault.largest
            if row.size == "large":
                assert own["large"]["size"] >= own.get("small", own["large"])["size"]
    assert [row.name for row in chosen(["height lag: clean"])] == ["height lag: clean"]
    assert [row.name for row in chosen(["internet loop: shifted", "internet loop: clean"])] == [
        "internet loop: clean",
        "internet loop: shifted column large",
    ]
    with pytest.raises(ValueError, match="no row 'nothing'"):
        chosen(["nothing"])


@pytest.mark.parametrize("kind", ["height lag", "height servo", "internet loop"])
def test_a_loop_is_that_of_the_exact_simulation(kind):
    runs = some(kind).quiet
    logs = logged(runs)
    for i in range(len(runs)):
        loop = dtm.ControlLoop(
            exact_plant(runs.linear, i),
            dtm.P(float(runs.Kp[i])),
            delay=float(runs.linear.delay[i]),
            sample_time=float(runs.dt[i]),
            limit=runs.kind.limit,
        )
        exact = loop.simulate(logs.time[i], runs.reference[i], reference_time=logs.time[i])
        np.testing.assert_allclose(logs.output[i], exact.outputs, rtol=0, atol=2e-4)


@pytest.mark.parametrize("kind", [name for name in KINDS if name != "height limits"])
def test_what_a_loop_feels_is_that_of_the_exact_margin(kind):
    linear = some(kind, 3).linear
    turn, largest = linear.turns()
    omega = linear.crossover()
    for i in range(3):
        plant = exact_plant(linear, i)
        loop = dtm.ControlLoop(plant, dtm.P(1.0), delay=float(linear.delay[i]))
        for share, stable in ((0.999, True), (1.001, False)):
            gain = dtm.P(share * math.exp(largest[i]))
            assert loop.replace(controller=gain).is_stable() == stable
        half = loop.replace(controller=dtm.P(0.5 * math.exp(largest[i])))
        below = [w for w in half.margin().gain_crossovers if w < turn[i]]
        assert omega[i] == pytest.approx(max(below, default=0.5 * turn[i]), rel=1e-6)


@pytest.mark.parametrize("kind", [name for name in KINDS if name != "height limits"])
def test_margins_of_true_loops_are_the_exact_ones(kind):
    linear = some(kind, 1).linear
    sharp, time = math.exp(linear.turns()[1][0]), float(linear.delay[0])
    plant = exact_plant(linear, 0)
    for share in (0.39, 0.41, 1.1):
        Kp = share * sharp
        for controller in (dtm.P(Kp), dtm.PI(Kp, 0.1 * Kp / time), dtm.PV(Kp, 0.1 * Kp * time)):
            loop = dtm.ControlLoop(plant, controller, delay=time)
            stable = loop.is_stable()
            met = stable and loop.margin().gain_margin >= DEMANDED
            assert margin_met(linear, controller) == (stable, met)
            if stable:
                most = loop.margin().max_sensitivity
                assert 1.0 / sensitivity(linear, controller) == pytest.approx(1.0 / most, abs=1e-3)


@pytest.mark.parametrize("kind", KINDS)
def test_a_clean_run_is_found_by_least_squares(kind):
    runs = some(kind)
    runs = replace(runs, noise=1e-6 * runs.noise / runs.deviation[:, None])
    logs = logged(runs)
    data = data_of(runs.kind, runs.dt, logs.command, logs.output)
    true, omega = runs.linear, runs.linear.crossover()
    start = replace(true, gain=1.05 * true.gain, delay=0.95 * true.delay, lags=1.1 * true.lags)
    found = fitted(start, data).felt(omega)
    np.testing.assert_allclose(found, true.felt(omega), rtol=2e-3, atol=1e-3)


@pytest.mark.parametrize("kind", ["height lag", "process PI", "open steps"])
def test_standard_errors_are_those_of_fits_to_noise(kind):
    runs = some(kind, 60)
    logs = logged(runs)
    data = data_of(runs.kind, runs.dt, logs.command, logs.output)
    omega = runs.linear.crossover()
    off = fitted(runs.linear, data).felt(omega) - runs.linear.felt(omega)
    ratio = off / standard_errors(runs.linear, data, runs.deviation, omega)
    spread = np.sqrt((ratio**2).mean(axis=0))
    assert np.all((spread > 0.75) & (spread < 1.3))


@pytest.mark.parametrize("fault", FAULTS.values(), ids=list(FAULTS))
def test_a_fault_of_no_size_is_none_and_one_of_some_size_is_not(fault):
    kinds = [kind for kind in KINDS.values() if fault.suits(kind) and kind.family]
    runs = some(kinds[-1].name, 3)
    clean = logged(runs)
    none = logged(runs, fault.chain(runs, np.zeros(3)))
    np.testing.assert_allclose(none.output, clean.output, rtol=0, atol=1e-9)
    np.testing.assert_allclose(none.command, clean.command, rtol=0, atol=1e-9)
    much = logged(runs, fault.chain(runs, np.full(3, fault.largest)))
    moved = np.abs(much.output - clean.output).max() + np.abs(much.command - clean.command).max()
    assert moved > 10.0 * runs.deviation.max()


@pytest.mark.parametrize(
    ("kind", "fault"),
    [("height lag", "play"), ("lightly damped", "load"), ("process PI", "stiction")],
)
def test_a_large_fault_moves_other_runs_as_it_was_sized(kind, fault):
    runs, fault = some(kind, 12).quiet, FAULTS[fault]
    size = sizes.size_of(KINDS[kind], fault, "large")["size"]
    assert 2.0 < sizes.moved(runs, fault, np.array([size]))[0] < 12.0


def test_the_truth_is_a_point_without_a_fault_and_has_the_gains_of_a_ramp():
    runs = some("rate loop", 3)
    point = truth.truth_of(runs, logged(runs), None, np.zeros(3))
    np.testing.assert_allclose(point.low, point.high, rtol=1e-12)
    ramp, size = FAULTS["gain ramp"], np.full(3, 0.2)
    logs = logged(runs, ramp.chain(runs, size))
    both = truth.truth_of(runs, logs, ramp, size)
    for end, factor, sign in ((both.low, 0.9, -1.0), (both.high, 1.1, 1.0)):
        np.testing.assert_allclose(end[:, 0], factor * point.low[:, 0], rtol=2e-3)
        assert np.all(sign * (end[:, 2] - factor * point.low[:, 2]) > -1e-2 * point.low[:, 2])
    assert np.all((both.low <= point.low) & (point.high <= both.high))


def test_a_moving_mean_keeps_a_line_and_widens_with_its_size():
    line = np.arange(9.0)
    np.testing.assert_allclose(mean(line, 2.6)[2:-2], line[2:-2])
    impulse = np.eye(1, 9, 4)[0]
    np.testing.assert_allclose(mean(impulse, 1.0)[3:6], [0.25, 0.5, 0.25])
    np.testing.assert_allclose(mean(impulse, 2.0)[3:6], [1 / 3, 1 / 3, 1 / 3])


def test_sizes_are_in_the_unit_of_their_cause():
    runs, output = some("height lag", 2), np.array([[0.0, 3.0], [-1.0, 0.5]])
    found = {
        name: named_size(fault, fault.chain(runs, np.full(2, 0.1)), np.full(2, 0.1), output)
        for name, fault in FAULTS.items()
        if fault.cause and fault.suits(runs.kind)
    }
    np.testing.assert_allclose(found["load"], 0.1)
    np.testing.assert_allclose(found["unequal limits"], 0.9)
    np.testing.assert_allclose(found["delay change"], 0.1 * runs.linear.delay)
    np.testing.assert_allclose(found["offset jump"], 0.1 * 1.5)
    np.testing.assert_allclose(found["gain by level"], [0.1 / 1.5 * 3.0, 0.1])


def test_a_delay_is_that_beside_the_integrators_of_the_true_plant():
    # A plant that comes to rest, 1 / (10 s + 1) behind 0.2 s, beside an integrator of 0.1.
    omega = 1.0
    phase = -0.2 * omega - math.atan(10.0 * omega)
    view = SimpleNamespace(
        gain=np.array([0.1]),
        gain_ci=np.array([[0.09], [0.11]]),
        phase=np.array([phase]),
        phase_ci=np.array([[phase - 0.01], [phase + 0.02]]),
    )
    best = SimpleNamespace(name="lag")
    fit = SimpleNamespace(at=lambda _: view, intervals={}, best=best, crossover=1.0)
    found = numbers(fit, omega, 1)
    expected = 0.2 - (0.5 * math.pi - math.atan(10.0))
    assert found["values"]["delay"] == pytest.approx(expected)
    assert found["ends"]["delay"] == pytest.approx((expected - 0.02, expected + 0.01))
    assert found["causes"] == []


def test_an_answer_is_counted_as_what_it_is():
    row = next(one for one in chosen(["height lag: play"]) if one.size == "small")
    (found,) = estimates(row, 0.002, 5, range(3, 4))
    assert (found.row, found.run) == (row.name, 3)
    assert found.verdict != "failed"
    assert found.size == pytest.approx(0.002)
    truths = dict.fromkeys(truth.QUANTITIES, (1.0, 1.1))
    right = {"gain": (0.9, 1.01), "delay": (1.2, 1.3), "largest gain": (1.05, 1.06)}
    made = replace(found, verdict="reliable", truth=truths, ends=right)
    assert [made.wrong(each) for each in truth.QUANTITIES] == [False, True, False]
    assert not replace(made, verdict="indication").wrong("delay")
    cause = {"name": "stiction", "size": 0.002, "ends": (0.001, 0.003), "others": ("play",)}
    named = replace(made, causes=[cause])
    other = replace(made, causes=[cause | {"name": "load", "others": ()}])
    open_one = replace(made, causes=[cause | {"others": ("drag", "play")}])
    line = table.summary(row, [made, named, other, open_one])
    assert (line["named"], line["right"], line["size right"]) == (2, 1, 1)
    assert line["either"] == 1
    assert (line["runs"], line["reliable"], line["wrong delay"]) == (4, 4, 4)
    clean = chosen(["height lag: clean"])[0]
    assert table.summary(clean, [made, other])["false"] == 1
    assert json.dumps(table.finite(made.as_plain()), allow_nan=False)
