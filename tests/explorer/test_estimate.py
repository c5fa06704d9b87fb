"""The estimate of the page is that of `estimate_delay`."""

from __future__ import annotations

import deadtime as dtm
import numpy as np
import pytest
from step_recordings import record_step
from web_kernels import WebKernels, recorded_step


@pytest.fixture(scope="module")
def web() -> WebKernels:
    return WebKernels()


def estimate(
    web: WebKernels, recording: dtm.Recording, *, lag: bool, den: tuple[float, ...] = (1.0, 0.0)
) -> dict[str, np.ndarray]:
    """Delay, lag, sum and gain, each with its interval, and the rest of the answer."""
    lists = (recording.time, recording.output, recording.time, recording.command)
    numbers = [1, 1.0, len(den), *den, float(lag)]
    for one in lists:
        numbers += [len(one), *one]
    answer = web.call("estimate", numbers)
    found = {
        name: answer[3 * i : 3 * i + 3] for i, name in enumerate(("delay", "lag", "sum", "gain"))
    }
    return found | {"rest": answer[12:18], "fitted": answer[18:]}


@pytest.mark.parametrize(("lag", "air"), [(0.0, 0.0), (0.0, 0.05), (0.15, 0.0)])
@pytest.mark.parametrize("seed", [0, pytest.param(5, marks=pytest.mark.survey)])
def test_it_is_that_of_python(web: WebKernels, seed: int, lag: float, air: float) -> None:
    recording, loop, delay = recorded_step(seed, lag, air)
    free = ("delay", "gain", "lag") if lag else ("delay", "gain")
    known = dtm.estimate_delay(recording, loop, free=free)
    found = estimate(web, recording, lag=bool(lag))
    for name, value in (("delay", known.delay), ("gain", known.gain), ("lag", known.lag)):
        if name in free:
            low, high = known.ci(name=name)
            width = high - low
            assert found[name][0] == pytest.approx(value, abs=0.02 * width)
            assert found[name][1:] == pytest.approx([low, high], abs=0.05 * width)
    assert known.verdict == "reliable"
    assert found["rest"][5] == 1.0
    low, high = found["delay"][1:]
    assert low - 0.01 < delay < high + 0.01
    residuals = recording.output - found["fitted"]
    assert np.std(residuals) < 0.5 if air else np.std(residuals) < 0.007


@pytest.mark.parametrize("seed", [0, 4])
def test_a_lag_left_out_is_not_reliable(web: WebKernels, seed: int) -> None:
    recording, _, _ = recorded_step(seed, 0.15, 0.0)
    assert estimate(web, recording, lag=False)["rest"][5] == 0.0
    assert estimate(web, recording, lag=True)["rest"][5] == 1.0


def test_a_first_order_plant_has_its_time_constant_as_lag(web: WebKernels) -> None:
    rng = np.random.default_rng(3)
    loop = dtm.ControlLoop(dtm.FirstOrder(2.0, 0.5), dtm.P(0.8), delay=0.2, sample_time=0.05)
    time = 0.05 * np.arange(160)
    reference = np.where(time >= 0.5, 1.0, 0.0)
    response = loop.simulate(time, reference)
    output = response.outputs + rng.normal(0.0, 0.004, time.size)
    recording = dtm.Recording(time, reference, output, command=response.inputs)
    found = estimate(web, recording, lag=True, den=(1.0,))
    for name, truth in (("delay", 0.2), ("lag", 0.5), ("gain", 2.0)):
        low, high = found[name][1:]
        assert low < truth < high
        assert high - low < 0.3 * truth


def test_what_tells_nothing_is_refused(web: WebKernels) -> None:
    recording, *_ = recorded_step(1, 0.0, 0.0)
    still = dtm.Recording(
        recording.time, recording.reference, recording.output, command=np.zeros(130)
    )
    with pytest.raises(ValueError, match=r"tell these numbers apart|tells nothing|depend on"):
        estimate(web, still, lag=False)
    with pytest.raises(ValueError, match="time"):
        web.call("estimate", [1, 1.0, 2, 1.0, 0.0, 0, 2, 1.0, 0.0, 2, 0.0, 0.0, 1, 0.0, 1, 1.0])


def test_noise_free_steps_are_recovered(web: WebKernels) -> None:
    recording, known = record_step(0.31, 0.85)
    command = (
        known.replace(delay=0.31, gain=0.85).simulate(recording.time, recording.reference).inputs
    )
    given = dtm.Recording(recording.time, recording.reference, recording.output, command=command)
    found = estimate(web, given, lag=False)
    assert found["delay"][0] == pytest.approx(0.31, abs=1e-6)
    assert found["gain"][0] == pytest.approx(0.85, abs=1e-6)
