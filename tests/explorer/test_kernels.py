"""The kernels in a page give the numbers that Python gives."""

from __future__ import annotations

import json
import runpy
import subprocess
from pathlib import Path
from typing import Any

import deadtime as dtm
import numpy as np
import pytest
from command_line import found
from deadtime.loops._explored import described
from web_kernels import WebKernels, axis, request

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def web() -> WebKernels:
    return WebKernels()


def random_loop(rng: np.random.Generator) -> dtm.ControlLoop:
    """A stable loop of any kind that the explorer has."""
    while True:
        gain = float(rng.uniform(0.3, 2.0))
        plant = rng.choice(
            [
                dtm.Integrator(gain, lag=float(rng.choice([0.0, rng.uniform(0.05, 0.5)]))),
                dtm.FirstOrder(gain, float(rng.uniform(0.2, 2.0))),
                dtm.RationalPlant([1.0, 5.0], [1.0, 4.0, 3.0, 0.0], gain=gain),
            ]
        )
        smooth = dtm.DerivativeFilter(float(rng.uniform(5.0, 30.0)), float(rng.uniform(0.5, 1.5)))
        smooth = smooth if rng.random() < 0.5 else None
        small = float(rng.uniform(-0.1, 0.2))
        controller = rng.choice(
            [
                dtm.P(float(rng.uniform(0.2, 2.0))),
                dtm.PI(float(rng.uniform(0.2, 1.5)), float(rng.uniform(0.05, 0.5))),
                dtm.PV(float(rng.uniform(0.2, 2.0)), small, smooth),
                dtm.PD(float(rng.uniform(0.2, 2.0)), small, smooth),
                dtm.PID(float(rng.uniform(0.2, 1.5)), float(rng.uniform(0.05, 0.5)), small, smooth),
            ]
        )
        loop = dtm.ControlLoop(
            plant,
            controller,
            delay=float(rng.uniform(0.05, 0.5)),
            sample_time=float(rng.uniform(0.01, 0.1)) if rng.random() < 0.5 else None,
            limit=1.0 if rng.random() < 0.5 else None,
        )
        if loop.is_stable():
            return loop


LOOPS = [random_loop(np.random.default_rng(seed)) for seed in range(50)]


def numbers(loop: dtm.ControlLoop) -> list[float]:
    return request(described(loop.specification))


@pytest.mark.parametrize("loop", LOOPS, ids=lambda loop: type(loop.controller).__name__)
def test_a_loop_has_the_same_abscissa_margins_and_responses(
    web: WebKernels, loop: dtm.ControlLoop
) -> None:
    abscissa = web.call("rightmost", [*numbers(loop), 4])[0]
    assert abscissa == pytest.approx(loop.spectral_abscissa(), rel=1e-9)

    stable, gain, _, phase, late = web.call("margins", numbers(loop))[:5]
    known = loop.margin()
    assert stable == 1.0
    assert [gain, phase, late] == pytest.approx(
        [known.gain_margin, known.phase_margin, known.delay_margin], rel=1e-9
    )

    time = np.linspace(0.0, 6.0, 61)
    answer = web.call("step", [*numbers(loop), 1.0, 0.0, 0.0, 0, len(time), *time])
    response = loop.step_response(time)
    np.testing.assert_allclose(answer[:61], response.outputs, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("seed", range(50))
def test_the_command_line_prints_the_same_abscissa(web: WebKernels, seed: int) -> None:
    rng = np.random.default_rng([1, seed])
    kp, delay, gain = (float(rng.uniform(*ends)) for ends in [(0.2, 2.0), (0.05, 0.5), (0.3, 2.0)])
    kv, lag = float(rng.choice([0.0, 0.1])), float(rng.choice([0.0, rng.uniform(0.05, 0.5)]))
    sample_time = float(rng.uniform(0.01, 0.1)) if rng.random() < 0.5 else None
    controller = dtm.PV(kp, kv, dtm.DerivativeFilter(15.0)) if kv else dtm.P(kp)
    plant = dtm.Integrator(gain, lag=lag)
    loop = dtm.ControlLoop(plant, controller, delay=delay, sample_time=sample_time)
    given = {"--kp": kp, "--kv": kv, "--delay": delay, "--gain": gain, "--lag": lag}
    given |= {"--filter": 15.0} if kv else {}
    given |= {"--sample-time": sample_time} if sample_time else {}
    printed = found("roots", *(word for pair in given.items() for word in pair))
    abscissa = loop.spectral_abscissa()
    assert printed["spectral_abscissa"] == abscissa
    assert web.call("rightmost", [*numbers(loop), 4])[0] == pytest.approx(abscissa, rel=1e-9)


def test_a_loop_without_rounding_has_the_same_bits(web: WebKernels) -> None:
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.PV(2.0, 0.3), delay=0.36)
    abscissa, chains = web.call("rightmost", [*numbers(loop), 1])[:2]
    assert abscissa == loop.spectral_abscissa()
    assert chains == loop.characteristic().chain_abscissa()
    limited = loop.replace(sample_time=0.065, limit=1.0, Kp=1.0, Kv=0.1)
    time = np.linspace(0.0, 10.0, 201)
    answer = web.call("step", [*numbers(limited), 1.0, 0.0, 0.0, 0, len(time), *time])
    assert answer[:201].tobytes() == limited.step_response(time).outputs.tobytes()


@pytest.mark.parametrize(
    ("loop", "ranges"),
    [
        (dtm.ControlLoop(dtm.Integrator(), dtm.PV(1.0, 0.1), delay=0.36), ("Kp", "Kv")),
        (dtm.ControlLoop(dtm.Integrator(0.9, 0.2), dtm.PI(1.0, 0.1), delay=0.3), ("Kp", "Ki")),
        (dtm.ControlLoop(dtm.FirstOrder(2.0, 0.5), dtm.P(1.0), delay=0.3), ("Kp", "delay")),
        (dtm.ControlLoop(dtm.Integrator(), dtm.PV(1.0, 0.1), delay=0.36), ("gain", "lag")),
    ],
)
@pytest.mark.parametrize("sample_time", [None, 0.065])
def test_maps_have_the_same_counts(
    web: WebKernels, loop: dtm.ControlLoop, ranges: tuple[str, str], sample_time: float | None
) -> None:
    loop = loop.replace(sample_time=sample_time)
    # A neutral loop has infinitely many unstable roots beyond Kv = 1.
    axes = {name: np.linspace(0.02, 0.95 if name == "Kv" else 3.0, 41) for name in ranges}
    chart = dtm.stability_map(loop, axes, abscissa=False)
    plane = [number for name, points in axes.items() for number in axis(name, points)]
    counts = web.call("map", [*numbers(loop), *plane]).reshape(41, 41)
    proved = chart.status == 0
    assert proved.mean() > 0.95
    assert np.array_equal(counts[proved], chart.unstable[proved])

    curves = web.call("boundaries", [*numbers(loop), *plane])
    place, found = 0, []
    while place < len(curves):
        count = int(curves[place])
        found.append(curves[place + 1 : place + 1 + 3 * count].reshape(count, 3))
        place += 1 + 3 * count
    if any(len(curve.omega) > 1 for curve in chart.boundaries):
        assert found
    for x, y, omega in np.concatenate(found or [np.zeros((0, 3))]):
        member = loop.replace(**dict(zip(ranges, (float(x), float(y)), strict=True)))
        if member.is_sampled:
            poles = np.asarray(member.poles())
            assert np.abs(poles - 1j * omega).min() < 1e-5
        else:
            assert abs(member.characteristic()(1j * omega)) < 1e-8 * (1.0 + omega**3)


def test_a_load_acts_like_a_command(web: WebKernels) -> None:
    """Behind the delay the load is a command: L(s) y for one that steps is P/(1 + P F e^-sT)."""
    loop = dtm.ControlLoop(dtm.Integrator(0.8, 0.1), dtm.PV(1.2, 0.1), delay=0.2)
    time = np.linspace(0.0, 40.0, 81)
    answer = web.call("step", [*numbers(loop), 0.0, 0.5, 0.0, 0, len(time), *time])
    # At rest the command makes up for the load, for which P needs an error of load/Kp.
    assert answer[80] == pytest.approx(0.5 / 1.2, rel=1e-6)
    # Until the first reaction arrives the plant follows the load alone.
    early = time <= 0.2
    lag = 0.1
    alone = 0.8 * 0.5 * (time - lag * (1.0 - np.exp(-time / lag)))
    np.testing.assert_allclose(answer[:81][early], alone[early], atol=1e-14)
    before = time[1] / 2.0
    assert before > 0.2


@pytest.mark.parametrize("sample_time", [None, 0.05])
@pytest.mark.parametrize(
    "controller",
    [
        dtm.PI(1.2, 0.6, weight=0.4),
        dtm.PI(1.2, 0.6, anti_windup=dtm.loops.ConditionalIntegration()),
        dtm.PID(1.2, 0.6, 0.1, dtm.DerivativeFilter(20.0), anti_windup=1.5, weight=0.7),
    ],
)
def test_limits_guards_weights_and_loads_have_the_same_bits(
    web: WebKernels, controller: dtm.loops.Controller, sample_time: float | None
) -> None:
    loop = dtm.ControlLoop(
        *(dtm.Integrator(), controller),
        delay=0.2,
        sample_time=sample_time,
        limit=(-0.2, 0.5),
    )
    time = np.linspace(0.0, 20.0, 401)
    answer = web.call("step", [*numbers(loop), 1.0, 0.1, 10.0, 0, len(time), *time])
    load = np.where(time >= 10.0, 0.1, 0.0)
    known = loop.simulate(time, np.ones(401), load=load)
    assert np.array_equal(answer[:401], known.outputs)
    assert answer[401:].max() == 0.5
    plain = loop.replace(controller=dtm.PI(1.2, 0.6), limit=None)
    assert np.abs(plain.simulate(time, np.ones(401), load=load).outputs - answer[:401]).max() > 0.1


@pytest.mark.parametrize(
    ("plant", "controller"),
    [
        (dtm.FirstOrder(2.0, 10.0), dtm.PI),
        (dtm.Integrator(0.9, 0.2), dtm.PV),
        pytest.param(dtm.Integrator(0.9, 0.2), dtm.PI, marks=pytest.mark.survey),
    ],
)
def test_a_design_is_that_of_python(
    web: WebKernels, plant: dtm.loops.Plant, controller: type[dtm.loops.Controller]
) -> None:
    known = dtm.design(dtm.ControlLoop(plant, dtm.P(1.0), delay=0.4), controller=controller)
    slack = 0.1 if controller is dtm.PI else 0.0
    request = numbers(known.loop.replace(weight=1.0) if slack else known.loop)
    sensitivity, load, weight, *gains = web.call("design", [*request, 1, 0.4, 1.6, slack])
    assert gains == pytest.approx(list(known.gains.values()), rel=1e-6)
    assert sensitivity == pytest.approx(1.6, rel=1e-6)
    assert load == pytest.approx(known.value, rel=1e-6)
    assert weight == pytest.approx(known.loop.controller.weight) if slack else np.isnan(weight)


def test_a_design_holds_for_an_interval_of_the_delay(web: WebKernels) -> None:
    loop = dtm.ControlLoop(dtm.Integrator(0.9, 0.2), dtm.PV(1.0, 0.1), delay=0.4)
    known = dtm.design(loop, delay=(0.35, 0.5))
    delays = [3, 0.4, 0.35, 0.5]
    sensitivity, load, _, *gains = web.call("design", [*numbers(loop), *delays, 1.6, 0.0])
    assert gains == pytest.approx(list(known.gains.values()), rel=1e-3)
    assert load == pytest.approx(known.value, rel=1e-3)
    assert sensitivity == pytest.approx(1.6, rel=1e-6)
    for late in delays[1:]:
        late_loop = loop.replace(delay=late, Kp=gains[0], Kv=gains[1])
        assert late_loop.margin().max_sensitivity <= 1.6 * (1.0 + 1e-6)
    assert dtm.design(loop).gains["Kp"] > 1.1 * gains[0]


#: A request for the roots of a loop, as `Request::control_loop` reads it.
REQUEST = [0, 0, 0, 0, 1, 1, 0, 0, 1, 0, 1, 0, 1, np.inf, -np.inf, 0, 1, 1, 2, 1, 0, 4]


def changed(place: int, *numbers: float) -> list[float]:
    """The request with other numbers from one place on."""
    return [*REQUEST[:place], *numbers, *REQUEST[place + len(numbers) :]]


@pytest.mark.parametrize(
    ("broken", "said"),
    [
        ([1.0], "ends too early"),
        ([0.5, 0.0, 0.0], "whole number"),
        (changed(10, -1.0), "-1 s in a loop"),
        (changed(5, np.nan), "finite"),
        (changed(16, 2, 1, 1, 1, 1), "degree"),
        (changed(18, 9), "inside a list"),
        (changed(13, 1.0, 2.0), "two bounds"),
    ],
)
def test_a_broken_request_is_refused_with_the_reason(
    web: WebKernels, broken: list[float], said: str
) -> None:
    with pytest.raises(ValueError, match=said):
        web.call("rightmost", broken)
    # The next request is answered as if nothing had been.
    loop = dtm.ControlLoop(dtm.Integrator(), dtm.P(2.0), delay=0.36)
    assert web.call("rightmost", [*numbers(loop), 1])[0] == loop.spectral_abscissa()


@pytest.fixture
def made() -> dict[str, Any]:
    """What `rust/web/make.py` defines."""
    script = ROOT / "rust/web/make.py"
    if not script.exists():
        pytest.skip("the sources of the kernels are not beside these tests")
    return runpy.run_path(str(script))


@pytest.mark.long
@pytest.mark.survey
def test_a_module_built_again_gives_the_same_bits(web: WebKernels, made: dict[str, Any]) -> None:
    where = ["rustc", "--print", "target-libdir", "--target", "wasm32-unknown-unknown"]
    try:
        found = subprocess.run(where, check=True, capture_output=True, text=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        found = ""
    if not found or not Path(found).is_dir():
        pytest.skip("rustup target add wasm32-unknown-unknown: the kernels cannot be built here")
    built = WebKernels(made["build"]())
    time = np.linspace(0.0, 6.0, 61)
    for loop in LOOPS:
        for name, further in [
            ("rightmost", [4]),
            ("margins", []),
            ("step", [1.0, 0.0, 0.0, 0, len(time), *time]),
        ]:
            question = [*numbers(loop), *further]
            np.testing.assert_array_equal(built.call(name, question), web.call(name, question))


def test_the_module_in_the_tree_was_made_from_the_sources_in_the_tree(
    made: dict[str, Any],
) -> None:
    about = json.loads(made["ORIGIN"].read_text(encoding="utf-8"))
    assert about["sources"] == made["sources_hash"](), "run: python rust/web/make.py"
    assert about["compressed"] == made["MODULE"].stat().st_size <= made["MOST"]
