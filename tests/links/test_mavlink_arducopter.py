"""ArduPilot's Copter itself: a flight, another station that lands it, a station that is killed."""

import json

import pytest

pytest.importorskip("pymavlink", reason="pymavlink is the codec")

from arducopter import told_by

pytestmark = [pytest.mark.survey, pytest.mark.flight]


@pytest.fixture(scope="module")
def session():
    return json.loads(told_by("arducopter_session.py", timeout=240.0).splitlines()[-1])


def test_it_takes_off_to_the_height_that_was_asked_for(session):
    assert session["another"]["up"]["height"] == pytest.approx(1.0, abs=0.2)


def test_another_station_that_lands_it_is_obeyed_at_once_and_named(session):
    flown = session["another"]
    assert "went to LAND" in flown["ended"]["message"]
    assert "system 254, component 190" in flown["ended"]["message"]
    # Its heartbeats come five times a second, the other station hears them twenty times.
    assert flown["ended"]["time"] - flown["landing"] < 1.0
    assert flown["closed"]["time"] > flown["ended"]["time"]  # closed without an error


def test_what_was_set_in_the_vehicle_is_put_back(session):
    assert session["put_back"] == {"GUID_TIMEOUT": 3.0, "FENCE_ENABLE": 0.0, "ANGLE_MAX": 3000.0}


def test_a_station_that_is_killed_leaves_a_vehicle_that_hovers_then_lands(session):
    """Set points count for GUID_TIMEOUT; heartbeats, sent twice a second, for FS_GCS_TIMEOUT."""
    killed = session["killed"]
    assert killed["timeout"] == 0.5
    assert killed["told"] == pytest.approx(0.4)
    assert 0.35 < killed["hovers"] < 0.75
    assert 0.9 < killed["lands"] < 2.5
    assert killed["climbed"] < 0.4 * 0.75 + 0.3
    assert killed["lands"] < killed["down"] < 20.0
