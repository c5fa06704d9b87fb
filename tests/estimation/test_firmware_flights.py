"""The flights of `benches/estimation.py --firmware`."""

import random
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

sys.path.append(str(Path(__file__).resolve().parents[2] / "benches"))

from reality import dataflash, firmware
from reality.dataflash import waited
from reality.drawn import LONGEST, drawn
from reality.flights import Flight, Position, clock_of


def test_a_flight_has_a_name():
    flight = Flight("north", "wind", 0.1, 3)
    assert flight.name == "north-wind-0.100-3"
    assert Flight.of(flight.name) == flight
    with pytest.raises(ValueError, match="name one as"):
        Flight.of("east-calm-0.100-1")


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


def test_waits_are_drawn_between_flights_without():
    flights = drawn(3, 5, ("height",), ("calm",))
    waits = [one.added for one in flights]
    assert [one.repeat for one in flights] == [1, 2, 3, 4, 5]
    assert waits[0] == waits[-1] == 0.0
    assert len(set(waits[1:-1])) == 3
    assert all(0.0 <= wait <= LONGEST for wait in waits)
    assert drawn(3, 6, ("height",), ("calm",)) != flights


def test_a_command_that_is_logged_twice_is_one(monkeypatch):
    sent, values = np.arange(6.0), np.array([0.1, 0.2, 0.2, 0.4, 0.5, 0.6])
    at = np.array([0.0, 1.0, 2.0, 3.0, 3.9, 4.0, 5.0]) + 0.25
    marks = {"Cmd": np.full(6, dataflash.MARK), "P3": np.full(6, 2), "P1": values, "P2": values}

    def log(told):
        topics = {
            "MAVC": SimpleNamespace(time=sent, columns=marks),
            "GUIP": SimpleNamespace(time=at, columns={"vZ": 100.0 * np.array(told)}),
        }
        return lambda path: SimpleNamespace(contents=SimpleNamespace(topics=topics))

    monkeypatch.setattr(dataflash.dtm, "open_log", log([0.1, 0.2, 0.2, 0.4, 0.4, 0.5, 0.6]))
    assert waited(Path("log.bin"), 2, "height") == pytest.approx(0.25)
    monkeypatch.setattr(dataflash.dtm, "open_log", log([0.1, 0.2, 0.2, 0.4, 0.3, 0.5, 0.6]))
    with pytest.raises(ValueError, match="the vehicle was told other commands"):
        waited(Path("log.bin"), 2, "height")


@pytest.mark.survey
@pytest.mark.flight
@pytest.mark.long
def test_what_commands_wait_comes_out_of_a_flight(tmp_path):
    # Drawn anew in each run; a failure shows it.
    wait = round(random.SystemRandom().uniform(0.05, LONGEST), 3)
    if (reason := firmware.why_not()) is not None:
        pytest.skip(reason)
    flights = [Flight("height", "calm", added, 1) for added in (0.0, wait)]
    firmware.fly(tmp_path, flights)
    # From the log of the controller, which knows its own commands and the position it was told.
    without, late = (firmware.estimated(tmp_path, one, plant="limits") for one in flights)
    assert late.total - without.total == pytest.approx(wait, abs=firmware.WITHIN)
    # What the plant lacks is far above the noise, so neither may be called reliable.
    assert late.unexplained > 2.0 * late.noise
    assert not without.reliable
    assert not late.reliable
    # From the DataFlash that the vehicle itself wrote.
    found = [firmware.estimated(tmp_path, one, plant="limits", own_log=True) for one in flights]
    # On a busy machine commands leave late; the log has when they came.
    facts = [firmware.facts_of(tmp_path, one) for one in flights]
    at_once, later = (waited(tmp_path / one["log"], one["number"], "height") for one in facts)
    assert later - at_once == pytest.approx(wait, abs=0.03)
    rise = found[1].total - found[0].total
    assert rise == pytest.approx(later - at_once, abs=firmware.WITHIN)
