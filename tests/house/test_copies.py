"""Loops, results and errors survive pickle and copy, and stay read-only."""

import copy
import functools
import pickle
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import deadtime as dtm
import numpy as np
import pytest

LOOP = dtm.ControlLoop(
    dtm.Integrator(0.8), dtm.PV(1.8, 0.1), delay=0.36, sample_time=0.065, limit=1.0
)


def recorded():
    time = np.arange(60) * 0.065
    step = np.where(time < 0.3, 0.0, 1.0)
    return dtm.Recording(time, step, LOOP.simulate(time, step, reference_time=time).outputs)


def estimated():
    return dtm.estimate_delay(recorded(), LOOP.replace(delay=None), free=("delay",))


def mapped():
    chart = dtm.stability_map(LOOP, {"Kp": (0.5, 3), "Kv": (0, 0.5)}, shape=(3, 4))
    assert chart.stable.shape == (3, 4)  # computed once and stored, so it is pickled too
    return chart


@functools.cache
def designed():
    return dtm.design(
        LOOP, ranges={"Kp": (0.5, 3), "Kv": (0, 0.5)}, shape=(5, 5), objective="abscissa"
    )


@functools.cache
def filtered():
    return dtm.design_filter(LOOP, fixed={"Kp": 1.5}, omegas=[20.0, 40.0], loss=0.9)


RESULTS = {
    "Response": LOOP.step_response,
    "Recording": recorded,
    "DelayEstimate": estimated,
    "StabilityMap": mapped,
    "RootSet": LOOP.rightmost,
    "Design": designed,
    "FilterChoice": filtered,
    "Margins": LOOP.continuous().margin,
}
WAYS = {
    "pickle": lambda one: pickle.loads(pickle.dumps(one)),
    "copy": copy.copy,
    "deepcopy": copy.deepcopy,
}


def arrays(one):
    found = {}
    for name, value in vars(one).items():
        if isinstance(value, np.ndarray):
            found[name] = value
        elif isinstance(value, dict):
            parts = {f"{name}[{k}]": v for k, v in value.items() if isinstance(v, np.ndarray)}
            found.update(parts)
    return found


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("kind", RESULTS)
def test_results_survive_copying_and_stay_read_only(kind, way):
    one = RESULTS[kind]()
    other = WAYS[way](one)
    assert type(other).__name__ == kind
    assert repr(other) == repr(one)
    assert arrays(one).keys() == arrays(other).keys()
    for name, array in arrays(other).items():
        assert np.array_equal(array, arrays(one)[name], equal_nan=True), name
        assert not array.flags.writeable, f"{name} of a copy can be written to"
    assert all(not array.flags.writeable for array in arrays(one).values())


@pytest.mark.parametrize("way", WAYS)
def test_a_loop_that_was_used_survives_copying(way):
    # The cached native form of a loop could not be pickled once.
    LOOP.step_response()
    other = WAYS[way](LOOP)
    assert other == LOOP
    assert hash(other) == hash(LOOP)
    assert other.spectral_abscissa() == LOOP.spectral_abscissa()


def test_a_copied_response_is_still_measured_between_its_output_times():
    response = LOOP.simulate(np.linspace(0.0, 8.0, 33))
    other = pickle.loads(pickle.dumps(response))
    assert other.info() == response.info()


@pytest.mark.parametrize(
    "error",
    [
        dtm.ContourError("on the edge", 1j, 0.25),
        dtm.CountMismatchError("one is missing", 2, [(1j, 1)]),
        dtm.ConvergenceError("no end", 1 + 2j),
        dtm.RecordingError("no file"),
    ],
)
def test_errors_survive_pickling(error):
    # An error that cannot be pickled breaks the pool in which it is raised.
    for way in WAYS.values():
        other = way(error)
        assert type(other) is type(error)
        assert str(other) == str(error)
        assert vars(other) == vars(error)


def abscissa_and_peak(loop):
    return loop.spectral_abscissa(), loop.step_response()


def test_loops_go_into_a_pool_and_responses_come_out():
    LOOP.rightmost()
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        abscissa, response = pool.submit(abscissa_and_peak, LOOP).result(timeout=120)
    assert abscissa == LOOP.spectral_abscissa()
    assert np.array_equal(response.outputs, LOOP.step_response().outputs)


@pytest.mark.parametrize("kind", RESULTS)
def test_reprs_are_short(kind):
    text = repr(RESULTS[kind]())
    assert kind in text
    assert len(text) < 200
