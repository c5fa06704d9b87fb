"""Commands to the drone: their bytes as known clients send them, and what is never sent."""

import math
import struct

import pytest
from deadtime.links import UnitCommand
from deadtime.links.ardrone2.commands import (
    Calibrate,
    Config,
    ConfigIds,
    Control,
    FlatTrim,
    Hover,
    Move,
    MoveFrom,
    Other,
    Ref,
    Watchdog,
    decode,
    encode,
)
from hypothesis import given, strategies as st

GOLDEN = [
    (7, Move(gaz=0.5), b"AT*PCMD=7,1,0,0,1056964608,0\r"),
    (8, Move(gaz=-0.8), b"AT*PCMD=8,1,0,0,-1085485875,0\r"),
    (3, Ref(take_off=True), b"AT*REF=3,290718208\r"),
    (4, Ref(), b"AT*REF=4,290717696\r"),
    (5, Ref(emergency=True), b"AT*REF=5,290717952\r"),
    (
        9,
        MoveFrom(gaz=0.5, heading=0.25, accuracy=0.1),
        b"AT*PCMD_MAG=9,1,0,0,1056964608,0,1048576000,1036831949\r",
    ),
    (
        10,
        ConfigIds("00000000", "00000001", "00000002"),
        b'AT*CONFIG_IDS=10,"00000000","00000001","00000002"\r',
    ),
    (11, Calibrate(0), b"AT*CALIB=11,0\r"),
    (12, Control(5), b"AT*CTRL=12,5,0\r"),
    (13, FlatTrim(), b"AT*FTRIM=13\r"),
    (14, Watchdog(), b"AT*COMWDG=14\r"),
    (
        15,
        Config("general:navdata_demo", "TRUE"),
        b'AT*CONFIG=15,"general:navdata_demo","TRUE"\r',
    ),
    (16, Other("PMODE", ("2",)), b"AT*PMODE=16,2\r"),
]

FLOATS = [
    (0.0, 0),
    (-0.0, -2147483648),
    (0.05, 1028443341),
    (-0.05, -1119040307),
    (0.1, 1036831949),
    (-0.1, -1110651699),
    (0.2, 1045220557),
    (-0.2, -1102263091),
    (0.5, 1056964608),
    (-0.5, -1090519040),
    (0.65, 1059481190),
    (-0.8, -1085485875),
    (1.0, 1065353216),
    (-1.0, -1082130432),
]


def single(value):
    return struct.unpack("<f", struct.pack("<f", value))[0]


@pytest.mark.parametrize(("sequence", "command", "line"), GOLDEN, ids=lambda x: str(x)[:30])
def test_commands_are_written_as_known_clients_write_them(sequence, command, line):
    assert encode([command], sequence) == line
    ((number, read),) = decode(line)
    assert (number, type(read)) == (sequence, type(command))
    assert encode([read], number) == line


def test_several_commands_share_a_datagram_in_order():
    datagram = encode([Ref(take_off=True), Hover, Watchdog()], 41)
    assert datagram == b"AT*REF=41,290718208\rAT*PCMD=42,0,0,0,0,0\rAT*COMWDG=43\r"
    assert decode(datagram) == [(41, Ref(take_off=True)), (42, Hover), (43, Watchdog())]


@pytest.mark.parametrize(("value", "token"), FLOATS)
def test_numbers_are_the_bits_of_single_precision(value, token):
    line = encode([Move(gaz=value)], 1)
    assert line.split(b",")[4] == str(token).encode()


def test_commands_of_other_clients_are_decoded():
    wild = (
        b"AT*PMODE=1,2\rAT*MISC=2,2,20,2000,3000\rAT*REF=0,512\nAT*REF=1,256\r\n"
        b"AT*PCMD=3,3,-2147483648,0,0,0\rAT*FTRIM=4,\r"
    )
    assert decode(wild) == [
        (1, Other("PMODE", ("2",))),
        (2, Other("MISC", ("2", "20", "2000", "3000"))),
        (0, Ref(take_off=True)),
        (1, Ref(emergency=True)),
        (3, Move(flag=3)),
        (4, FlatTrim()),
    ]


@pytest.mark.parametrize(
    "broken",
    [
        "PCMD=2,1,0,0,0",
        "PCMD=2,1,0,0,2143289344,0",
        "PCMD=2,1,0,0,2139095040,0",
        "PCMD=2,1,0,0,-8388608,0",
        "PCMD=2,1,0,0,0.5,0",
        "REF=2",
        "REF=2,x",
        "REF=-1,512",
        "CONFIG=2,a:b,c",
        "=2,1",
        "",
    ],
)
def test_malformed_commands_are_skipped_and_their_neighbours_decoded(broken):
    datagram = f"AT*REF=1,512\rAT*{broken}\rAT*COMWDG=3\r".encode()
    assert decode(datagram) == [(1, Ref(take_off=True)), (3, Watchdog())]


def test_a_truncated_command_is_skipped():
    assert decode(b"AT*COMWDG=1\rAT*PCMD=2,1,0,0,105696460") == [(1, Watchdog())]


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf, 1.0000001, -1.5, 1e300])
@pytest.mark.parametrize("axis", ["roll", "pitch", "gaz", "yaw"])
def test_a_motion_outside_its_range_cannot_be_built(axis, bad):
    with pytest.raises(ValueError, match="command="):
        Move(**{axis: bad})
    with pytest.raises(ValueError, match="command="):
        MoveFrom(**{axis: bad})


@pytest.mark.parametrize(
    ("command", "says"),
    [
        (Config("a:b", "c\r"), "value contains the byte 0x0d"),
        (Config('a"b', "c"), "key contains the byte 0x22"),
        (Config("a:b", "é"), "value contains the byte 0xc3"),
        (Config("a:b", "c" * 1024), "1045 bytes are too many, because at most 1024 are allowed"),
        (Other("PCMD", ("1", "0", "0", "2139095040", "0")), '"PCMD" is not the name'),
        (Other("LED", ("1,2",)), "argument contains the byte 0x2c"),
        (Move(flag=2**31), "a command from 1 on"),
        (Control(2**40), "a command from 1 on"),
    ],
)
def test_commands_that_cannot_be_encoded_are_refused(command, says):
    with pytest.raises(ValueError, match=says):
        encode([command], 1)


def test_sequence_numbers_have_31_bits():
    assert decode(encode([Watchdog()], 2**31 - 1)) == [(2**31 - 1, Watchdog())]
    for first in (-1, 2**31, 2**32):
        with pytest.raises(ValueError, match=r"sequence|a command from"):
            encode([Watchdog()], first)


@given(st.floats(allow_nan=True, allow_infinity=True))
def test_any_number_becomes_a_command_or_is_refused(value):
    if math.isfinite(value) and abs(value) <= 1.0:
        token = int(encode([Move(gaz=UnitCommand(value))], 1).split(b",")[4])
        sent = struct.unpack("<f", struct.pack("<i", token))[0]
        assert -1.0 <= sent <= 1.0
        assert sent == single(value)
    else:
        with pytest.raises(ValueError, match="command="):
            Move(gaz=value)
    if math.isfinite(value):
        assert -1.0 <= Move(gaz=UnitCommand.saturated(value)).gaz <= 1.0
    else:
        with pytest.raises(ValueError, match="command="):
            UnitCommand.saturated(value)


@given(st.lists(st.integers(-(2**31), 2**31 - 1), min_size=4, max_size=4), st.integers(0, 7))
def test_any_tokens_are_decoded_as_commands_in_range_or_skipped(tokens, flag):
    line = f"AT*PCMD=1,{flag},{','.join(map(str, tokens))}\r".encode()
    sent = [struct.unpack("<f", struct.pack("<i", token))[0] for token in tokens]
    read = decode(line)
    assert bool(read) == all(map(math.isfinite, sent))
    for _, move in read:
        values = (move.roll, move.pitch, move.gaz, move.yaw)
        assert all(type(value) is UnitCommand and abs(value) <= 1.0 for value in values)
        assert list(values) == [max(-1.0, min(1.0, value)) for value in sent]


UNITS = st.floats(-1.0, 1.0, width=32).map(UnitCommand)
FLAGS = st.integers(-(2**31), 2**31 - 1)
TEXTS = st.text(st.characters(min_codepoint=32, max_codepoint=126, exclude_characters='"'))
COMMANDS = st.one_of(
    st.builds(Ref, st.booleans(), st.booleans()),
    st.builds(Move, UNITS, UNITS, UNITS, UNITS, FLAGS),
    st.builds(MoveFrom, UNITS, UNITS, UNITS, UNITS, UNITS, UNITS, FLAGS),
    st.builds(Config, TEXTS, TEXTS),
    st.builds(ConfigIds, TEXTS, TEXTS, TEXTS),
    st.builds(Control, FLAGS),
    st.just(Watchdog()),
    st.just(FlatTrim()),
    st.builds(Calibrate, FLAGS),
    st.builds(
        Other,
        st.sampled_from(["PMODE", "MISC", "LED", "ANIM"]),
        st.lists(st.integers().map(str), max_size=4).map(tuple),
    ),
)


@given(st.lists(COMMANDS, max_size=4), st.integers(0, 2**31 - 5))
def test_encoded_commands_are_decoded_unchanged(commands, first):
    try:
        datagram = encode(commands, first)
    except ValueError:
        assert sum(len(str(command)) for command in commands) > 600  # It exceeds 1024 bytes.
        return
    assert decode(datagram) == list(enumerate(commands, first))


@given(st.binary(max_size=300))
def test_any_bytes_are_decoded_without_error(datagram):
    for sequence, command in decode(datagram):
        assert 0 <= sequence < 2**31
        assert command is not None


@given(st.lists(st.sampled_from([line for _, _, line in GOLDEN]), min_size=1), st.data())
def test_damaged_datagrams_are_decoded_without_error(lines, data):
    damaged = bytearray(b"".join(lines))
    for _ in range(data.draw(st.integers(1, 4))):
        damaged[data.draw(st.integers(0, len(damaged) - 1))] = data.draw(st.integers(0, 255))
    for _, command in decode(bytes(damaged)):
        if isinstance(command, Move):
            assert all(abs(value) <= 1 for value in (command.roll, command.gaz, command.yaw))
