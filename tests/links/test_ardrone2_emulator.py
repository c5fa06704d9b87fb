"""The emulated AR.Drone 2.0 without sockets: links, states, watchdogs."""

import pytest
from deadtime.links.ardrone2.commands import (
    Config,
    Control,
    FlatTrim,
    Move,
    Other,
    Ref,
    Watchdog,
    encode,
)
from deadtime.links.ardrone2.emulator import (
    Drone,
    EmulatorOptions,
    Phase,
)
from deadtime.links.ardrone2.emulator.motion import GRAVITY
from deadtime.links.ardrone2.navdata import parse_navdata
from pilot import COMMANDS, DOWN, NAVDATA, UP, Pilot

# --- the link --------------------------------------------------------------------------------


def test_the_handshake_leads_from_packets_of_24_bytes_to_navdata():
    pilot = Pilot()
    (packet,) = pilot.wake()
    assert len(packet) == 24
    assert packet[:4] == bytes.fromhex("88776655")
    first = parse_navdata(packet)
    assert first.bootstrap
    assert first.com_watchdog
    assert first.sequence == 1
    pilot.wait(1.0)
    assert len(pilot.sent) == 1  # The drone sends nothing before the handshake.
    pilot.send(Config("general:navdata_demo", "TRUE"))
    pilot.wait(0.1, Watchdog())
    assert not pilot.last.bootstrap
    assert pilot.last.command_acknowledged
    assert pilot.last.demo_mode
    pilot.wait(0.1, Control(5))
    assert not pilot.last.command_acknowledged
    assert not pilot.last.com_watchdog
    numbers = [parse_navdata(packet).sequence for packet in pilot.sent]
    assert numbers == list(range(1, len(numbers) + 1))


@pytest.mark.parametrize("wake", [b"\x01", b"\x01\x0d", b"\x01\x00\x00\x00"])
def test_wake_ups_of_one_two_and_four_bytes_are_answered(wake):
    assert len(Pilot().wake(wake)) == 1


@pytest.mark.parametrize(
    "wake", [b"", b"\x00", b"\x02\x00\x00\x00", b"\x01\x00\x00", b"\x01" * 500]
)
def test_other_datagrams_on_the_navdata_port_are_not_answered(wake):
    assert Pilot().wake(wake) == []


def test_a_flood_of_wake_ups_is_answered_twenty_times_a_second():
    pilot = Pilot()
    for _ in range(1000):
        pilot.time = round(pilot.time + 0.001, 6)
        pilot.wake(b"\x01")
    assert len(pilot.sent) == 20
    assert sum(map(len, pilot.sent)) <= 24 * 1000


def test_navdata_go_to_the_socket_from_which_the_commanding_host_asked_last():
    """A client that wakes the drone from a new socket receives navdata there."""
    pilot, other = Pilot().connect(), ("127.0.0.1", 50000)
    pilot.wait(0.5, Watchdog())
    pilot.wake(b"\x01", ("10.0.0.9", 50000))  # Another host never receives navdata.
    listeners = []
    for source in (NAVDATA, other, NAVDATA):
        pilot.drone.woken(b"\x01", source, pilot.time)
        for _ in range(25):
            pilot.send(Watchdog())
            pilot.time = round(pilot.time + 0.02, 6)
            pilot.drone.advance(pilot.time)
            listeners += [address for _, address in pilot.drone.packets(pilot.time)]
    changes = [
        one for one, before in zip(listeners, [None, *listeners], strict=False) if one != before
    ]
    assert changes == [NAVDATA, other, NAVDATA]
    pilot.time += 3.0  # Nobody sends anything.
    pilot.drone.advance(pilot.time)
    pilot.take()
    pilot.drone.woken(b"\x01", other, pilot.time)
    assert [address for _, address in pilot.drone.packets(pilot.time)] == [other]


@pytest.mark.parametrize("waits", [False, True])
def test_navdata_go_to_the_host_of_the_commands(waits):
    pilot, elsewhere = Pilot(), ("127.0.0.2", 40001)
    pilot.wake(source=elsewhere)
    if waits:
        pilot.wake()
    pilot.send(Config("general:navdata_demo", "FALSE"))
    if not waits:
        pilot.wake()
    assert len(pilot.sent) == 1  # This answers the wake-up of the other host.
    received = []
    for _ in range(50):
        pilot.drone.commanded(encode([Watchdog()], pilot.number), COMMANDS, pilot.time)
        pilot.number += 1
        pilot.time = round(pilot.time + 0.02, 6)
        pilot.drone.advance(pilot.time)
        received += pilot.take()
    assert {address for _, address in received} == {NAVDATA}
    numbers = [parse_navdata(packet).sequence for packet, _ in received]
    assert numbers == list(range(1, 201))


def test_navdata_stop_two_seconds_after_the_last_datagram():
    pilot = Pilot().connect(demo=False)
    pilot.wait(1.0, Watchdog())
    silent = pilot.time
    pilot.wait(5.0)
    # The last command was at 1 s, so the packet due at 3 s is not sent.
    assert parse_navdata(pilot.sent[-1]).clock == pytest.approx(silent + 1.995, abs=1e-9)
    assert len(pilot.wake()[-1]) == 24  # The drone waits for a new handshake.


def test_only_rising_sequence_numbers_are_accepted():
    def ups(numbers):
        drone = Drone(EmulatorOptions())
        for number, command in numbers:
            drone.commanded(encode([command], number), COMMANDS, 0.0)
        return drone.truth(0.0).phase is Phase.TAKING_OFF

    assert ups([(0, UP)])  # Some clients begin at 0.
    assert ups([(1, DOWN), (2, UP)])
    assert not ups([(5, DOWN), (5, UP)])  # Not above the last number.
    assert not ups([(5, DOWN), (4, UP)])
    assert not ups([(1, DOWN), (0, UP)])
    assert ups([(500, DOWN), (1, UP)])  # Number 1 restarts the sequence.
    assert ups([(5, DOWN), (900, UP)])  # Gaps are only losses.


def test_after_two_seconds_without_commands_any_number_is_accepted():
    drone = Drone(EmulatorOptions())
    drone.commanded(encode([DOWN], 100), COMMANDS, 0.0)
    drone.commanded(encode([UP], 7), COMMANDS, 1.999999)
    assert drone.truth(1.999999).phase is Phase.LANDED
    drone.commanded(encode([UP], 7), COMMANDS, 2.0)
    assert drone.truth(2.0).phase is Phase.TAKING_OFF


def test_commands_without_effect_here_are_accepted():
    pilot = Pilot().connect()
    pilot.send(Other("PMODE", ("1", "2")), Other("MISC", ("2", "2", "20", "2000", "3000")))
    pilot.send(FlatTrim(), Other("LED", ("1", "0", "1")), Other("ANIM", ("16", "5")))
    before = pilot.number
    pilot.drone.commanded(b"AT*REF=nonsense\rAT*PCMD=1\r\xff\x00", COMMANDS, pilot.time)
    assert pilot.truth.phase is Phase.LANDED
    pilot.send(UP)
    assert pilot.number == before + 1
    assert pilot.truth.phase is Phase.TAKING_OFF


# --- states ----------------------------------------------------------------------------------


def test_take_off_and_landing_take_the_time_of_the_real_vehicle():
    pilot = Pilot().connect(demo=False)
    pilot.wait(4.5, UP)
    assert pilot.truth.phase is Phase.TAKING_OFF  # Measured from the first of them, at 0.02 s.
    pilot.wait(0.02, UP)
    assert pilot.truth.phase is Phase.FLYING
    assert pilot.truth.height == pytest.approx(0.75, abs=0.02)
    pilot.wait(3.0, UP)
    assert pilot.last.flying
    assert pilot.truth.height == pytest.approx(0.75, abs=0.02)
    assert pilot.truth.climb == pytest.approx(0.0, abs=1e-6)
    pilot.wait(4.0, DOWN)
    assert pilot.truth.phase is Phase.LANDED
    assert pilot.truth.height == 0.0
    assert not pilot.last.flying
    states = [parse_navdata(packet).demo for packet in pilot.sent if len(packet) > 24]
    majors = [demo.major for demo in states]
    assert [m for m, n in zip(majors, [*majors[1:], None], strict=True) if m != n] == [
        2, 6, 7, 4, 8, 2,
    ]  # fmt: skip
    assert all(demo.vz == 0.0 for demo in states)


def test_a_ref_with_bits_eight_and_nine_alone_is_accepted():
    drone = Drone(EmulatorOptions())
    drone.commanded(b"AT*REF=0,512\r", COMMANDS, 0.0)
    assert drone.truth(0.0).phase is Phase.TAKING_OFF
    drone.commanded(b"AT*REF=1,256\r", COMMANDS, 0.1)
    assert drone.truth(0.1).emergency


def test_clearing_the_take_off_bit_lands_the_drone():
    pilot = Pilot()
    pilot.wait(2.0, UP)
    pilot.send(DOWN)
    assert pilot.truth.phase is Phase.LANDING


def test_an_emergency_cuts_the_motors_and_toggles_on_the_rising_edge():
    pilot = Pilot().connect(demo=False).fly()
    begun = pilot.truth.height
    pilot.wait(0.2, Ref(take_off=True, emergency=True))  # The bit is held, so there is one edge.
    truth = pilot.truth
    assert truth.emergency
    assert truth.phase is Phase.FALLING
    fallen = 0.2 - 0.02  # Measured from the first of those commands.
    assert truth.height == pytest.approx(begun - 0.5 * GRAVITY * fallen**2, abs=1e-9)
    assert truth.climb == pytest.approx(-GRAVITY * fallen, abs=1e-9)
    pilot.wait(1.0, UP)  # No command has an effect.
    assert pilot.truth.phase is Phase.LANDED
    assert pilot.last.emergency
    assert pilot.last.demo.major == 2
    pilot.send(Ref(emergency=True))
    pilot.send(DOWN)
    assert not pilot.truth.emergency
    pilot.send(UP)
    assert pilot.truth.phase is Phase.TAKING_OFF


@pytest.mark.parametrize("worst_case", [True, False])
def test_after_an_automatic_landing_only_the_worst_case_obeys_an_unchanged_take_off_bit(worst_case):
    pilot = Pilot(worst_case=worst_case).fly()
    pilot.wait(9.0)
    assert pilot.truth.phase is Phase.LANDED
    pilot.wait(1.0, UP)  # The client is back and still sets the take-off bit.
    assert pilot.truth.phase is (Phase.TAKING_OFF if worst_case else Phase.LANDED)
    pilot.wait(6.0, DOWN)
    pilot.send(UP)
    assert pilot.truth.phase is Phase.TAKING_OFF


def test_a_new_client_may_begin_with_take_off():
    pilot = Pilot().fly()
    pilot.wait(9.0)
    pilot.number = 1
    pilot.send(UP)
    assert pilot.truth.phase is Phase.TAKING_OFF


def test_the_take_off_bit_of_the_last_client_is_dropped_with_its_numbers():
    pilot = Pilot().connect().fly()
    pilot.wait(20.0)
    assert pilot.truth.phase is Phase.LANDED
    pilot.number = 1
    pilot.send(FlatTrim())  # The first command of the new client is not a REF.
    assert pilot.wait(6.0, UP).phase is Phase.FLYING


def test_numbers_that_begin_at_0_belong_to_one_client():
    pilot = Pilot().connect().fly()
    pilot.number = 0
    pilot.drone.commanded(b"AT*REF=0,256\rAT*REF=1,256\r", COMMANDS, pilot.time + 3.0)
    assert pilot.drone.truth(pilot.time + 3.0).emergency


def test_a_low_battery_is_reported_and_prevents_take_off():
    low = Pilot(battery=19.9).connect(demo=False)
    low.wait(1.0, UP)
    assert low.last.battery_low
    assert low.truth.phase is Phase.LANDED


@pytest.mark.survey
def test_an_empty_battery_ends_a_flight():
    pilot = Pilot(battery=20.5).connect(demo=False)
    pilot.wait(130.0, UP, every=0.5)
    assert pilot.truth.phase in (Phase.LANDING, Phase.LANDED)
    assert pilot.last.battery_low
    assert pilot.truth.battery < 4.0


def test_a_failed_ultrasonic_sensor_is_reported():
    pilot = Pilot().connect(demo=False)
    pilot.drone.no_echo = True
    pilot.wait(0.1, Watchdog())
    assert pilot.last.ultrasound_deaf


# --- watchdogs, to the microsecond -----------------------------------------------------------


def test_unless_worst_case_the_drone_hovers_a_quarter_second_after_the_last_motion_command():
    pilot = Pilot(delay=0.1, worst_case=False).fly()
    pilot.wait(1.0, UP, Move(gaz=0.5))
    last = pilot.time
    assert pilot.truth.setpoint == pytest.approx(0.35)
    # Commands that only keep the link alive do not prolong the motion.
    pilot.wait(0.249, Watchdog(), every=0.01)
    assert pilot.truth.setpoint == pytest.approx(0.35)
    pilot.wait(0.000999)
    assert pilot.drone.truth(last + 0.249999).setpoint != 0.0
    assert pilot.drone.truth(last + 0.25).setpoint == 0.0
    assert pilot.drone.truth(last + 0.25).phase is Phase.FLYING


def test_commands_in_transit_are_dropped_with_the_motion():
    pilot = Pilot(plant="paper", worst_case=False).fly()  # The transport takes 0.36 s.
    pilot.send(UP, Move(gaz=1.0))
    for _ in range(100):
        pilot.wait(0.01)
        assert pilot.truth.setpoint == 0.0


@pytest.mark.parametrize("kept_alive", [False, True])
def test_in_the_worst_case_a_motion_holds_until_the_link_is_lost(kept_alive):
    """Some clients send one command and expect the drone to follow it for seconds."""
    pilot = Pilot(delay=0.1).fly()
    pilot.wait(0.02, UP, Move(gaz=0.2))
    last = pilot.time
    if kept_alive:
        pilot.wait(6.0, Watchdog(), every=0.1)
        assert pilot.truth.setpoint == pytest.approx(0.14)
        last = pilot.time
    assert pilot.drone.truth(last + 1.999999).setpoint == pytest.approx(0.14)
    truth = pilot.drone.truth(last + 2.0)
    assert truth.phase is Phase.LANDING
    assert truth.setpoint < 0.0


def test_commands_in_transit_are_dropped_with_the_link():
    pilot = Pilot(delay=9.0).fly()
    pilot.send(UP, Move(gaz=1.0))
    pilot.wait(5.0)
    assert pilot.truth.phase is Phase.LANDED
    for _ in range(300):
        pilot.wait(0.02, UP)
        assert pilot.truth.phase is not Phase.FLYING or pilot.truth.setpoint == 0.0
    assert pilot.truth.phase is Phase.FLYING


def test_landing_begins_two_seconds_after_the_last_command():
    pilot = Pilot(delay=0.0).connect(demo=False).fly()
    pilot.wait(1.0, UP, Move(gaz=1.0))
    last = pilot.time
    assert pilot.drone.truth(last + 1.999999).phase is Phase.FLYING
    assert not pilot.drone.truth(last + 1.999999).link_lost
    truth = pilot.drone.truth(last + 2.0)
    assert truth.phase is Phase.LANDING
    assert truth.link_lost
    assert truth.setpoint < 0.0
    assert pilot.drone.truth(last + 12.0).phase is Phase.LANDED


def test_the_communication_watchdog_is_reported_after_fifty_milliseconds():
    pilot = Pilot().connect(demo=False)
    pilot.wait(0.1, Watchdog(), every=0.01)
    warned = {}
    for _ in range(20):
        pilot.wait(0.005)
        warned[round(pilot.last.clock - 0.1, 6)] = pilot.last.com_watchdog
    assert {late for late, reported in warned.items() if not reported} == {
        round(0.005 * k, 6) for k in range(1, 11)
    }
    pilot.wait(0.01, Watchdog(), every=0.005)
    assert not pilot.last.com_watchdog


def test_a_lost_link_is_reported_to_clients_that_still_receive():
    pilot = Pilot().connect(demo=False)
    for _ in range(30):
        pilot.wait(0.1)
        pilot.wake()
    assert pilot.last.communication_lost
