"""An independent client decodes our packets, and its commands are decoded by us.

`pyardrone` never returns from a packet with an option of no bytes and refuses options that differ
from its own sizes, so the tests give it neither.

"""

import ctypes
import math
import random
import struct
import warnings

import pytest
from deadtime.links.ardrone2 import commands
from deadtime.links.ardrone2.navdata import (
    DEMO_OPTIONS,
    FULL_OPTIONS,
    Navdata,
    build_navdata,
    parse_navdata,
)
from deadtime.links.ardrone2.navdata_options import (
    AltitudeOption,
    Demo,
    KalmanPressure,
    Pressure,
    RawMeasures,
    References,
    VideoStream,
)

with warnings.catch_warnings():
    # Its docstrings have escapes for which Python issues a warning.
    warnings.simplefilter("ignore")
    pytest.importorskip("pyardrone", reason="pyardrone is not installed")
    from pyardrone import at
    from pyardrone.navdata import NavData
    from pyardrone.navdata.options import index

RANDOM = random.Random(8)


def theirs(tag):
    """Bytes that pyardrone decodes as an option, without tag and size."""
    return ctypes.sizeof(index[tag]) - 4 if tag in index else None


#: Options that both decode with the same size.
COMMON = tuple(option for option in FULL_OPTIONS if theirs(option[0]) == len(option[1]))


def random_flight(options):
    def number(size):
        return RANDOM.uniform(-size, size)

    return Navdata(
        state=RANDOM.getrandbits(32),
        sequence=RANDOM.getrandbits(32),
        vision=1,
        demo=Demo(
            minor=RANDOM.getrandbits(16),
            major=RANDOM.getrandbits(16),
            battery=RANDOM.randint(0, 100),
            pitch=number(math.pi),
            roll=number(math.pi),
            yaw=number(math.pi),
            height=number(5.0),
            vx=number(4.0),
            vy=number(4.0),
            frame=RANDOM.getrandbits(32),
        ),
        options=options,
    )


def test_both_decode_most_options():
    assert {0, 1, 2, 6, 8, 10, 16, 19, 21, 24} <= {tag for tag, _ in COMMON}


def test_pyardrone_decodes_our_short_packets():
    for _ in range(100):
        packet = build_navdata(random_flight(DEMO_OPTIONS))
        read, ours = NavData(packet), parse_navdata(packet)
        assert (read.metadata.state, read.metadata.sequence_number) == (ours.state, ours.sequence)
        assert read.demo.ctrl_state == ours.demo.major << 16 | ours.demo.minor
        assert read.demo.vbat_flying_percentage == ours.battery
        assert read.demo.altitude == round(1000 * ours.height)
        for angle, ours_angle in [("theta", ours.pitch), ("phi", ours.roll), ("psi", ours.yaw)]:
            assert getattr(read.demo, angle) == pytest.approx(1000 * math.degrees(ours_angle))
        assert read.demo.vx == pytest.approx(1000 * ours.demo.vx)
        assert read.demo.num_frames == ours.demo.frame


def test_pyardrone_finds_our_fields_at_the_same_offsets():
    for _ in range(50):
        options = tuple((tag, RANDOM.randbytes(len(body))) for tag, body in COMMON)
        packet = build_navdata(Navdata(1, 2, options=options))
        read, ours = NavData(packet), parse_navdata(packet)
        raw: RawMeasures = ours.raw_measures
        assert list(read.raw_measures.raw_accs) == [
            raw.acceleration_x,
            raw.acceleration_y,
            raw.acceleration_z,
        ]
        assert list(read.raw_measures.raw_gyros_110) == [raw.slow_rate_x, raw.slow_rate_y]
        assert read.raw_measures.vbat_raw == raw.battery_voltage
        assert read.raw_measures.alt_temp_raw == round(1000 * raw.height)
        assert read.raw_measures.gradient == raw.gradient
        word = read.time.time
        assert (word >> 21) + 1e-6 * (word & 0x1FFFFF) == pytest.approx(ours.clock, abs=1e-9)
        altitude: AltitudeOption = ours.altitude
        assert read.altitude.altitude_raw == round(1000 * altitude.altitude_raw)
        assert read.altitude.altitude_vision == round(1000 * altitude.altitude_vision)
        kalman: KalmanPressure = ours.kalman_pressure
        references: References = ours.references
        for their_number, number in [
            (read.altitude.altitude_vz, 1000 * altitude.altitude_vz),
            (read.kalman_pressure.est_z, 1000 * kalman.est_z),
            (read.kalman_pressure.est_zdot, 1000 * kalman.est_zdot),
            (read.kalman_pressure.offset_pressure, kalman.offset_pressure),
            (read.references.ui_time, references.ui_time),
            (read.references.ui_phi, references.ui_phi),
        ]:
            assert number == pytest.approx(their_number, nan_ok=True)
        assert read.references.ui_seq == references.ui_seq
        pressure: Pressure = ours.pressure
        assert read.pressure_raw.ut == pressure.raw_temperature
        assert read.pressure_raw.Pression_meas == pressure.pressure
        video: VideoStream = ours.video_stream
        assert read.video_stream.atcmd_ref_seq == video.atcmd_ref_seq
        assert read.video_stream.frame_number == video.frame


def test_both_refuse_a_wrong_checksum():
    from pyardrone.navdata import ChecksumError

    packet = build_navdata(random_flight(DEMO_OPTIONS))
    wrong = packet[:200] + bytes([packet[200] ^ 1]) + packet[201:]
    with pytest.raises(ChecksumError):
        NavData(wrong)
    with pytest.raises(ValueError, match="checksum"):
        parse_navdata(wrong)


def test_pyardrone_encodes_the_same_commands():
    for sequence in range(1, 200):
        values = [struct.unpack("<f", struct.pack("<f", RANDOM.uniform(-1, 1)))[0] for _ in "rpgy"]
        for theirs_command, ours in [
            (at.PCMD(1, *values), commands.Move(*values)),
            (
                at.PCMD_MAG(3, *values, 0.5, 0.25),
                commands.MoveFrom(*values, 0.5, 0.25, flag=3),
            ),
            (at.REF(at.REF.input.start), commands.Ref(take_off=True)),
            (at.REF(), commands.Ref()),
            (at.REF(at.REF.input.select), commands.Ref(emergency=True)),
            (
                at.CONFIG("control:altitude_max", 3000),
                commands.Config("control:altitude_max", "3000"),
            ),
            (at.CONFIG_IDS("0a", "0b", "0c"), commands.ConfigIds("0a", "0b", "0c")),
            (at.CTRL(5), commands.Control(5)),
            (at.CALIB(0), commands.Calibrate(0)),
            (at.COMWDG(), commands.Watchdog()),
            (at.FTRIM(), commands.FlatTrim()),
        ]:
            packed = theirs_command._pack(sequence)
            assert commands.decode(packed) == [(sequence, ours)]
            assert commands.encode([ours], sequence) == packed
