"""Which packets the reader accepts, and the states that it reads from recorded ones."""

import struct
from dataclasses import replace

import numpy as np
import pytest
from deadtime import FlightAbortedError
from deadtime.flights._runs import telemetry_of
from deadtime.flights._split import split_delay
from deadtime.links import Limits, Watch
from deadtime.links.ardrone2 import Navdata, build_navdata
from deadtime.links.ardrone2.navdata import State
from deadtime.links.ardrone2.navdata_options import Demo
from deadtime.links.ardrone2.reader import NavdataReader
from flights import flight_path

FLYING = Demo(major=3, battery=80, height=1.0)


def packet(sequence, height=1.0, clock=None, state=State.FLYING, **others):
    demo = replace(FLYING, height=height)
    return build_navdata(Navdata(int(state), sequence, clock=clock, demo=demo, **others))


def read_all(*packets, every=0.005):
    """Give these packets to a reader, one after the other."""
    reader = NavdataReader()
    states = [reader.accept(one, k * every) for k, one in enumerate(packets)]
    return reader, states


def test_sequence_numbers_must_rise():
    reader, states = read_all(*(packet(k) for k in (1, 2, 2, 5, 3, 6)))
    assert [s and s.sequence for s in states] == [1, 2, None, 5, None, 6]
    counts = reader.statistics
    assert (counts.duplicates, counts.reordered, counts.missing, counts.states) == (1, 1, 1, 4)
    assert reader.newest.missing == 2  # The longest run of bad packets that the rules allow.


def test_a_packet_from_before_the_first_one_was_not_missing():
    reader, states = read_all(*(packet(k) for k in (5, 3, 6)))
    assert [s and s.sequence for s in states] == [5, None, 6]
    assert (reader.statistics.reordered, reader.statistics.missing) == (1, 0)


def test_a_number_far_ahead_is_rejected_and_later_packets_are_accepted():
    reader, states = read_all(packet(1), packet(2**31), packet(2))
    assert states[1] is None
    assert states[2].sequence == 2
    assert reader.statistics.implausible == 1


def test_broken_packets_are_counted_and_dropped():
    whole = packet(2)
    wrong = whole[:30] + bytes([whole[30] ^ 1]) + whole[31:]
    reader, states = read_all(packet(1), wrong, whole[:-3], b"", b"\x01", whole)
    assert [s is not None for s in states] == [True, False, False, False, False, True]
    assert reader.statistics.broken == 4


def test_the_drone_s_clock_never_runs_backwards_but_may_wrap():
    reader, states = read_all(
        packet(1, clock=2047.99), packet(2, clock=2047.90), packet(3, clock=0.01), every=0.02
    )
    assert states[1] is None
    assert states[2].vehicle_time == pytest.approx(2048.01, abs=1e-4)
    assert reader.statistics.implausible == 1


def test_a_height_that_jumps_in_flight_is_rejected():
    reader, states = read_all(packet(1), packet(2, height=3.0), packet(3, height=1.02))
    assert [s and s.height for s in states] == [1.0, None, 1.02]
    assert reader.statistics.implausible == 1
    # At most 5 m/s, here for 20 ms, and a tolerance of 0.1 m.
    for height, accepted in ((1.19, True), (1.21, False), (0.81, True), (0.79, False)):
        _, states = read_all(packet(1), packet(2, height=height), every=0.02)
        assert (states[1] is not None) is accepted
    # On the ground it may jump, because a drone may be carried.
    on_ground = [packet(k, height=z, state=0) for k, z in ((1, 0.0), (2, 2.0))]
    assert read_all(*on_ground)[1][1].height == 2.0


@pytest.mark.parametrize(
    ("state", "silence", "anew"),
    [
        (State.FLYING, 5.0, False),  # An old packet is replayed.
        (State.FLYING | State.COM_WATCHDOG, 0.01, False),  # The bit changes rapidly in real logs.
        (State.FLYING | State.COM_WATCHDOG, 1.0, True),
        (State.FLYING | State.BOOTSTRAP, 0.01, True),
    ],
)
def test_numbers_may_restart_only_when_the_drone_reports_the_cause(state, silence, anew):
    reader, _ = read_all(packet(100))
    assert (reader.accept(packet(1, state=state), silence) is not None) is anew
    assert reader.restarts == int(anew)


def test_a_state_is_flying_only_under_control():
    phases = {2: (False, True), 3: (True, False), 4: (True, False), 8: (False, False)}
    for major, (flying, landed) in phases.items():
        bits = 0 if major == 2 else int(State.FLYING)
        one = Navdata(bits, 1, demo=replace(FLYING, major=major))
        state = NavdataReader().accept(build_navdata(one), 0.0)
        assert (state.flying, state.landed) == (flying, landed)


@pytest.mark.parametrize(
    ("bit", "says"),
    [
        (State.ULTRASOUND_DEAF, "no echo"),
        (State.MOTORS_PROBLEM, "motor"),
        (State.CUTOUT, "stopped"),
        (State.ANGLES_OUT_OF_RANGE, "tilted"),
        (State.SOFTWARE_FAULT, "program"),
        (State.TOO_MUCH_WIND, "wind"),
        (State.BATTERY_LOW, "battery"),
    ],
)
def test_a_fault_reported_by_the_drone_ends_a_flight(bit, says):
    sound, troubled = read_all(packet(1), packet(2, state=State.FLYING | bit))[1]
    assert sound.fault is None
    with pytest.raises(FlightAbortedError, match=rf"reports that .*{says}"):
        Watch(Limits()).check(troubled, troubled.time)


def real_packets():
    data = flight_path("ardrone2_full_navdata_expD_every12.lp32").read_bytes()
    place = 0
    while place < len(data):
        (length,) = struct.unpack_from("<I", data, place)
        yield data[place + 4 : place + 4 + length]
        place += 4 + length


#: The recording has every 12th of 200 packets a second.
BETWEEN = 0.06


def replayed():
    """The states of the real flight, as the client's reader gives them."""
    reader, states = NavdataReader(), []
    for number, data in enumerate(real_packets()):
        state = reader.accept(data, BETWEEN * number)
        if state is not None:
            states.append(state)
    return reader, states


def test_a_recorded_flight_is_read_without_errors():
    reader, states = replayed()
    statistics = reader.statistics
    assert statistics.packets == 500
    assert statistics.broken <= 1
    assert len(states) >= 498
    assert statistics.implausible == statistics.reordered == statistics.restarts == 0
    assert all(0 < state.battery <= 100 for state in states)
    assert {state.flying for state in states} == {True, False}
    assert all(state.fault is None for state in states)
    flown = [state for state in states if state.flying]
    assert min(state.height for state in flown) > 0.6
    assert max(state.height for state in flown) < 1.4
    # The reported speed is the derivative of the height.
    time = np.array([state.vehicle_time for state in flown])
    height = np.array([state.height for state in flown])
    climb = np.array([state.climb for state in flown])
    assert np.corrcoef(np.gradient(height, time), climb)[0, 1] > 0.8


@pytest.mark.survey
def test_a_recorded_flight_divides_into_link_delay_and_vehicle_lag():
    # P control with gain 1 around 1 m, 200 Hz. The command is not recorded; it is computed from
    # the height, which the ground station had. Independent fits: link 0.07 to 0.12 s, the
    # vehicle's own loop 0.2 to 0.37 s; every 12th packet gives the former within half of 60 ms.
    flown = [state for state in replayed()[1] if state.flying]
    time = np.array([state.vehicle_time for state in flown])
    time -= time[0]
    columns = np.array([[s.climb_setpoint, s.climb, s.height] for s in flown]).T
    rows = (time > 0.6) & (time < 13.5)  # Before the reference changes.
    telemetry = telemetry_of((time[rows], *columns[:, rows]), time[rows], 1.0 - columns[2][rows])
    split = split_delay([telemetry])
    low, high = split.transport.ci(0.95)
    assert low < 0.12
    assert high > 0.07
    assert split.transport.delay == pytest.approx(0.095, abs=0.5 * BETWEEN + 0.03)
    assert split.transport.gain == pytest.approx(1.0, abs=0.15)
    assert 0.2 < split.vehicle_delay < 0.37
    late = "delay+time_constant" if "delay" in split.vehicle.free else "time_constant"
    low, high = split.vehicle.ci(0.95, late)
    assert 0.2 < low < high < 0.45
