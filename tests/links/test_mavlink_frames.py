"""MAVLink frames: golden ones, round trips, damaged ones, and those with a wrong signature."""

import os
import random
import subprocess
import sys

import pytest

pytest.importorskip("pymavlink", reason="pymavlink is the codec")

from deadtime.links.mavlink.codec import Codec, dialect
from deadtime.links.mavlink.senders import Senders
from deadtime.links.mavlink.states import StateReader
from deadtime.links.mavlink.time_sync import TimeSync
from mavlink_frames import crc, damaged
from pymavlink.dialects.v20 import ardupilotmega as d

#: Frames whose bytes are known: a set point from 255/190, a heartbeat of PX4 from 1/1.
SET_POINT = bytes.fromhex(
    "fd35000000ffbe540000e80300000000000000000000000000000000000000000000000000bf00000000000000"
    "00000000000000000000000000c70d0101016e31"
)
HEARTBEAT = bytes.fromhex("fd09000000010100000000000600020c810403d291")

KEY = bytes(range(32))


def flight(seed, count=40, key=None):
    """Frames of a vehicle in flight, by pymavlink alone: what each says, and its bytes."""
    mav = d.MAVLink(None, 1, 1)
    if key is not None:
        mav.signing.secret_key, mav.signing.sign_outgoing = key, True
        mav.signing.timestamp = 1 << 46
    numbers = random.Random(seed)
    frames = []
    for k in range(count):
        x = [numbers.gauss(0.0, 1.0) for _ in range(6)]
        message = numbers.choice(
            [
                d.MAVLink_heartbeat_message(2, 3, numbers.choice([1, 129]), 4, 4, 3),
                d.MAVLink_local_position_ned_message(20 * k, *x),
                d.MAVLink_attitude_message(20 * k, *x),
                d.MAVLink_extended_sys_state_message(0, numbers.choice([1, 2])),
                d.MAVLink_timesync_message(10**9 * k, numbers.getrandbits(60)),
                d.MAVLink_param_value_message(b"GUID_TIMEOUT", x[0], 9, 1, 0),
                d.MAVLink_command_ack_message(400, 0),
            ]
        )
        frames.append(message.pack(mav))
        mav.seq = (mav.seq + 1) % 256
    return frames


def survives(count, seed):
    """Mutated frames through all that reads: each message taken has a right checksum."""
    numbers = random.Random(seed)
    codec, senders, reader, sync = Codec(255, 190), Senders((255, 190)), StateReader(), TimeSync()
    frames, taken = [], 0
    for k in range(count):
        if k % 1000 == 0:
            frames = flight(numbers.random())
        whole = numbers.random() < 0.9
        for message in codec.decode(damaged(numbers.choice(frames), numbers), whole):
            frame = message.get_msgbuf()
            begin = 10 if frame[0] == 0xFD else 6
            end = begin + frame[1]
            right = crc(frame[1:end], d.mavlink_map[message.get_msgId()].crc_extra)
            assert int.from_bytes(frame[end : end + 2], "little") == right
            taken += 1
            if senders.is_vehicle(message):
                reader.take(message, 1e-3 * k)
                if message.get_type() == "TIMESYNC":
                    sync.answered(message.ts1, message.tc1, 1e-3 * k)
    assert sync.link_time is None  # nothing was asked
    assert codec.refused > count // 2
    return taken


def test_known_frames_have_these_bytes():
    codec = Codec(255, 190)
    message = d.MAVLink_set_position_target_local_ned_message(
        1000, 1, 1, 1, 0xDC7, 0, 0, 0, 0, 0, -0.5, 0, 0, 0, 0, 0
    )
    assert codec.encode(message) == SET_POINT
    (heartbeat,) = codec.decode(HEARTBEAT)
    assert (heartbeat.type, heartbeat.autopilot, heartbeat.base_mode) == (2, 12, 0x81)
    assert heartbeat.custom_mode == 0x60000
    assert codec.encode(message)[4] == 1  # the next has the next number


def test_frames_in_pieces_and_between_noise_are_found():
    frames = flight(1)
    stream = b"boot: \x00\xff ready\n" + b"".join(frames)
    codec = Codec(255, 190)
    found = []
    for k in range(0, len(stream), 7):
        found += codec.decode(stream[k : k + 7])
    assert [bytes(one.get_msgbuf()) for one in found] == frames
    assert codec.refused > 0


def test_a_cut_datagram_does_not_swallow_the_next():
    first, second = flight(2, 2)
    codec = Codec(255, 190)
    assert codec.decode(first[:-4], whole=True) == []
    (message,) = codec.decode(second, whole=True)
    assert bytes(message.get_msgbuf()) == second


def test_damaged_frames_are_refused():
    survives(20_000, 3)


@pytest.mark.survey
@pytest.mark.long
def test_a_million_damaged_frames_are_refused():
    survives(1_000_000, 4)


def test_no_single_flipped_bit_is_accepted():
    """A CRC of 16 bits finds every one of them; an unknown number of a message is not believed."""
    codec = Codec(255, 190)
    for frame in (SET_POINT, HEARTBEAT):
        for place in range(8 * len(frame)):
            data = bytearray(frame)
            data[place // 8] ^= 1 << place % 8
            assert codec.decode(bytes(data), whole=True) == []


def test_signed_frames_are_checked():
    codec = Codec(255, 190, KEY)
    frames = flight(5, key=KEY)
    numbers = random.Random(6)
    assert len(codec.decode(frames[0])) == 1
    assert codec.decode(frames[0]) == []  # a replay
    assert codec.decode(flight(5)[1]) == []  # unsigned
    assert codec.decode(flight(5, key=bytes(32))[1]) == []  # by another key
    for _ in range(2000):
        assert codec.decode(damaged(frames[1], numbers), whole=True) == []
    assert len(codec.decode(frames[1])) == 1


def test_a_forged_frame_from_the_future_does_not_shut_the_sender_out():
    forged = d.MAVLink(None, 1, 1)
    forged.signing.secret_key, forged.signing.sign_outgoing = bytes(32), True
    forged.signing.timestamp = (1 << 48) - 2
    codec = Codec(255, 190, KEY)
    frames = flight(7, key=KEY)
    assert len(codec.decode(frames[0])) == 1
    assert codec.decode(d.MAVLink_heartbeat_message(2, 3, 1, 4, 4, 3).pack(forged)) == []
    assert len(codec.decode(frames[1])) == 1


def test_signed_frames_of_this_end_are_accepted_by_pymavlink():
    codec = Codec(255, 190, KEY)
    other = d.MAVLink(None, 1, 1)
    other.signing.secret_key = KEY
    for _ in range(3):
        (message,) = other.parse_buffer(codec.encode(d.MAVLink_timesync_message(0, 9)))
        assert message.get_signed()


def test_the_switch_that_ignores_checksums_is_refused():
    code = "from deadtime.links.mavlink.codec import Codec; Codec(1, 1)"
    done = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, "MAV_IGNORE_CRC": "1"},
        capture_output=True,
        text=True,
    )
    assert "accepts damaged frames" in done.stderr


def test_copies_and_overtaken_positions_are_ignored():
    reader = StateReader()

    def position(ms, z):
        message = d.MAVLink_local_position_ned_message(ms, 0, 0, z, 0, 0, 0)
        message.pack(mav)
        mav.seq += 1
        return message

    mav = d.MAVLink(None, 1, 1)
    for message in (
        d.MAVLink_heartbeat_message(2, 3, 1, 4, 4, 3),
        d.MAVLink_extended_sys_state_message(0, 2),
    ):
        for _ in range(2):  # one alone is not believed
            message.pack(mav)
            mav.seq += 1
            reader.take(message, 0.0)
    assert reader.take(position(1000, -1.0), 1.0).height == 1.0
    assert reader.take(position(1000, -2.0), 1.1) is None
    assert reader.take(position(980, -2.0), 1.1) is None
    assert reader.take(position(1020, -1.1), 1.1).vehicle_time == 1.02


def test_answers_that_nobody_asked_for_do_not_count():
    sync = TimeSync()
    sync.answered(5, 10, 1.0)
    assert sync.link_time is None
    stamp = sync.request(1.0)
    sync.answered(stamp, 3 * 10**9, 1.2)
    sync.answered(stamp, 3 * 10**9, 9.0)
    assert sync.link_time.median == pytest.approx(0.2)
    assert sync.link_time.offset == pytest.approx(3.0 - 1.1)
    sync.request(2.0)
    sync.request(20.0)
    sync.answered(sync.request(21.0), 1, 21.1)
    assert sync.link_time.lost == 1


def test_the_dialect_is_the_one_with_the_messages_of_both_firmwares():
    for name in ("EKF_STATUS_REPORT", "ESTIMATOR_STATUS", "EXTENDED_SYS_STATE", "TIMESYNC"):
        assert hasattr(dialect(), f"MAVLINK_MSG_ID_{name}")
