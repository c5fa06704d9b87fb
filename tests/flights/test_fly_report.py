"""The whole experiment with its page, as a Python program flies it."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from deadtime import FlightAbortedError, LinkError
from deadtime._base.plain import plain
from deadtime.flights import FlightPlan, FlownVehicle, fly_and_report
from deadtime.links import Limits, run
from deadtime.links.ardrone2.emulator import EmulatorOptions
from deadtime.links.mavlink import LinkTime
from simulated_vehicle import SimulatedVehicle

PLAN = FlightPlan(gains=(2.4,), settle=2.5, hold=3.5, checked_hold=2.0)


def flown(vehicle):
    return FlownVehicle(lambda: vehicle, "a height model", run)


def test_flights_numbers_and_page_are_in_the_folder(tmp_path):
    vehicle = SimulatedVehicle(noise=0.001, random=np.random.default_rng(1))
    stages = []
    found = fly_and_report(flown(vehicle), [PLAN], tmp_path, progress=stages.append)
    assert vehicle.log.count("took off") == vehicle.log.count("landed") == 2
    assert stages[0] == "flight 1 of 3: z P, Kp = 2.4"
    (study,) = found.studies
    assert study.learned.fit.delay_plus_lag == pytest.approx(0.40, abs=0.02)
    written = json.loads((tmp_path / "result.json").read_text(encoding="utf-8"))
    assert written == {"schema": "deadtime.flight/1", **plain(found.to_dict())}
    assert (written["flown_on"], written["adaptive"], written["round_trip"]) == (
        "a height model",
        {},
        None,
    )
    assert study.headline().split(".")[0] in found.page.read_text(encoding="utf-8")
    # A second experiment would mix its flights with those of the first.
    with pytest.raises(ValueError, match="contains recordings already: give another folder"):
        fly_and_report(flown(vehicle), [PLAN], tmp_path)


def test_an_error_names_the_recordings_that_are_kept(tmp_path):
    def tilted(state, since):
        return replace(state, pitch=1.0) if since > 3.0 else state

    with pytest.raises(FlightAbortedError, match="tilted") as raised:
        fly_and_report(flown(SimulatedVehicle(change_state=tilted)), [PLAN], tmp_path)
    kept = "flight-1-z-P.csv, flight-1-z-P.messages.csv"
    assert raised.value.__notes__ == [f"kept in {tmp_path}: {kept}"]


def test_nothing_is_said_to_be_kept_where_nothing_was_flown(tmp_path):
    def unreachable():
        raise LinkError("nobody answers")

    with pytest.raises(LinkError) as raised:
        fly_and_report(FlownVehicle(unreachable, run=run), [PLAN], tmp_path)
    assert not hasattr(raised.value, "__notes__")
    assert not (tmp_path / "result.json").exists()


def test_the_round_trip_is_the_median_of_those_of_the_links():
    times = [LinkTime(0.0, median, 0.0, 9, 0, 0.0) for median in (0.3, 0.1, 0.2)]
    assert FlownVehicle(None, link_times=times).round_trip() == 0.2
    assert FlownVehicle(None).round_trip() is None


def test_the_height_of_an_autopilot_has_smaller_gains():
    # pi / (4 0.5 1), half of the stability limit for the delay that is assumed.
    plan = FlightPlan.of_axis("z", autopilot=True)
    assert max(plan.gains) < math.pi / (4.0 * plan.prior_delay * plan.prior_gain)
    assert plan.prior_delay > FlightPlan.of_axis("z").prior_delay
    assert FlightPlan.of_axis("x", autopilot=True) == FlightPlan.of_axis("x")


@pytest.mark.parametrize(
    ("name", "given", "message"),
    [
        ("delay", -0.1, "delay=-0.1: give a number from 0 to 100"),
        ("noise", math.nan, "noise=nan: give a finite number"),
        ("battery", 101, "battery=101: give a number from 0 to 100"),
        ("seed", -1, "seed=-1: give 0 or more"),
        ("ftp_port", 65536, "ftp_port=65536: give a number from 0 to 65535"),
    ],
)
def test_options_of_the_emulator_outside_their_bounds_are_refused(name, given, message):
    with pytest.raises(ValueError, match=message):
        EmulatorOptions(**{name: given})


def test_numbers_of_the_emulator_become_floats_and_none_stays():
    options = EmulatorOptions(noise=1, seed=3)
    assert (type(options.noise), type(options.seed), options.delay) == (float, int, None)
    assert Limits().max_climb < FlightPlan().limits.max_climb
