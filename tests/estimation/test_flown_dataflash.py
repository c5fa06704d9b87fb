"""Flights read from the log that the vehicle itself wrote."""

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.append(str(Path(__file__).resolve().parents[2] / "benches"))

from made_logs import DataFlash
from reality.dataflash import MARK, recording_of, waited
from reality.flights import APPROACH

WAIT = 0.123


@pytest.fixture
def log(tmp_path):
    """Two flights in one log: commands every 65 ms, told after `WAIT`, positions every 40 ms."""
    made = DataFlash()
    made.define("MAVC", 1, "QHfff", "TimeUS,Cmd,P1,P2,P3")
    made.define("GUIP", 2, "Qff", "TimeUS,vX,vZ")
    made.define("XKF1", 3, "Qff", "TimeUS,PN,PD")
    for number, begin in ((0, 10.0), (1, 100.0)):
        for k in range(400):
            time = begin + 0.065 * k
            command = np.sin(time)
            made.add("MAVC", int(1e6 * time), MARK, command, float(k > 300), number)
            made.add("MAVC", int(1e6 * time), 22, 0.0, 0.0, number)
            made.add("GUIP", int(1e6 * (time + WAIT * number)), 0.0, 100.0 * command)
        for k in range(650):
            time = begin + 0.04 * k
            made.add("XKF1", int(1e6 * time), 0.0, -time)
    path = tmp_path / "flown.bin"
    path.write_bytes(made.data)
    return path


def test_a_flight_is_read_on_the_clock_of_the_vehicle(log):
    found = recording_of(log, 1, "height")
    assert found.output[0] == pytest.approx(100.0 + APPROACH, abs=0.04)
    assert np.diff(found.time) == pytest.approx(0.04, abs=2e-6)
    assert found.sent.time[0] == pytest.approx(-APPROACH, abs=0.04)
    assert found.sent.values == pytest.approx(np.sin(found.sent.time + found.output[0]), abs=1e-4)
    assert set(found.reference) == {0.0, 1.0}


def test_how_long_commands_waited_is_in_the_log(log):
    assert waited(log, 0, "height") == pytest.approx(0.0, abs=1e-6)
    assert waited(log, 1, "height") == pytest.approx(WAIT, abs=2e-6)
    with pytest.raises(ValueError, match="was told other commands"):
        waited(log, 0, "north")
    with pytest.raises(ValueError, match="no flight 2 is marked"):
        waited(log, 2, "height")
