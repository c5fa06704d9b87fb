"""Blackbox logs: of a known truth, a real one with damaged frames, and hostile ones."""

import os
import random
import tracemalloc
from itertools import pairwise

import deadtime as dtm
import numpy as np
import pytest
from blackbox_logs import (
    END,
    NEGATIVE_14,
    NULL,
    SIGNED,
    TAGGED_3,
    TAGGED_4,
    TAGGED_8,
    UNSIGNED,
    VARIABLE_3,
    Log,
    rate_log,
    rate_rows,
)
from deadtime._base.errors import RecordingError
from deadtime.logs._blackbox import read_blackbox
from flights import flight_path
from hypothesis import given, settings, strategies as st
from mutations import mutated

#: flightModeFlags (armed, ANGLE), stateFlags, failsafePhase, rxSignalReceived, channels valid.
ANGLE = [0b11, 8, 0, 1, 1]


def flight(rows, log, slow=(), end=END):
    """A flight with an S frame before the main frames whose numbers `slow` gives."""
    frames = b""
    for number, row in enumerate(rows):
        if number in dict(slow):
            frames += log.slow_frame(dict(slow)[number])
        frames += log.main(row)
    return log.head() + frames + end


def made(count=200, seed=0, step=1, **changes):
    log = rate_log(**changes)
    rows = rate_rows(count, np.random.default_rng(seed), step=step)
    return log, rows


def assert_holds(contents, log, rows, scales=None):
    main = contents.topics["main"]
    truth = np.array(rows, dtype=float)
    np.testing.assert_allclose(main.time, truth[:, 1] * 1e-6, rtol=1e-15)
    for k, name in enumerate(log.names):
        if name != "time":
            scaled = truth[:, k] * (scales or {}).get(name, 1.0)
            np.testing.assert_allclose(main.columns[name], scaled, rtol=1e-15, err_msg=name)


def test_a_flight_comes_back_as_it_was_written():
    log, rows = made(500)
    contents = read_blackbox(flight(rows, log, [(1, ANGLE)]), "made.bbl")
    assert_holds(contents, log, rows)
    assert (contents.format, contents.autopilot) == ("Blackbox", "Betaflight")
    assert (contents.vehicle, contents.firmware) == ("made", log.revision)
    assert contents.remarks == ()
    assert contents.gaps == ()
    assert contents.modes == ((rows[1][1] * 1e-6, "ANGLE"),)
    slow = contents.topics["slow"]
    assert [float(slow.columns[name][0]) for name in slow.columns] == ANGLE


def test_parameters_are_the_numbers_of_the_head():
    log, rows = made(1)
    parameters = read_blackbox(flight(rows, log), "made.bbl").parameters
    expected = {"looptime": 125, "pid_process_denom": 2, "gyro_scale": 1, "P interval": 1}
    expected |= {"rollPID[0]": 45, "rollPID[1]": 80, "rollPID[2]": 30, "motorOutput[1]": 2047}
    assert expected.items() <= parameters.items()
    assert not any(name.startswith(("Field", "Firmware", "Craft")) for name in parameters)


@pytest.mark.parametrize(
    ("interval", "logged", "step"), [(256, "16", 16), (32, "1/4", 4), (64, "1", 1)]
)
def test_iterations_that_are_left_out_on_purpose(interval, logged, step):
    log, rows = made(300, step=step, interval=interval, logged=logged)
    contents = read_blackbox(flight(rows, log), "made.bbl")
    assert_holds(contents, log, rows)
    assert contents.gaps == ()


def test_two_of_three_iterations():
    log, _ = made(0, interval=33, logged="2/3")
    rows = rate_rows(400, np.random.default_rng(1))
    rows = [row for row in rows if log.is_logged(row[0])]
    contents = read_blackbox(flight(rows, log), "made.bbl")
    assert_holds(contents, log, rows)
    assert contents.gaps == ()


def test_high_resolution_comes_out_in_degrees_per_second():
    log, rows = made(100, lines={"blackbox_high_resolution": 1, "gyro_scale": "0x3f800000"})
    fine = [f"gyroADC[{k}]" for k in range(3)] + [f"setpoint[{k}]" for k in range(3)]
    fine += [f"rcCommand[{k}]" for k in range(4)]
    contents = read_blackbox(flight(rows, log), "made.bbl")
    assert_holds(contents, log, rows, dict.fromkeys(fine, 0.1))


def test_the_clock_of_32_bits_starts_again():
    log, _ = made(0)
    rows = rate_rows(400, np.random.default_rng(2), start=2**32 - 50_000)
    contents = read_blackbox(flight([[r[0], r[1] % 2**32, *r[2:]] for r in rows], log), "made.bbl")
    np.testing.assert_allclose(contents.topics["main"].time, [r[1] * 1e-6 for r in rows])


def test_gps_is_told_from_home_and_from_the_last_frame():
    home = [("GPS_home[0]", 1, (0, SIGNED)), ("GPS_home[1]", 1, (0, SIGNED))]
    gps = [
        ("time", 0, (10, UNSIGNED)),
        ("GPS_numSat", 0, (0, UNSIGNED)),
        ("GPS_coord[0]", 1, (7, SIGNED)),
        ("GPS_coord[1]", 1, (7, SIGNED)),
    ]
    log, rows = made(4, home=home, gps=gps)
    frames = [log.main(rows[0])]
    # Without home it tells nothing.
    log.coordinates = [0, 0]
    frames += [log.gps_frame([rows[0][1] + 40, 9, 1, 1]), log.main(rows[1])]
    frames += [log.home_frame([387_000_000, -91_000_000])]
    frames += [log.gps_frame([rows[1][1] + 70, 11, 387_000_123, -91_000_456])]
    frames += [log.main(rows[2])]
    contents = read_blackbox(log.head() + b"".join(frames) + END, "made.bbl")
    topic = contents.topics["gps"]
    np.testing.assert_allclose(topic.time, [(rows[1][1] + 70) * 1e-6], rtol=1e-14)
    assert topic.columns["GPS_coord[0]"].tolist() == [387_000_123]
    assert topic.columns["GPS_coord[1]"].tolist() == [-91_000_456]
    assert topic.columns["GPS_numSat"].tolist() == [11]
    assert any("1 frames are left out" in remark for remark in contents.remarks)


EVENTS = {
    "beep of arming": b"E\0" + b"\x90\x4e",
    "a setting, integer": b"E\x0d\x03\x14",
    "a setting, real": b"E\x0d\x83\0\0\x80\x3f",
    "mode": b"E\x1e\x03\x01",
    "disarmed": b"E\x0f\x04",
    "sensors": b"E\x28\x01",
}


@pytest.mark.parametrize("event", EVENTS.values(), ids=EVENTS.keys())
def test_events_are_passed_over(event):
    log, rows = made(50)
    frames = b"".join(log.main(row) + event for row in rows)
    contents = read_blackbox(log.head() + frames + END, "made.bbl")
    assert contents.remarks == ()
    assert_holds(contents, log, rows)


def test_a_log_that_pauses_goes_on():
    log, rows = made(64)
    after = rate_rows(64, np.random.default_rng(3), start=95_000_000)
    after = [[row[0] + 64 * 4000, *row[1:]] for row in after]
    frames = b"".join(map(log.main, rows))
    resume = b"E\x0e" + b"\x80\xd0\x0f" + b"\xc0\xa7\xa6\x2d"
    frames += resume + b"".join(map(log.main, after))
    contents = read_blackbox(log.head() + frames + END, "made.bbl")
    assert contents.remarks == ()
    assert_holds(contents, log, rows + after)
    assert contents.gaps == ((rows[-1][1] * 1e-6, after[0][1] * 1e-6),)


def test_damage_costs_no_more_than_the_frames_up_to_the_next_whole_one():
    log, rows = made(128)
    frames = [log.main(row) for row in rows]
    frames[40] = frames[40][:9] + b"\xff" * 6 + frames[40][12:]
    contents = read_blackbox(log.head() + b"".join(frames) + END, "made.bbl")
    assert_holds(contents, log, rows[:40] + rows[64:])
    assert any("damaged at 1 places" in remark for remark in contents.remarks)
    assert contents.gaps == ((rows[39][1] * 1e-6, rows[64][1] * 1e-6),)


def test_a_frame_with_another_clock_is_left_out():
    log, rows = made(96)
    odd = [list(row) for row in rows]
    odd[32][1] += 400_000_000
    frames = [log.main(row) for row in rows[:32]]
    frames += [rate_log().main(odd[32])]
    log.main(rows[32])
    frames += [log.main(row) for row in rows[33:]]
    contents = read_blackbox(log.head() + b"".join(frames) + END, "made.bbl")
    assert_holds(contents, log, rows[:32] + rows[64:])


def test_a_clock_that_stays_changed_is_believed():
    log, rows = made(128)
    moved = [[row[0], row[1] + 400_000_000 * (row[0] >= 32), *row[2:]] for row in rows]
    contents = read_blackbox(flight(moved, log), "made.bbl")
    assert_holds(contents, log, moved[:32] + moved[64:])


@pytest.mark.parametrize("cut", [2, 7, 40, 2000])
def test_what_stands_before_a_cut_is_read(cut):
    log, rows = made(100)
    contents = read_blackbox(flight(rows, log)[:-cut], "made.bbl")
    count = contents.topics["main"].time.size
    assert_holds(contents, log, rows[:count])
    assert count > 100 - 3 - cut / 30
    assert contents.remarks[-1] == "The log has no end mark, so it was probably cut off."


def several():
    counts = (50, 200, 20)
    logs = [made(count, seed) for seed, count in enumerate(counts)]
    return logs, b"".join(flight(rows, log) for log, rows in logs)


def test_the_longest_of_several_flights_is_read():
    logs, data = several()
    contents = read_blackbox(data, "made.bbl")
    log, rows = logs[1]
    assert_holds(contents, log, rows)
    assert contents.remarks == (
        "The file contains 3 flights, and this is flight 2: flight 1 of 0.0122 s, "
        "flight 2 of 0.0497 s, flight 3 of 0.00475 s.",
    )


@pytest.mark.parametrize("number", [1, 2, 3])
def test_each_of_several_flights_can_be_read(number):
    logs, data = several()
    log, rows = logs[number - 1]
    assert_holds(read_blackbox(data, "made.bbl", flight=number), log, rows)


def test_a_log_is_opened_at_one_of_its_flights(tmp_path):
    path = tmp_path / "several.bbl"
    path.write_bytes(several()[1])
    durations = [dtm.open_log(path, flight=number).duration for number in (1, 2, 3)]
    assert dtm.open_log(path).duration == max(durations) == durations[1]
    assert durations[2] < durations[0] < durations[1]
    with pytest.raises(RecordingError, match="flight=4 is given: give a number from 1 to 3"):
        dtm.open_log(path, flight=4)
    other = tmp_path / "other.log"
    other.write_text("FMT, 1, 23, ATT, Qcc, TimeUS,DesRoll,Roll\nATT, 1, 2, 3\n")
    with pytest.raises(ValueError, match=r"flight=1: .*other\.log is a DataFlash text log"):
        dtm.open_log(other, flight=1)


def test_a_flight_that_cannot_be_read_is_named():
    log, rows = made(10)
    broken = log.head().replace(b"version:2", b"version:1")
    contents = read_blackbox(broken + flight(rows, log), "made.bbl")
    assert_holds(contents, log, rows)
    assert contents.remarks[-1] == (
        'Not read: flight 1: version "1" of the data cannot be read, only version 2.'
    )
    with pytest.raises(RecordingError, match=r'^made\.bbl: flight 1: version "1" of the data'):
        read_blackbox(broken + flight(rows, log), "made.bbl", flight=1)
    with pytest.raises(RecordingError, match="flight=3 is given: give a number from 1 to 2"):
        read_blackbox(broken + flight(rows, log), "made.bbl", flight=3)


BAD_HEADS = {
    "no log": (b"H Product", b"H Prodduct", "the line .* is missing"),
    "another version": (b"version:2", b"version:3", 'version "3" of the data'),
    "no time": (b",time,", b",tide,", 'does not define the field "time"'),
    "too few codes": (b"I encoding:1,1,", b"I encoding:1,", "another number of encodings"),
    "no number": (b"I encoding:1,1", b"I encoding:1,x", '"Field I encoding" .* damaged'),
    "no code": (b"I encoding:1,1", b"I encoding:1,2", "encoding 2 of a field is not known"),
    "no predictor": (b"P predictor:6,2", b"P predictor:6,99", "predictor 99"),
    "half a group": (
        b"S encoding:1,1,7",
        b"S encoding:1,1,1",
        "2 fields have an encoding for",
    ),
    "names of slow frames": (b"S name:flightModeFlags,", b"S name:", "4 fields of S frames"),
}


@pytest.mark.parametrize(("old", "new", "message"), BAD_HEADS.values(), ids=BAD_HEADS.keys())
def test_a_head_that_cannot_be_is_named(old, new, message):
    log, rows = made(5)
    data = flight(rows, log)
    assert old in data
    with pytest.raises(RecordingError, match=f"^bad.bbl.*{message}"):
        read_blackbox(data.replace(old, new), "bad.bbl")


def test_a_log_without_frames_is_refused():
    with pytest.raises(RecordingError, match="no frame that can be read"):
        read_blackbox(rate_log().head() + END, "empty.bbl")


def test_another_firmware_is_read_by_its_head():
    log, rows = made(20, revision="EmuFlight 0.4.1 (abc) X")
    contents = read_blackbox(flight(rows, log, [(1, ANGLE)]), "made.bbl")
    assert_holds(contents, log, rows)
    assert contents.autopilot == ""
    assert contents.modes == ()
    assert 'firmware "EmuFlight 0.4.1 (abc) X" is neither' in contents.remarks[0]


MODES = [
    ("Betaflight 4.2.11 (a) X", 1 << 7, "GPS RESCUE"),
    ("Betaflight 4.5.0 (a) X", 1 << 6, "FAILSAFE"),
    ("Betaflight 4.6.0 () SITL", 1 << 6, "CHIRP"),
    ("Betaflight 2025.12.1 (a) X", 1 << 10, "GPS RESCUE"),
    ("INAV 7.1.2 (a) X", 1 << 9 | 1 << 1, "ANGLE+NAV POSHOLD"),
    ("INAV 8.0.0 (a) X", 1 << 3, "NAV ALTHOLD"),
    ("Betaflight 4.5.0 (a) X", 0, "ACRO"),
]


@pytest.mark.parametrize(("revision", "bits", "name"), MODES)
def test_modes_by_firmware(revision, bits, name):
    log, rows = made(9, revision=revision)
    states = [(1, [bits | 1, 0, 0, 1, 1]), (5, [bits | 1, 1, 0, 1, 1]), (7, [0, 0, 0, 1, 1])]
    contents = read_blackbox(flight(rows, log, states), "made.bbl")
    expected = ((rows[1][1] * 1e-6, name), (rows[7][1] * 1e-6, "DISARMED"))
    assert contents.modes == expected


#: Encodings with the bits that they hold of a difference.
WIDTHS = {SIGNED: 32, UNSIGNED: 32, NEGATIVE_14: 14, TAGGED_8: 32, TAGGED_4: 16, TAGGED_3: 32}
WIDTHS |= {VARIABLE_3: 32, NULL: 0}
SIZES = {TAGGED_4: 4, TAGGED_3: 3, VARIABLE_3: 3, TAGGED_8: 9}
CONSTANTS = {"minthrottle": 1070, "vbatref": 1650, "motorOutput": "158,2047"}


@st.composite
def logs(draw):
    """A layout with any predictors and encodings, and differences that they can hold."""
    fields, widths = [("motor[0]", 1, (0, SIGNED), (1, SIGNED))], [(20, 20)]
    for number in range(draw(st.integers(1, 5))):
        intra, inter = draw(st.sampled_from(sorted(WIDTHS))), draw(st.sampled_from(sorted(WIDTHS)))
        size = SIZES.get(intra, 1) * SIZES.get(inter, 1)
        for k in range(size):
            # Each needs fields for its own groups, so that the two sizes are multiplied.
            first = draw(st.sampled_from([0, 4, 5, 8, 9, 11]))
            later = draw(st.sampled_from([0, 1, 2, 3, 4, 5, 8, 9, 11]))
            name = f"field{number}[{k}]"
            fields.append((name, 1, (first, intra), (later, inter)))
            widths.append((WIDTHS[intra], WIDTHS[inter]))
        fields.append((f"between[{number}]", 1, (0, SIGNED), (0, SIGNED)))
        widths.append((32, 32))
    small = draw(st.booleans())
    seed = draw(st.integers(0, 2**32 - 1))
    return fields, widths, small, seed


def rows_within(log, widths, small, random, count):
    """Rows whose differences from their predictions have the widths of their encodings."""
    rows, history = [], None
    for iteration in range(count):
        row = [iteration, 1000 + 250 * iteration]
        log.history = history
        intra = history is None or iteration % log.interval == 0
        for k, pair in enumerate(widths, 2):
            bits = pair[0 if intra else 1]
            if small and bits:
                bits = int(random.integers(1, min(bits, 9) + 1))
            low, high = (-(1 << bits - 1), 1 << bits - 1) if bits else (0, 1)
            if low < -(1 << 24):
                low, high = -(1 << 24), 1 << 24
            code = log.fields[k][2 if intra else 3][0]
            row.append(int(random.integers(low, high)) + log.prediction(code, k, row))
        history = (row, row if intra else history[0])
        rows.append(row)
    log.history = None
    return rows


@given(logs())
@settings(max_examples=80, deadline=None)
def test_every_encoding_with_every_predictor(drawn):
    fields, widths, small, seed = drawn
    log = Log(fields=fields, constants=CONSTANTS, interval=8)
    rows = rows_within(log, widths, small, np.random.default_rng(seed), 24)
    assert_holds(read_blackbox(flight(rows, log), "drawn.bbl"), log, rows)


def test_few_bytes_that_pretend_to_hold_many_values_are_refused():
    fields = [(f"nothing[{k}]", 1, (0, NULL), (0, NULL)) for k in range(400)]
    log = Log(fields=fields)
    data = log.head() + b"I\0\0" * 700_000
    tracemalloc.start()
    with pytest.raises(RecordingError, match="too many for so few bytes of a flight"):
        read_blackbox(data, "bomb.bbl")
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < (50 << 20) + 10 * len(data)
    many = Log(fields=[(f"f[{k}]", 1, (0, SIGNED), (1, SIGNED)) for k in range(600)])
    with pytest.raises(RecordingError, match="at most 512 are allowed"):
        read_blackbox(many.head() + b"I\0\0" + END, "wide.bbl")


def test_a_real_log_with_damaged_frames():
    # The whole frames as the Python package orangebox 0.5.0 and the firmware's tools decode them.
    data = flight_path("betaflight_error_recovery.bbl").read_bytes()
    contents = read_blackbox(data, "recovery.bbl")
    assert contents.autopilot == "Betaflight"
    assert contents.firmware == "Betaflight 4.2.11 (948ba6339) STM32F7X2"
    main = contents.topics["main"]
    first = [0, 0, -2, 0, 0, 0, 0, 0, -3, 0, 0, 0, 0, 0, 1, 1000, 0, 0, 0, 0, 2459, 0, 279, 774]
    first += [0, 1, 0, -39, -40, 2056, 158, 183, 159, 183]
    last = [256, 0, 0, 0, 0, 0, 0, -1, 0, 0, 0, 0, 0, 0, 1, 1000, 0, 0, 0, 0, 2463, 76, 273, 774]
    last += [0, 0, 0, -44, -18, 2051, 169, 165, 161, 157]
    assert [values[0] for values in main.columns.values()] == first
    assert [values[-1] for values in main.columns.values()] == last
    np.testing.assert_allclose(main.time, [33.011567, 33.043646], rtol=1e-15)
    assert contents.topics["slow"].columns["flightModeFlags"].tolist() == [1]
    assert "damaged at 2 places" in contents.remarks[0]
    assert contents.parameters["gyro_lowpass_dyn_hz[1]"] == 500
    assert contents.parameters["dyn_notch_q"] == 250
    assert contents.parameters["P interval"] == 16


def small_logs():
    log, rows = made(40)
    real = flight(rows, log, [(1, ANGLE), (20, ANGLE)])
    log, rows = made(8)
    two = flight(rows, log)
    return [real[:4096], two[:2000] + two[:2000]]


def read_or_refuse(data):
    try:
        contents = read_blackbox(data, "damaged.bbl")
    except RecordingError:
        return False
    for topic in contents.topics.values():
        assert np.isfinite(topic.time).all()
        assert all(values.size == topic.time.size for values in topic.columns.values())
    assert all(a <= b for (a, _), (b, _) in pairwise(contents.modes))
    return True


def mutate(count, seed):
    draw = random.Random(seed)
    corpus = small_logs()
    words = [bytes([byte]) for byte in b"IPSGHE\0\xff,:\n0129\x80"]
    taken = sum(read_or_refuse(mutated(draw.choice(corpus), draw, words)) for _ in range(count))
    # A survey that accepts nothing, or everything, tests little.
    assert count / 20 < taken < count
    return taken


def test_damaged_logs_are_read_or_refused():
    mutate(2000, seed=0)


@pytest.mark.survey
def test_many_damaged_logs_are_read_or_refused():
    """`DEADTIME_MUTATIONS=1000000` for more than a short run."""
    mutate(int(os.environ.get("DEADTIME_MUTATIONS", "4000")), seed=1)
