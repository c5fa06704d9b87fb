"""The drone's settings as text, and the packets of a loop over UDP."""

import math
import struct
from dataclasses import replace

import pytest
from deadtime._base.errors import PacketError
from deadtime.links.ardrone2.configuration import parse_configuration, write_configuration
from deadtime.links.udp.packets import LoopPacket, decode_doubles, encode_doubles
from hypothesis import given, strategies as st

ANSWER = LoopPacket(9, 100.0, 8, 12.5, 1e-4, value=0.5, reference=1.0, flags=3)


def test_settings_are_read_with_their_sections():
    dump = (
        b"general:navdata_demo = TRUE\ncontrol:control_vz_max = 7.000000e+02\r\n\n"
        b"control:accs_gains = { 9.8e-01 -1.2e-02 }\ncustom:application_desc = \n\0"
    )
    assert parse_configuration(dump) == {
        "general:navdata_demo": "TRUE",
        "control:control_vz_max": "7.000000e+02",
        "control:accs_gains": "{ 9.8e-01 -1.2e-02 }",
        "custom:application_desc": "",
    }


@pytest.mark.parametrize(
    ("dump", "says"),
    [
        (b"a:b = c\n", "the NUL byte at the end of the configuration is missing, at byte 8"),
        (
            b"a:b = c\n\0a:d = e\n\0",
            "bytes after the NUL byte that ends the configuration, at byte 9",
        ),
        (b"a:b = c\nnonsense\n\0", 'does not have the form "section:key = value", at byte 8'),
        (b"b = c\n\0", "at byte 0"),
        (b"a:b = \xff\n\0", "not UTF-8 text, at byte 6"),
        (b"a:b = \x1b[2J\n\0", "at byte 0"),
        (b"a:b = 1\na:b = 2\n\0", "the key a:b has two different values, at byte 8"),
        (
            b"a:b = c\n" * 3000 + b"\0",
            "24001 bytes are too many, because at most 16384 are allowed",
        ),
    ],
)
def test_invalid_configurations_are_refused_with_the_reason(dump, says):
    with pytest.raises(PacketError, match=says):
        parse_configuration(dump)


@pytest.mark.parametrize(
    "settings", [{"ab": "c"}, {"a:b": " c"}, {"a:b": "c\n"}, {"a:b": "c\0"}, {"a b:c": "d"}]
)
def test_settings_that_could_not_be_read_back_are_refused(settings):
    with pytest.raises(ValueError, match="section:key = value"):
        write_configuration(settings)


KEYS = st.from_regex(r"[a-z]{1,8}:[a-z_]{1,12}", fullmatch=True)
VALUES = st.text(st.characters(exclude_categories=["C"]), max_size=30).map(lambda v: v.strip(" \t"))


@given(st.dictionaries(KEYS, VALUES, max_size=20))
def test_settings_survive_a_round_trip(settings):
    assert parse_configuration(write_configuration(settings)) == settings


@given(st.binary(max_size=200))
def test_any_bytes_are_a_configuration_or_refused(dump):
    for whole in (dump, dump + b"\0"):
        try:
            settings = parse_configuration(whole)
        except PacketError:
            continue
        assert all(":" in key for key in settings)


@given(st.data())
def test_damaged_configurations_are_read_or_refused(data):
    damaged = bytearray(write_configuration({f"section:key_{k}": f"value {k}" for k in range(9)}))
    for _ in range(data.draw(st.integers(1, 3))):
        damaged[data.draw(st.integers(0, len(damaged) - 1))] = data.draw(st.integers(0, 255))
    try:
        settings = parse_configuration(bytes(damaged))
    except PacketError:
        return
    assert parse_configuration(write_configuration(settings)) == settings


def test_a_loop_packet_has_its_fields_at_their_offsets():
    packet = ANSWER.encode()
    assert packet[:4] == b"DTL1"
    assert struct.unpack("<3I5d", packet[4:]) == (3, 9, 8, 100.0, 12.5, 1e-4, 0.5, 1.0)
    assert LoopPacket.decode(packet) == ANSWER


@pytest.mark.parametrize("name", ["sent", "echo_sent", "held", "value", "reference"])
@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_loop_packets_hold_finite_numbers(name, bad):
    with pytest.raises(ValueError, match=f"{name}=.*: give a finite number"):
        replace(ANSWER, **{name: bad}).encode()
    packet = bytearray(ANSWER.encode())
    place = 16 + 8 * ["sent", "echo_sent", "held", "value", "reference"].index(name)
    packet[place : place + 8] = struct.pack("<d", bad)
    with pytest.raises(PacketError, match=f"{name}=.*, at byte {place}"):
        LoopPacket.decode(bytes(packet))


def test_invalid_loop_packets_are_refused():
    packet = ANSWER.encode()
    for wrong, says in [
        (b"", "0 bytes instead of 56"),
        (packet[:-1], "55 bytes instead of 56"),
        (packet + b"\0", "57 bytes instead of 56"),
        (b"DTL2" + packet[4:], "the header 0x44544c32 does not belong to a known format"),
        (packet[:32] + struct.pack("<d", -1e-9) + packet[40:], "held=.* is outside of its range"),
    ]:
        with pytest.raises(PacketError, match=says):
            LoopPacket.decode(wrong)
    for part in ({"held": -1.0}, {"sequence": -1}, {"sequence": 2**32}, {"flags": 2**32}):
        with pytest.raises(ValueError, match=r"."):
            replace(ANSWER, **part).encode()


FINITE = st.floats(allow_nan=False, allow_infinity=False)
WORDS = st.integers(0, 2**32 - 1)


@given(
    st.builds(LoopPacket, WORDS, FINITE, WORDS, FINITE, st.floats(0.0, 1e9), FINITE, FINITE, WORDS)
)
def test_loop_packets_survive_a_round_trip(packet):
    assert LoopPacket.decode(packet.encode()) == packet


@given(st.binary(max_size=80))
def test_any_bytes_are_a_loop_packet_or_refused(data):
    for packet in (data, b"DTL1" + data[:52].ljust(52, b"\0")):
        try:
            read = LoopPacket.decode(packet)
        except PacketError:
            continue
        assert read.encode() == packet
        assert all(map(math.isfinite, (read.sent, read.value, read.reference)))


def test_bare_doubles_have_the_layout_of_simulink():
    assert encode_doubles([1.0, -2.5]) == bytes.fromhex("000000000000f03f00000000000004c0")
    assert decode_doubles(encode_doubles([1.0, -2.5]), 2) == (1.0, -2.5)
    for data, count in [(bytes(15), 1), (bytes(16), 1), (bytes(16), 3), (b"", 1)]:
        with pytest.raises(PacketError, match="bytes instead of"):
            decode_doubles(data, count)
    with pytest.raises(PacketError, match="give a finite number, at byte 8"):
        decode_doubles(struct.pack("<2d", 1.0, math.nan), 2)
    with pytest.raises(ValueError, match="value=inf"):
        encode_doubles([math.inf])


@given(st.lists(FINITE, max_size=20))
def test_doubles_survive_a_round_trip(values):
    assert list(decode_doubles(encode_doubles(values), len(values))) == values


@given(st.binary(max_size=64))
def test_any_bytes_are_doubles_or_refused(data):
    try:
        values = decode_doubles(data, len(data) // 8)
    except PacketError:
        return
    assert encode_doubles(values) == data
