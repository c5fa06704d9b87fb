"""The flights of `benches/estimation.py --firmware`."""

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.append(str(Path(__file__).resolve().parents[2] / "benches"))

from reality import firmware
from reality.flights import Flight, Position, clock_of


def test_a_flight_has_a_name():
    flight = Flight("north", "wind", 0.1, 3)
    assert flight.name == "north-wind-0.10-3"
    assert Flight.of(flight.name) == flight
    with pytest.raises(ValueError, match="name one as"):
        Flight.of("east-calm-0.10-1")


def test_two_clocks_of_different_rates_are_matched():
    rng = np.random.default_rng(1)
    stamp = np.arange(0.0, 40.0, 0.02)
    late = rng.exponential(0.003, stamp.size)
    received = 1000.0 + stamp / 0.9999 + late
    rate, offset, misfit = clock_of(
        [Position(r, s, 0.0, 0.0, 0.0, 0.0) for r, s in zip(received, stamp, strict=True)]
    )
    assert np.abs(rate * (received - late) - offset - stamp).max() < 2e-4
    assert misfit < 5e-4


@pytest.mark.survey
def test_a_flight_of_the_firmware(tmp_path):
    if (reason := firmware.why_not()) is not None:
        pytest.skip(reason)
    flights = [Flight("height", "calm", added, 1) for added in (0.0, 0.25)]
    firmware.fly(tmp_path, flights)
    without, late = (firmware.estimated(tmp_path, one, limited=True) for one in flights)
    assert late.total - without.total == pytest.approx(0.25, abs=0.015)
    # What the plant lacks is far above the noise, so neither may be called adequate.
    assert late.unexplained > 2.0 * late.noise
    assert not without.adequate
    assert not late.adequate
