"""Flights on several axes with the stand-in, in virtual time, and the clock of the vehicle."""

import math
from contextlib import asynccontextmanager
from dataclasses import replace

import deadtime as dtm
import numpy as np
import pytest
from deadtime import FlightAbortedError
from deadtime.flights import FlightPlan
from deadtime.flights._clock import MISFIT, VehicleClock
from deadtime.flights._fly import PlannedFlight, fly_all
from deadtime.flights._plants import fit_by_evidence, for_small_commands
from deadtime.links import AXES, AxisReader, Limits, VehicleState, Watch, run

LIMITS = Limits(max_climb=1.0)


# Axes


def state(**values):
    return VehicleState(0.0, 1.0, True, False, 1, **values)


def test_a_heading_is_read_without_jumps_from_where_it_was():
    reader = AxisReader(AXES["yaw"], state(yaw=3.0))
    turned = [
        reader.output(state(yaw=math.remainder(3.0 + 0.1 * k, 2 * math.pi))) for k in range(99)
    ]
    assert turned == pytest.approx([0.1 * k for k in range(99)])
    with pytest.raises(dtm.LinkError, match="does not report its heading"):
        reader.output(state())


def test_a_vehicle_that_drifts_too_far_is_not_flown_on():
    watch = Watch(Limits(max_distance=2.0), origin=state(north=1.0, east=1.0))
    watch.check(state(north=2.0, east=-0.5), 0.1)
    with pytest.raises(
        FlightAbortedError, match=r"2\.24 m from its place of take-off, but at most 2 m"
    ):
        watch.check(state(north=2.0, east=3.0), 0.2)
    with pytest.raises(FlightAbortedError, match="nan m from"):
        watch.check(state(), 0.3)


@pytest.mark.parametrize("axis", ["x", "y", "yaw"])
def test_plans_of_other_axes_are_within_their_limits(axis):
    FlightPlan.of_axis(axis).check()
    with pytest.raises(ValueError, match="half of the stability limit"):
        FlightPlan.of_axis(axis, gains=(2.5,)).check()
    with pytest.raises(ValueError, match="as small as the noise"):
        FlightPlan.of_axis(axis, step=0.01).check()
    with pytest.raises(ValueError, match="axis 'roll' does not exist"):
        FlightPlan.of_axis("roll")


def test_steps_beyond_the_position_fence_are_refused():
    with pytest.raises(ValueError, match=r"may come to 1\.2 m, outside of -1 to 1 m"):
        FlightPlan.of_axis("x", step=0.6, limits=Limits(max_distance=1.0)).check()


def test_each_axis_is_stepped_in_one_flight_while_the_others_rest(tmp_path):
    pytest.importorskip("pymavlink", reason="pymavlink is the codec")
    from deadtime.links.mavlink import MAVLinkVehicle
    from stand_in_autopilot import StandIn

    stand_ins = []

    @asynccontextmanager
    async def connect():
        async with StandIn() as vehicle, MAVLinkVehicle("udp:127.0.0.1:14550", LIMITS) as link:
            stand_ins.append(vehicle)
            vehicle.yaw, vehicle.place = 3.0, [4.0, -2.0]  # it turns across the jump
            yield link

    plans = [
        replace(FlightPlan.of_axis(axis, limits=LIMITS), settle=2.0) for axis in ("z", "x", "yaw")
    ]
    flights = [PlannedFlight(plan, dtm.P(0.8), 4.0) for plan in plans]
    flown, _ = run(fly_all(connect, flights, tmp_path))
    assert sum(number == 22 for number, _ in stand_ins[0].commands) == 1  # one take-off
    for flight, plan in zip(flown, plans, strict=True):
        assert flight.axis.name == plan.axis
        first, second = flight.recording.steps()
        assert (first.before, first.after, second.after) == pytest.approx(
            (plan.base, plan.base + plan.step, plan.base)
        )
        end = flight.recording.output[second.index - 1]
        assert end == pytest.approx(plan.base + plan.step, abs=0.1 * plan.step)
    # It ends where it began: nothing but the stepped axis was moved.
    assert stand_ins[0].place == pytest.approx([4.0, -2.0], abs=0.05)


def test_an_axis_that_the_vehicle_does_not_have_is_refused_before_the_take_off(tmp_path):
    from simulated_vehicle import SimulatedVehicle

    vehicle = SimulatedVehicle()
    flight = PlannedFlight(FlightPlan.of_axis("x"), dtm.P(0.5), 4.0)
    with pytest.raises(ValueError, match=r"no speed commands on the axis x, only on z"):
        run(fly_all(lambda: vehicle, [flight], tmp_path))
    assert "took off" not in vehicle.log


# The vehicle's clock


def stamps(random, rate=1.0002, wait=0.03):
    stamp = 100.0 + 0.02 * np.arange(1000)
    return rate * stamp + random.exponential(wait, stamp.size), stamp


def test_the_clock_of_a_vehicle_is_found_from_messages_that_wait():
    random = np.random.default_rng(1)
    arrival, stamp = stamps(random)
    clock = VehicleClock.of(arrival, stamp)
    assert clock.rate == pytest.approx(1.0002, abs=2e-4)
    assert clock.misfit < MISFIT
    np.testing.assert_allclose(clock.time(stamp), 1.0002 * stamp, atol=3e-3)
    normal = 1.0002 * stamp + random.normal(0.13, 0.02, stamp.size)
    found = VehicleClock.of(normal, stamp)
    assert found.even
    assert MISFIT < found.allowed < 0.015


def test_a_vehicle_that_stood_still_is_noticed():
    random = np.random.default_rng(1)
    arrival, stamp = stamps(random, wait=0.002)
    arrival[500:] += 0.06
    assert not VehicleClock.of(arrival, stamp).even
    noisy = stamp + random.normal(0.13, 0.02, stamp.size)
    noisy[500:] += 0.06
    assert not VehicleClock.of(noisy, stamp).even
    assert VehicleClock.of(arrival[:200], stamp[:200]) is None  # too short to tell


# Plants by evidence


def limited_flight(tmp_path, seed=0):
    """A flight of a vehicle that limits acceleration and jerk, as a flown one is kept."""
    from deadtime.flights import FlownSteps

    random = np.random.default_rng(seed)
    time = np.arange(0.0, 24.0, 0.065)
    reference = np.where(time < 5.0, 0.0, np.where(time < 14.0, 1.0, 0.0))
    fine = np.arange(0.0, 24.0, 0.001)
    told, shaped, rate, height = np.zeros(fine.size), 0.0, 0.0, 0.0
    output, command = np.empty(time.size), np.empty(time.size)
    row = 0
    for k, now in enumerate(fine):
        if row < time.size and now >= time[row] - 1e-9:
            output[row] = height + random.normal(0.0, 0.002)
            command[row] = min(max(0.9 * (reference[row] - output[row]), -1.0), 1.0)
            told[k:] = command[row]
            row += 1
        wanted = told[max(k - 250, 0)]
        towards = min(max((wanted - shaped) / 0.2, -1.0), 1.0)
        rate += min(max(towards - rate, -0.005), 0.005)
        shaped += 0.001 * rate
        height += 0.001 * shaped
    recording = dtm.Recording(time, reference, output, command)
    return FlownSteps(dtm.P(0.9), recording, tmp_path / "none.csv", None, 0.065, 5.0)


def test_the_limits_of_a_vehicle_are_in_the_plant_where_they_explain_the_flight(tmp_path):
    flight = limited_flight(tmp_path)
    fit, tried = fit_by_evidence([flight], 1.0, (1.0, 5.0))
    assert [one.fit.verdict == "reliable" for one in tried] == [False, True]
    assert fit.delay_plus_lag == pytest.approx(0.25, abs=0.02)
    assert fit.gain == pytest.approx(1.0, abs=0.02)
    linear = for_small_commands(fit).loop
    num, den = linear.plant.polynomials()
    # gain/(s (lag s + 1)(0.2 s + 1)), up to a common factor
    assert den[-2] / num[-1] == pytest.approx(1.0 / fit.gain)
    assert -den[-3] / den[-2] == pytest.approx(-(fit.lag + 0.2), abs=1e-9)
    best = dtm.design(
        for_small_commands(fit), controller=dtm.PV, gain_margin=2.5, objective="abscissa"
    )
    assert best.margins.gain_margin >= 2.5
