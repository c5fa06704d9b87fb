"""Navdata: real packets of two firmwares, field offsets, and invalid bytes."""

import math
import struct
from dataclasses import fields, replace
from itertools import pairwise

import pytest
from deadtime._base.errors import LinkError, PacketError
from deadtime._deadtime import navdata_layouts
from deadtime.links.ardrone2 import navdata as reader
from deadtime.links.ardrone2.navdata import (
    DEMO_OPTIONS,
    FULL_OPTIONS,
    Navdata,
    State,
    build_navdata,
    parse_navdata,
)
from deadtime.links.ardrone2.navdata_options import AltitudeOption, Demo, KalmanPressure, Pwm
from hypothesis import given, strategies as st
from navdata_packets import BOOTSTRAP, demo_packet, full_packets, older_packet

TAGS = [*range(30)]
FLIGHT = Navdata(
    state=0x0F8000D5,
    sequence=308119,
    vision=1,
    demo=Demo(major=3, battery=68, pitch=-0.02, roll=0.005, yaw=-0.7, height=1.104, vx=0.03),
    clock=680.63446,
    pwm=Pwm(motor1=151, vz_ref=-0.0505),
    altitude=AltitudeOption(altitude_vz=-0.237, altitude_raw=0.696),
    kalman_pressure=KalmanPressure(est_z=1.1, est_zdot=0.237),
    options=FULL_OPTIONS,
)
FULL = build_navdata(FLIGHT)
SHORT = build_navdata(Navdata(0x0F8004D5, 308119, 1, demo=FLIGHT.demo, options=DEMO_OPTIONS))


def checked(packet):
    """The packet with the checksum of its bytes."""
    return packet[:-4] + struct.pack("<I", sum(packet[:-8]))


def test_the_classes_have_the_fields_of_the_native_tables():
    for layout in navdata_layouts():
        tag, names = layout.tag, [name for name, _, _ in layout.fields]
        name, kind = reader._FIELDS[tag]
        if name == "clock":
            assert names == ["time"]
        else:
            assert [field.name for field in fields(kind)] == names, name
    assert len(reader._FIELDS) == len(navdata_layouts())


def test_real_packets_are_decoded_and_encoded_unchanged():
    packets = full_packets()
    broken, numbers, times = [], [], []
    for packet in packets:
        try:
            navdata = parse_navdata(packet)
        except PacketError as error:
            broken.append(str(error))
            continue
        assert build_navdata(navdata) == packet
        assert [tag for tag, _ in navdata.options] == TAGS  # Tags 28 and 29 are not documented.
        assert navdata.demo.vz == 0.0
        assert navdata.kalman_pressure.est_zdot == pytest.approx(-navdata.altitude.altitude_vz)
        assert 0 < navdata.battery <= 100
        assert -1.0 < navdata.height < 3.0
        assert navdata.state & ~0x0F8000F5 == 0
        numbers.append(navdata.sequence)
        times.append(navdata.clock)
    # One packet is broken in the recording.
    assert len(packets) == 500
    assert broken == [
        "navdata: the option of tag 0 has a stated size of 0 bytes, but only 4 to 2174 are "
        "possible, at byte 16"
    ]
    # Every twelfth packet of 200 a second.
    assert all(later > earlier for earlier, later in pairwise(numbers))
    assert all(later > earlier for earlier, later in pairwise(times))
    steps = sorted(
        (later - earlier) / (n - m)
        for (earlier, later), (m, n) in zip(pairwise(times), pairwise(numbers), strict=True)
    )
    assert steps[len(steps) // 2] == pytest.approx(0.005, rel=0.01)


def test_real_packets_show_a_flight():
    _, first, *_, last = full_packets()
    first, last = parse_navdata(first), parse_navdata(last)
    assert not first.flying
    assert first.demo.major == 2
    assert last.flying
    assert not last.emergency
    assert last.demo.major == 3
    assert last.height == pytest.approx(last.kalman_pressure.est_z, abs=2e-3)
    assert last.climb == last.kalman_pressure.est_zdot
    assert abs(last.roll) < 0.2
    assert last.raw_measures.battery_voltage / 1000 == pytest.approx(11.3, abs=1.0)
    assert last.pressure.pressure == pytest.approx(100_000, rel=0.05)
    physical = last.physical_measures
    force = (physical.acceleration_x, physical.acceleration_y, physical.acceleration_z)
    assert math.hypot(*force) == pytest.approx(1.0, abs=0.2)


def test_the_measured_speed_is_the_derivative_of_the_height():
    flight = [parse_navdata(packet) for packet in full_packets()[1:]]
    pairs = [
        ((b.kalman_pressure.est_z - a.kalman_pressure.est_z) / (b.clock - a.clock), a, b)
        for a, b in pairwise(flight)
        if b.sequence - a.sequence == 12
    ]
    errors = sorted(abs(rate - (a.climb + b.climb) / 2) for rate, a, b in pairs)
    assert errors[len(errors) // 2] < 0.05  # m/s, positive up


def test_packets_of_an_older_firmware_are_decoded():
    packet = older_packet()
    navdata = parse_navdata(packet)
    assert len(packet) == 2120
    assert [tag for tag, _ in navdata.options] == TAGS[:28]
    lengths = dict(navdata.options)
    assert [len(lengths[tag]) + 4 for tag in (9, 22, 23)] == [76, 75, 56]
    assert (navdata.battery, navdata.pwm.vz_ref) == (50, 0.0)
    assert build_navdata(navdata) == packet


def test_a_short_packet_is_decoded():
    packet = demo_packet()
    navdata = parse_navdata(packet)
    assert (len(packet), navdata.height, navdata.battery) == (172, 0.995, 68)
    assert navdata.demo_mode
    assert (navdata.climb, navdata.climb_setpoint, navdata.clock) == (None, None, None)
    assert build_navdata(navdata) == packet


def test_a_drone_that_waits_for_configuration_reports_it():
    navdata = parse_navdata(BOOTSTRAP)
    assert navdata.bootstrap
    assert navdata.com_watchdog
    assert not navdata.command_acknowledged
    assert (navdata.sequence, navdata.options, navdata.height) == (1, (), None)
    assert build_navdata(navdata) == BOOTSTRAP


def test_packets_have_the_sizes_of_the_drone_s_own():
    assert len(FULL) == 2190
    assert len(SHORT) == 500
    read = parse_navdata(FULL)
    assert (read.height, read.battery, read.demo.major) == (1.104, 68, 3)
    assert read.clock == 680.63446
    assert read.climb == pytest.approx(0.237)
    assert read.climb_setpoint == pytest.approx(-0.0505)
    assert read.yaw == pytest.approx(-0.7)
    assert (read.state, read.sequence, read.vision) == (0x0F8000D5, 308119, 1)


def test_options_without_bytes_of_their_own_are_added_by_tag():
    added = parse_navdata(build_navdata(replace(FLIGHT, options=((77, b"?"),))))
    assert [tag for tag, _ in added.options] == [77, 0, 1, 9, 10, 24]
    assert [len(body) + 4 for _, body in added.options] == [5, 148, 8, 92, 56, 72]


def test_a_negative_height_is_decoded():
    low = replace(FLIGHT, demo=Demo(height=-3.847))
    assert parse_navdata(build_navdata(low)).height == -3.847


def test_changing_a_field_leaves_the_bytes_around_it():
    packet = full_packets()[1]
    navdata = parse_navdata(packet)
    moved = replace(navdata, demo=replace(navdata.demo, height=2.5), sequence=navdata.sequence + 1)
    again = build_navdata(moved)
    differing = [at for at, (a, b) in enumerate(zip(packet, again, strict=True)) if a != b]
    assert {at for at in differing if at < 2182} <= {8, 9, 10, 11, *range(16 + 24, 16 + 28)}
    assert parse_navdata(again) == replace(moved, options=parse_navdata(again).options)


@pytest.mark.parametrize(
    ("packet", "says"),
    [
        (b"", "0 bytes are too few, because 24 are needed, at byte 0"),
        (FULL[:15], "15 bytes"),
        (FULL[:16], "the last option is not a checksum, at byte 16"),
        (
            b"GET / HTTP/1.1\r\n\r\n......",
            "the header 0x20544547 does not belong to a known format",
        ),
        (FULL[:18] + b"\x03\x00" + FULL[20:], "the option of tag 0 has a stated size of 3 bytes"),
        (FULL[:18] + b"\x00\x00" + FULL[20:], "the option of tag 0 has a stated size of 0 bytes"),
        (
            FULL[:18] + b"\xff\xff" + FULL[20:],
            "the option of tag 0 has a stated size of 65535 bytes",
        ),
        (FULL[:-8], "the last option is not a checksum"),
        (FULL + b"\x00", "the last option is not a checksum"),
        (FULL[:50] + bytes([FULL[50] ^ 8]) + FULL[51:], "the checksum is"),
        (FULL * 5, "10950 bytes are too many, because at most 8192 are allowed"),
    ],
)
def test_invalid_packets_are_refused_with_the_reason(packet, says):
    with pytest.raises(PacketError, match=says):
        parse_navdata(packet)


def test_a_packet_error_is_a_link_error_and_a_value_error():
    with pytest.raises(LinkError):
        parse_navdata(b"")
    with pytest.raises(ValueError, match="at byte 0"):
        parse_navdata(b"")


def test_every_truncated_packet_is_refused():
    for length in range(len(SHORT)):
        with pytest.raises(PacketError):
            parse_navdata(SHORT[:length], checksum=False)


def test_a_wrong_checksum_is_refused_or_reported():
    wrong = FULL[:100] + bytes([FULL[100] ^ 1]) + FULL[101:]
    with pytest.raises(PacketError, match="the checksum is"):
        parse_navdata(wrong)
    told = parse_navdata(wrong, checksum=False)
    assert not told.checksum_matches
    assert parse_navdata(checked(wrong)).checksum_matches


@pytest.mark.parametrize(
    "part",
    [
        {"demo": Demo(height=math.nan)},
        {"demo": Demo(pitch=math.inf)},
        {"demo": Demo(height=3e6)},
        {"demo": Demo(battery=-1)},
        {"demo": Demo(major=2**16)},
        {"clock": -1.0},
        {"clock": math.nan},
        {"pwm": Pwm(vz_ref=1e300)},
        {"pwm": Pwm(motor1=256)},
        {"state": 2**32},
        {"sequence": -1},
        {"header": 0},
        {"options": ((0xFFFF, b""),)},
        {"options": ((70000, b""),)},
        {"options": ((7, bytes(8200)),)},
    ],
    ids=str,
)
def test_values_that_do_not_fit_a_packet_are_refused(part):
    with pytest.raises(ValueError, match=r"."):
        build_navdata(replace(FLIGHT, **part))


def test_the_clock_wraps_after_2048_seconds():
    assert parse_navdata(build_navdata(replace(FLIGHT, clock=2050.25))).clock == 2.25


def test_a_field_that_is_not_finite_is_not_passed_on():
    at = 16 + 16  # roll
    packet = checked(SHORT[:at] + struct.pack("<f", math.nan) + SHORT[at + 4 :])
    navdata = parse_navdata(packet)
    assert math.isnan(navdata.demo.roll)
    assert navdata.roll is None
    assert navdata.pitch is not None
    # The option is encoded again bit by bit, though such a value cannot be set.
    assert build_navdata(navdata) == packet


def test_states_are_bits():
    for flag in State:
        navdata = replace(FLIGHT, state=int(flag))
        names = ["flying", "command_acknowledged", "bootstrap", "emergency", "ultrasound_deaf"]
        for name in names:
            assert getattr(navdata, name) == (State[name.upper()] == flag)


@given(st.binary(max_size=600), st.booleans())
def test_any_bytes_are_decoded_or_refused(packet, checksum):
    for data in (
        packet,
        BOOTSTRAP[:16] + packet,
        checked(BOOTSTRAP[:16] + packet + BOOTSTRAP[16:]),
    ):
        try:
            navdata = parse_navdata(data, checksum=checksum)
        except PacketError:
            continue
        assert sum(len(body) + 4 for _, body in navdata.options) == len(data) - 24


@given(st.binary(max_size=100), st.lists(st.tuples(st.integers(0, 40), st.binary(max_size=200))))
def test_any_options_survive_a_round_trip(head, options):
    words = struct.unpack("<3I", head[:12].ljust(12, b"\x00"))
    navdata = Navdata(*words, options=tuple(options))
    if sum(len(body) + 4 for _, body in options) > 8192 - 24:
        return
    packet = build_navdata(navdata)
    read = parse_navdata(packet)
    assert (read.state, read.sequence, read.vision) == words
    assert read.options == navdata.options
    assert build_navdata(read) == packet


@given(st.sampled_from([FULL, SHORT, BOOTSTRAP]), st.data())
def test_damaged_packets_are_decoded_or_refused(packet, data):
    damaged = bytearray(packet)
    for _ in range(data.draw(st.integers(1, 6))):
        damaged[data.draw(st.integers(0, len(damaged) - 1))] = data.draw(st.integers(0, 255))
    packet = checked(bytes(damaged))
    try:
        navdata = parse_navdata(packet)
    except PacketError:
        return
    assert build_navdata(navdata) == packet
    for number in (navdata.roll, navdata.pitch, navdata.climb, navdata.climb_setpoint):
        assert number is None or math.isfinite(number)


def test_any_byte_of_a_real_packet_may_be_damaged():
    packet = full_packets()[1]
    refused = 0
    for at in range(len(packet)):
        damaged = bytearray(packet)
        damaged[at] ^= 0xA5
        with pytest.raises(PacketError):
            parse_navdata(bytes(damaged))
        try:
            parse_navdata(bytes(damaged), checksum=False)
        except PacketError:
            refused += 1
    # Errors occur in the head, the sizes of options and the checksum; other bytes are field values.
    assert 60 < refused < 200
