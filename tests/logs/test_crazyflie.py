"""Logs of a Crazyflie: of a known truth, a real one, and damaged ones."""

import os
import random
import tracemalloc

import numpy as np
import pytest
from crazyflie_logs import definitions, record, sealed
from deadtime._base.errors import RecordingError
from deadtime.logs._crazyflie import read_crazyflie
from flights import flight_path
from mutations import mutated

FIXED = (0xFFFF, ("fixedFrequency", [("gyro.x", "f"), ("motor.m1", "H"), ("pm.state", "b")]))
EVENTS = dict([FIXED, (3, ("estTDOA", [("idA", "B"), ("distance", "f")])), (9, ("empty", []))])
RANGES = {"B": (0, 2**8), "b": (-(2**7), 2**7), "H": (0, 2**16), "h": (-(2**15), 2**15)}
RANGES |= {"I": (0, 2**32), "i": (-(2**31), 2**31), "Q": (0, 2**53), "q": (-(2**53), 2**53)}


def fixed(count, start=1_000_000, step=1000):
    return [(start + step * k, (k / 8 - 3, 700 + k % 60_000, k % 7 - 3)) for k in range(count)]


def fixed_log(count):
    log = definitions(dict([FIXED]))
    return log + b"".join(record(EVENTS, 0xFFFF, *row) for row in fixed(count))


def assert_fixed(contents, rows):
    topic = contents.topics["fixedFrequency"]
    np.testing.assert_allclose(topic.time, [stamp * 1e-6 for stamp, _ in rows], rtol=1e-15)
    columns = [topic.columns[name].tolist() for name in topic.columns]
    assert columns == [
        list(map(float, values)) for values in zip(*(v for _, v in rows), strict=True)
    ]


def test_a_log_comes_back_as_it_was_written():
    contents = read_crazyflie(sealed(fixed_log(300)), "log00")
    assert_fixed(contents, fixed(300))
    assert list(contents.topics["fixedFrequency"].columns) == ["gyro.x", "motor.m1", "pm.state"]
    assert (contents.autopilot, contents.remarks) == ("Crazyflie", ())


def test_events_in_any_order():
    random = np.random.default_rng(0)
    rows = {number: [] for number in EVENTS}
    log = definitions(EVENTS)
    for k in range(500):
        number = [0xFFFF, 3, 9][int(random.integers(3))]
        values = {0xFFFF: (k / 4, k, -1), 3: (k % 256, k / 2), 9: ()}[number]
        rows[number].append((100 * k, values))
        log += record(EVENTS, number, 100 * k, values)
    contents = read_crazyflie(sealed(log), "log00")
    assert_fixed(contents, rows[0xFFFF])
    other = contents.topics["estTDOA"]
    assert other.columns["distance"].tolist() == [values[1] for _, values in rows[3]]
    assert contents.topics["empty"].time.tolist() == [1e-6 * stamp for stamp, _ in rows[9]]


@pytest.mark.parametrize("letter", [*RANGES, "f", "d", "e"])
def test_types_of_variables(letter):
    events = {1: ("event", [("before", "B"), ("value", letter), ("after", "B")])}
    random = np.random.default_rng(1)
    if letter in RANGES:
        low, high = RANGES[letter]
        values = [low, high - 1, *map(int, random.integers(low, high, 20))]
    else:
        values = [0.0, -1.5, 1024.0, *np.float16(random.normal(size=20)).astype(float)]
    log = definitions(events)
    log += b"".join(record(events, 1, k, (7, value, 9)) for k, value in enumerate(values))
    topic = read_crazyflie(sealed(log), "log00").topics["event"]
    assert topic.columns["value"].tolist() == list(map(float, values))
    assert set(topic.columns["after"]) == {9.0}


def test_the_first_version_counts_milliseconds():
    log = definitions(dict([FIXED]), version=1)
    log += b"".join(record(EVENTS, 0xFFFF, 20 * k, (1.0, 2, 3), version=1) for k in range(5))
    contents = read_crazyflie(sealed(log), "log00")
    np.testing.assert_allclose(
        contents.topics["fixedFrequency"].time, [0, 0.02, 0.04, 0.06, 0.08], rtol=1e-15
    )


def test_events_of_one_name_are_told_apart():
    events = {k: ("event", [("value", "B")]) for k in range(3)}
    log = definitions(events) + b"".join(record(events, k, k, (k,)) for k in range(3))
    contents = read_crazyflie(sealed(log), "log00")
    assert list(contents.topics) == ["event", "event[1]", "event[2]"]


@pytest.mark.parametrize("cut", [1, 4, 5, 17, 500])
def test_what_stands_before_a_cut_is_read(cut):
    log = sealed(fixed_log(300))[:-cut]
    contents = read_crazyflie(log, "log00")
    count = contents.topics["fixedFrequency"].time.size
    assert count >= 299 - cut / 17
    assert_fixed(contents, fixed(count))
    assert contents.remarks[0].startswith("The checksum is wrong")


def test_damage_is_passed_over():
    events = dict([FIXED])
    rows = fixed(200)
    parts = [record(events, 0xFFFF, *row) for row in rows]
    parts[50] = parts[50][:8] + b"\x01\x02\x03"
    log = sealed(definitions(events) + b"".join(parts))[:-4]
    contents = read_crazyflie(log, "log00")
    topic = contents.topics["fixedFrequency"]
    kept = topic.columns["motor.m1"][[*range(50), *range(-140, 0)]].tolist()
    assert kept == [row[1][1] for row in rows[:50] + rows[60:]]
    assert any("damaged at 1 places" in remark for remark in contents.remarks)


def test_damage_to_the_end_is_named():
    log = fixed_log(20) + b"\x01" * 100
    contents = read_crazyflie(log, "log00")
    assert_fixed(contents, fixed(20))
    place = len(fixed_log(20))
    assert f"The part from byte {place} of {place + 100} on is damaged" in contents.remarks[1]


def named(text):
    log = definitions({1: ("event", [("value", "f")])})
    return sealed(log.replace(b"value(f)", text) + record({1: ("", [])}, 1, 5, ()) + b"1234")


BAD = {
    "nothing": (b"", "first byte is not 0xbc"),
    "another format": (b"PK\3\4", "first byte is not 0xbc"),
    "a first byte alone": (b"\xbc", "definitions of the events are damaged"),
    "another version": (sealed(definitions({}, version=3)), "version 3 of the log cannot be read"),
    "no events": (sealed(definitions({})), "contains no record that can be read"),
    "no records": (sealed(definitions(EVENTS)), "contains no record that can be read"),
    "a type of text": (named(b"value(s)"), r'variable "value\(s\)" does not end in a known type'),
    "no type": (named(b"value"), 'variable "value" does not end in a known type'),
    "a name without end": (definitions(EVENTS)[:20], "name that begins at byte .* has no end"),
    "an event twice": (
        sealed(definitions({1: ("a", [])}).replace(b"\2\0\1\0", b"\2\0\2\0") + b"\1\0b\0\0\0"),
        "event 1 is defined twice",
    ),
    "many variables": (
        definitions({1: ("a", [("", "f")] * 10_001)}),
        "more than 10000 events and variables",
    ),
}


@pytest.mark.parametrize(("data", "message"), BAD.values(), ids=BAD.keys())
def test_what_is_no_log_is_refused(data, message):
    with pytest.raises(RecordingError, match=f"^bad.*{message}"):
        read_crazyflie(data, "bad")


@pytest.mark.parametrize("variables", [[], [("v", "B")] * 200])
def test_memory_stays_in_proportion_to_the_file(variables):
    events = {1: ("event", [(f"v{k}", letter) for k, (_, letter) in enumerate(variables)])}
    one = record(events, 1, 7, [1] * len(variables))
    log = definitions(events) + one * (1_000_000 // len(one))
    tracemalloc.start()
    contents = read_crazyflie(log, "log00")
    held = [contents.topics["event"].columns[name] for name in contents.topics["event"].columns]
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert len(held) == len(variables)
    assert peak < 10 * len(log)


def test_a_real_log():
    # The numbers of a few lines of Python after the format's definition.
    data = flight_path("crazyflie_log10.cfusd").read_bytes()
    contents = read_crazyflie(data, "log10")
    topic = contents.topics["fixedFrequency"]
    assert contents.remarks == ()
    assert topic.time.size == 50_496
    assert (topic.time[0], topic.time[-1]) == (26.333702, 76.340661)
    assert np.median(np.diff(topic.time)) == pytest.approx(989e-6, abs=1e-9)
    assert list(topic.columns)[3:7] == ["gyro.x", "gyro.y", "gyro.z", "motor.m1"]
    assert topic.columns["acc.z"][0] == pytest.approx(1.0010737, abs=1e-7)
    assert topic.columns["gyro.x"].max() == pytest.approx(1961.0029297, abs=1e-6)
    assert topic.columns["motor.m3"].max() == 58_900


def read_or_refuse(data):
    try:
        contents = read_crazyflie(data, "damaged")
    except RecordingError:
        return False
    for topic in contents.topics.values():
        assert all(values.size == topic.time.size for values in topic.columns.values())
    return True


def mutate(count, seed):
    draw = random.Random(seed)
    mixed = definitions(EVENTS) + record(EVENTS, 3, 1, (2, 3.0)) + record(EVENTS, 9, 4, ())
    corpus = [sealed(fixed_log(200)), sealed(fixed_log(3)), sealed(mixed * 2)]
    taken = sum(read_or_refuse(mutated(draw.choice(corpus), draw)) for _ in range(count))
    # A survey that accepts nothing, or everything, tests little.
    assert count / 20 < taken < count
    return taken


def test_damaged_logs_are_read_or_refused():
    mutate(3000, seed=0)


@pytest.mark.survey
def test_many_damaged_logs_are_read_or_refused():
    """`DEADTIME_MUTATIONS=1000000` for more than a short run."""
    mutate(int(os.environ.get("DEADTIME_MUTATIONS", "20000")), seed=1)
