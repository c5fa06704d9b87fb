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


@pytest.fixture(scope="module")
def set_points():
    return json.loads(told_by("arducopter_set_points.py", timeout=240.0).splitlines()[-1])


def test_positions_are_flown_to_within_the_speeds_of_the_limits(set_points):
    flown = set_points["position"]
    assert (flown["north"], flown["east"]) == pytest.approx((2.0, -1.0), abs=0.3)
    assert flown["height"] == pytest.approx(4.0, abs=0.3)
    assert flown["heading"] == pytest.approx(1.0, abs=0.1)
    assert flown["speed"] < 1.1
    assert flown["climb"] < 1.1


def test_attitudes_and_thrust_are_followed(set_points):
    level, nose_down = set_points["level"], set_points["nose_down"]
    assert level["tilt"] < 0.05
    # A proportional controller of the thrust around what hovers.
    assert 3.0 < min(level["heights"]) < max(level["heights"]) < 5.0
    assert min(nose_down["pitch"]) == pytest.approx(-0.08, abs=0.02)
    assert nose_down["heading"] == pytest.approx(0.0, abs=0.1)
    assert nose_down["north"] > 0.5


def test_rates_and_thrust_are_followed(set_points):
    flown = set_points["rates"]
    assert flown["roll"] == pytest.approx(0.1, abs=0.03)
    assert max(map(abs, flown["pitch"])) < 0.05
    assert 3.0 < min(flown["heights"]) < max(flown["heights"]) < 5.5


def test_what_set_points_need_is_put_back(set_points):
    assert set_points["held"] == [8.0, 100.0]
    assert set_points["put_back"] == [0.0, 1000.0]


def test_a_flight_goes_on_over_the_second_of_two_links():
    flown = json.loads(told_by("arducopter_two_links.py", timeout=240.0).splitlines()[-1])
    assert [one.partition(". ")[0] for one in flown["said"]] == [
        "udp:127.0.0.1:14550: nothing has been received for 0.2 s"
    ]
    for place in ("first", "second"):
        assert flown[place]["echo"] == pytest.approx(0.3)
        assert flown[place]["climb"] == pytest.approx(0.3, abs=0.1)
        assert flown[place]["missing"] < 20
    # The relay on the first link adds 40 ms to each round trip.
    assert flown["first_trip"] > flown["second_trip"] + 0.03
    assert flown["second"]["oldest"] < 0.5
    assert flown["landed"]


@pytest.mark.parametrize("count", [3, pytest.param(20, marks=pytest.mark.long)])
def test_after_a_kill_or_a_cut_link_every_parameter_is_as_before_the_first_run(count):
    """At random moments (seed 44): the next run, or `restore`, puts back and says so."""
    told = told_by("arducopter_killed.py", str(count), "44", timeout=400.0 + 90.0 * count)
    result = json.loads(told.splitlines()[-1])
    before = result["before"]
    for flight in result["flights"]:
        assert flight["after"] == before, flight
        if flight["changed"] != before:
            assert "was killed or lost its link" in str(flight["said"]), flight
    assert any(flight["changed"] != before for flight in result["flights"])
    assert any(flight["flew"] for flight in result["flights"])


@pytest.mark.parametrize("count", [2, pytest.param(24, marks=pytest.mark.long)])
def test_no_few_messages_leave_it_in_the_air_without_its_failsafes_or_armed(count):
    """Forged, late, repeated and missing ones of every kind (seeds from 100)."""
    told = told_by("arducopter_meddled.py", str(count), "100", timeout=400.0 + 90.0 * count)
    result = json.loads(told.splitlines()[-1])
    before = result["before"]
    for flight in result["flights"]:
        assert flight["without_failsafes"] == 0, flight
        assert flight["after"] == before, flight
        if flight["left"] != before:
            assert "changed-parameters" in str([flight["ended"], flight["warned"]]), flight
    assert max(flight["highest"] for flight in result["flights"]) > 0.8
