"""Logs of PX4 before ULog, which have the first bytes of a DataFlash log."""

import deadtime as dtm
import numpy as np
import pytest
from small_logs import sdlog2


@pytest.fixture
def opened(tmp_path):
    def write(log):
        path = tmp_path / "log.px4log"
        path.write_bytes(log.data)
        return dtm.open_log(path)

    return write


def test_a_log_of_sdlog2_has_the_loops_of_px4(opened):
    # It was "a DataFlash log without a message".
    log = opened(sdlog2())
    assert (log.format, log.autopilot, log.vehicle) == ("sdlog2", "PX4", "PX4FMU_V2")
    assert log.firmware == "0123456789"
    assert log.key_parameters == {"MC_ROLLRATE_P": pytest.approx(0.15)}
    assert [name for _, name in log.modes] == ["Manual", "Position", "mode 4"]
    assert log.duration == pytest.approx(3.98)
    loop = log.loops["roll rate"]
    # A message has the time of the TIME before it, not of the next one.
    assert loop.setpoint.time == pytest.approx(0.02 * np.arange(200))
    assert loop.setpoint.unit == "rad/s"
    assert loop.followed == pytest.approx(3.98)
    assert log.loops["yaw"].followed == pytest.approx(3.0)
    climb = log.loops["vertical speed"]
    assert climb.setpoint.values[10] == pytest.approx(-1.0)
    assert np.array(climb.segments) == pytest.approx(np.array([(1.0, 3.0)]))


def test_what_is_landed_or_disarmed_is_left_out(opened):
    log = opened(sdlog2(armed=lambda k: 2 if k >= 50 else 1, landed=lambda k: int(k < 100)))
    reasons = log.loops["roll rate"].why_left_out
    assert [reason.rpartition(": ")[2] for reason in reasons] == [
        "the vehicle is disarmed",
        "the vehicle is on the ground or lands",
    ]
    assert log.loops["roll rate"].followed == pytest.approx(1.98)
