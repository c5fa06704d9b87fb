"""The experiment over MAVLink, with the stand-in in virtual time and a relay in between."""

import math
from contextlib import asynccontextmanager

import pytest

pytest.importorskip("pymavlink", reason="pymavlink is the codec")

from command_line import run as run_command
from deadtime.flights import FlightPlan, fly_experiment
from deadtime.links import Limits, run
from deadtime.links.mavlink import MAVLinkVehicle
from deadtime.links.udp import Network, RelayOptions
from deadtime.links.udp.delays import Normal
from deadtime.links.udp.relay import Relay
from stand_in_autopilot import GROUND, LAG, StandIn

#: Time between two messages of the vehicle, s.
SPACING = 0.02

PLAN = FlightPlan(
    gains=(0.8, 1.4), settle=4.0, hold=5.0, checked_hold=3.0, limits=Limits(max_climb=1.0)
)


def flown(folder, one_way, firmware="ardupilot", loss=0.0):
    """The study, and what TIMESYNC said during the flights."""
    trips = []

    @asynccontextmanager
    async def connect():
        path = Network(delay=one_way, loss=loss)
        async with (
            Relay(RelayOptions(GROUND, path, path)) as relay,
            StandIn(firmware, ground=relay.address, noise=0.003),
            MAVLinkVehicle(f"udp:{GROUND[0]}:{GROUND[1]}", PLAN.limits) as link,
        ):
            yield link
            trips.append(link.link_time)

    return fly_experiment(connect, PLAN, folder, run=run), trips


@pytest.mark.survey
@pytest.mark.long
@pytest.mark.parametrize("firmware", ["ardupilot", "px4"])
def test_what_the_relay_adds_is_what_the_estimate_rises_by(tmp_path, firmware):
    near, _ = flown(tmp_path / "near", 0.0, firmware)
    far, trips = flown(tmp_path / "far", 0.13, firmware)
    # Up to the spacing of the messages: a row holds the newest one, whatever its age.
    assert near.learned.fit.delay_plus_lag == pytest.approx(LAG + 0.5 * SPACING, abs=SPACING)
    rise = far.learned.fit.delay_plus_lag - near.learned.fit.delay_plus_lag
    assert rise == pytest.approx(0.26, abs=SPACING)
    # The echo of the set point goes there and back as TIMESYNC does.
    split = [study.learned.split.transport.delay for study in (near, far)]
    assert split[1] - split[0] == pytest.approx(0.26, abs=SPACING)
    for one in trips:
        assert one.median == pytest.approx(0.26, abs=0.001)
    assert far.after.overshoot < 8.0
    # Whether the fit is reliable is not asked: rows with messages of different ages may show.
    for study in (near, far):
        assert study.learned.fit.gain == pytest.approx(1.0, abs=0.02)


@pytest.mark.long
@pytest.mark.survey
def test_with_jitter_and_losses_the_estimate_is_the_mean(tmp_path):
    near, _ = flown(tmp_path / "near", 0.0)
    rough, _ = flown(tmp_path / "rough", Normal(0.13, 0.02), loss=0.05)
    ends = [study.learned.fit.ci(0.95, "delay+lag") for study in (near, rough)]
    totals = [study.learned.fit.delay_plus_lag for study in (near, rough)]
    lost = 0.05 * PLAN.sample_time
    half = math.hypot(*[0.5 * (high - low) for low, high in ends])
    assert 0.005 < half < 0.03
    assert totals[1] - totals[0] == pytest.approx(0.26 + lost, abs=half + SPACING)
    assert all(one.effects.error > 0.0 for one in rough.learned.flights)


def test_another_computer_needs_consent(tmp_path):
    done = run_command("fly", "--link", "udpout:192.0.2.1:14550", "--folder", tmp_path / "f")
    assert done.returncode == 1
    assert "nothing was sent to udpout:192.0.2.1:14550" in done.stderr
    assert "--i-have-a-safe-area" in done.stderr
    assert "Kp = 0.8, 1.4" in done.stderr
    assert "no more than 0.5 m/s" in done.stderr
    # Waiting on all interfaces is not this computer alone.
    done = run_command("fly", "--link", "udp:0.0.0.0:14550", "--folder", tmp_path / "f")
    assert "nothing was sent" in done.stderr


def test_one_vehicle_at_a_time_and_in_real_time(tmp_path):
    done = run_command("fly", "--link", "tcp:127.0.0.1:5760", "--host", "192.0.2.1")
    assert "give only one of the two" in done.stderr
    done = run_command("fly", "--link", "tcp:127.0.0.1:5760", "--virtual-time")
    assert "leave out --virtual-time" in done.stderr
    done = run_command("fly", "--link", "tcp:127.0.0.1:9", "--folder", tmp_path / "f")
    assert done.returncode == 1
    assert "cannot be opened" in done.stderr
