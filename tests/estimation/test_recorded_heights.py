"""The two recorded heights of the AR.Drone 2.0, without its lag and with it."""

import deadtime as dtm
import pytest
from flights import flight_path

TS = 0.065


def real_flight(name, Kp):
    recording = dtm.read_recording(
        flight_path(name), time="t_s", reference="ref_m", output="height_m"
    )
    return recording, dtm.ControlLoop(dtm.Integrator(), dtm.P(Kp), sample_time=TS, limit=1.0)


@pytest.mark.survey
def test_a_real_flight_with_overshoot():
    recording, loop = real_flight("ardrone2_height_step_2_4_0_25.csv", 2.4)
    window = (13, 25.5)
    paper = dtm.estimate_delay(recording, loop, method="overshoot", window=window)
    assert paper.delay == pytest.approx(0.339, abs=0.01)
    fit = dtm.estimate_delay(recording, loop, window=window)
    assert 0.42 <= fit.delay <= 0.44
    assert 0.74 <= fit.gain <= 0.76
    assert fit.verdict != "reliable"
    # two independent fits put the robust standard error at 0.015 s, the naive one at 0.004 s
    assert fit.stderr["delay"] == pytest.approx(0.015, abs=0.005)
    assert fit.crb.stderr["delay"] == pytest.approx(0.0036, abs=0.0005)
    low, high = fit.ci(0.95)
    assert low < 0.43 < high
    lagged = dtm.estimate_delay(recording, loop, window=window, free=("delay", "gain", "lag"))
    assert lagged.delay == pytest.approx(0.232, abs=0.01)
    assert lagged.lag == pytest.approx(0.227, abs=0.01)
    assert lagged.gain == pytest.approx(0.85, abs=0.01)


def test_a_real_flight_without_overshoot():
    recording, loop = real_flight("ardrone2_height_step_0_5_1_0.csv", 0.5)
    window = (13, 25.5)
    with pytest.raises(dtm.NotIdentifiableError, match="no overshoot"):
        dtm.estimate_delay(recording, loop, method="overshoot", window=window)
    fit = dtm.estimate_delay(recording, loop, window=window)
    assert 0.235 <= fit.delay <= 0.28
    assert fit.gain == pytest.approx(0.71, abs=0.01)
    other, other_loop = real_flight("ardrone2_height_step_2_4_0_25.csv", 2.4)
    better = dtm.estimate_delay(other, other_loop, window=window)
    assert fit.stderr["delay"] > 2 * better.stderr["delay"]
