"""What all links share: command ranges, limits, the watch over a flight, and the journal."""

import copy
import math
import pickle
import subprocess
import sys
import time
from dataclasses import replace

import deadtime as dtm
import numpy as np
import pytest
from deadtime import FlightAbortedError
from deadtime.links import Journal, Limits, UnitCommand, VehicleState, Watch, largest_gain
from deadtime.links.safety import BUMP, jumps
from hypothesis import given, strategies as st

STATE = VehicleState(
    time=10.0, height=1.0, flying=True, landed=False, sequence=7, vehicle_time=3.0, battery=80.0
)


@given(st.floats())
def test_a_command_is_finite_and_at_most_one_or_is_refused(value):
    if math.isfinite(value):
        assert -1.0 <= UnitCommand.saturated(value) <= 1.0
        assert abs(UnitCommand.saturated(value) - value) == max(0.0, abs(value) - 1.0)
    else:
        with pytest.raises(ValueError, match="finite"):
            UnitCommand.saturated(value)
    if math.isfinite(value) and abs(value) <= 1.0:
        assert UnitCommand(value) == value
    else:
        with pytest.raises(ValueError, match="command="):
            UnitCommand(value)


@pytest.mark.parametrize("wrong", ["0.5", None, 1j, b"1", [0.1]])
def test_a_command_of_another_type_is_refused(wrong):
    with pytest.raises(TypeError, match="command="):
        UnitCommand(wrong)


def test_the_default_command_is_zero():
    # The default must not be full climb.
    assert UnitCommand() == 0.0


def test_a_command_survives_copies():
    command = UnitCommand(-0.25)
    assert pickle.loads(pickle.dumps(command)) == copy.deepcopy(command) == command
    assert type(pickle.loads(pickle.dumps(command))) is UnitCommand


@pytest.mark.parametrize("name", list(Limits.__dataclass_fields__))
@pytest.mark.parametrize("wrong", [math.nan, math.inf, 0.0, -1.0])
def test_a_limit_without_effect_is_refused(name, wrong):
    with pytest.raises(ValueError, match=name):
        Limits(**{name: wrong})


def test_contradictory_limits_are_refused():
    with pytest.raises(ValueError, match="max_height"):
        Limits(min_height=2.0, max_height=1.0)
    with pytest.raises(ValueError, match="max_height"):
        Limits(min_height=2.0, max_height=2.0)
    with pytest.raises(ValueError, match="landing_after"):
        Limits(command_age=2.0)
    with pytest.raises(ValueError, match="landing_after"):
        Limits(command_age=1.0, landing_after=1.0)


def test_the_largest_gain_is_half_of_that_of_instability():
    loop = dtm.ControlLoop(dtm.Integrator(0.8), dtm.P(1.0), delay=0.3)
    limit = loop.stable_range("Kp")[1]
    assert largest_gain(0.3, 0.8) == pytest.approx(limit / 2.0, rel=1e-9)
    assert largest_gain(0.3) == largest_gain(0.3, 1.0)
    for wrong in (0.0, -1.0, math.nan, math.inf):
        with pytest.raises(ValueError, match="delay"):
            largest_gain(wrong)


BROKEN = {
    "emergency": ({"emergency": True}, {}),
    "receives no echo": ({"fault": "its ultrasound receives no echo"}, {}),
    "0.31 s old": ({}, {"now": 10.31}),
    "nan s old": ({}, {"now": math.nan}),
    "21 messages": ({"missing": 21}, {}),
    "16 degrees": ({"pitch": math.radians(-16.0)}, {}),
    "tilted by nan": ({"pitch": 0.1, "roll": math.nan}, {}),
    "battery": ({"battery": 19.0}, {}),
    "battery is at nan": ({"battery": math.nan}, {}),
    "height is 0.10": ({"height": 0.1}, {}),
    "height is 3.50": ({"height": 3.5}, {}),
    "height is nan": ({"height": math.nan}, {}),
    "differ by more than": ({}, {"reference": 2.2}),
}


@pytest.mark.parametrize("reason", BROKEN)
def test_each_rule_ends_a_flight_and_is_named(reason):
    state, others = BROKEN[reason]
    with pytest.raises(FlightAbortedError, match=reason) as caught:
        Watch(Limits()).check(replace(STATE, **state), **{"now": 10.0, **others})
    assert reason in caught.value.reason


def test_states_within_the_limits_pass():
    watch = Watch(Limits())
    watch.check(STATE, now=10.29, reference=1.9)
    watch.check(STATE, now=10.29, reference=0.1)
    later = replace(STATE, time=10.1, sequence=8, vehicle_time=3.1, height=1.3, battery=None)
    watch.check(later, now=10.1)


EXACTLY = {
    "age": ({"time": 0.0, "vehicle_time": None}, {"now": 0.3}),
    "missing": ({"missing": 20}, {}),
    "roll": ({"roll": math.radians(15.0)}, {}),
    "battery": ({"battery": 20.0}, {}),
    "lowest": ({"height": 0.2}, {}),
    "highest": ({"height": 3.0}, {}),
    "error": ({"height": 1.0}, {"reference": 2.0}),
}


@pytest.mark.parametrize("limit", EXACTLY)
def test_states_exactly_at_a_limit_pass(limit):
    state, others = EXACTLY[limit]
    Watch(Limits()).check(replace(STATE, **state), **{"now": 10.0, **others})


def test_a_height_may_stay_constant_for_exactly_the_time_of_the_limit():
    watch = Watch(Limits())
    for now in (0.0, 0.5, 1.0):
        watch.check(replace(STATE, time=now, vehicle_time=None), now=now, reference=1.5)
    with pytest.raises(FlightAbortedError, match="has not changed from"):
        watch.check(replace(STATE, time=1.001, vehicle_time=None), now=1.001, reference=1.5)


def test_a_height_that_jumps_is_rejected():
    watch = Watch(Limits())
    watch.check(STATE, now=10.0)
    jumped = replace(STATE, time=10.01, sequence=8, vehicle_time=3.01, height=1.2)
    with pytest.raises(FlightAbortedError, match=r"changes from 1\.00 to 1\.20 m within 10 ms"):
        watch.check(jumped, now=10.01)


@pytest.mark.parametrize(("passed", "most"), [(0.0, 0.1), (0.02, 0.2), (0.2, 1.1)])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_height_may_change_by_the_fastest_climb_plus_the_tolerance(passed, most, sign):
    # The tolerance is added, not subtracted.
    for share, accepted in ((0.99, True), (1.01, False)):
        watch = Watch(Limits())
        start = replace(STATE, height=1.5)
        watch.check(start, now=10.0)
        later = replace(later_by(passed, sequence=8), height=1.5 + sign * share * most)
        assert jumps(1.5, later.height, passed, 5.0) is not accepted
        if accepted:
            watch.check(later, now=10.0 + passed)
        else:
            with pytest.raises(FlightAbortedError, match="height changes"):
                watch.check(later, now=10.0 + passed)


def test_a_jump_of_exactly_the_allowed_size_passes():
    assert not jumps(0.0, BUMP, 0.0, 5.0)
    assert not jumps(0.0, 2.0 + BUMP, 0.5, 4.0)
    assert jumps(1.0, math.nan, 1.0, 5.0)


def test_a_clock_that_runs_backwards_allows_no_larger_jump():
    watch = Watch(Limits())
    watch.check(replace(STATE, vehicle_time=None), now=10.0)
    later = replace(STATE, time=9.9, sequence=8, vehicle_time=None)
    watch.check(replace(later, height=1.09), now=10.0)
    with pytest.raises(FlightAbortedError, match="within 0 ms"):
        watch.check(replace(later, sequence=9, time=9.8, height=1.2), now=10.0)


def test_messages_that_arrive_in_a_burst_are_dated_by_the_vehicle_s_clock():
    watch = Watch(Limits())
    watch.check(STATE, now=10.0)
    watch.check(replace(STATE, sequence=9, vehicle_time=3.2, height=1.5), now=10.0)


def later_by(passed, **changes):
    """The state some time later, as it arrives without delay."""
    number = 7 + round(passed / 0.05)
    times = {"time": 10.0 + passed, "vehicle_time": 3.0 + passed, "sequence": number}
    return replace(STATE, **(times | changes))


def test_messages_that_are_late_by_the_vehicle_s_clock_are_old():
    # They queue on the way, and the time between arrivals does not show it.
    watch = Watch(Limits())
    watch.check(STATE, now=10.0)
    watch.check(later_by(0.5, vehicle_time=3.25), now=10.5)
    with pytest.raises(FlightAbortedError, match=r"newest message is 0\.35 s old"):
        watch.check(later_by(1.0, vehicle_time=3.65), now=11.0)


@pytest.mark.parametrize(
    ("reference", "wiggle", "ends"), [(1.2, 0.0, True), (1.2, 0.001, False), (1.04, 0.0, False)]
)
def test_a_height_that_stays_constant_away_from_the_reference_is_rejected(reference, wiggle, ends):
    watch = Watch(Limits())
    for k in range(60):
        passed = 0.05 * k
        state = later_by(passed, height=1.0 + wiggle * (k % 2))
        if ends and passed > 1.04:
            with pytest.raises(
                FlightAbortedError, match=r"has not changed from 1\.000 m for 1\.1 s"
            ):
                watch.check(state, now=state.time, reference=reference)
            break
        watch.check(state, now=state.time, reference=reference)


def test_a_height_may_stay_constant_until_the_reference_changes():
    watch = Watch(Limits())
    for k in range(60):
        passed = 0.05 * k
        reference = 1.0 if passed < 2.0 else 1.25
        watch.check(later_by(passed), now=10.0 + passed, reference=reference)


def test_limits_have_a_readable_description():
    lines = " ".join(Limits().lines())
    for number in ("0.5 m/s", "3 m", "15 degrees", "20 %", "0.25 s", "1 s"):
        assert number in lines


COLUMNS = ("time_s", "reference_m", "height_m")


def lines_when_written(path, count):
    """Lines of a file once it has this many; a thread writes it."""
    for _ in range(2000):
        if len(path.read_text().splitlines()) >= count:
            break
        time.sleep(0.01)
    return path.read_text().splitlines()


def test_every_row_is_written_without_a_flush_by_the_caller(tmp_path):
    path = tmp_path / "folder" / "flight.csv"
    journal = Journal(path, COLUMNS)
    for row in range(10):
        journal.write((0.065 * row, float(row > 4), 0.1 * row))
        assert len(lines_when_written(path, row + 2)) == row + 2
    journal.close()
    journal.close()
    flight = dtm.read_recording(path, time="time_s", reference="reference_m", output="height_m")
    np.testing.assert_allclose(flight.output, 0.1 * np.arange(10), rtol=1e-12)


def test_a_recording_is_never_overwritten(tmp_path):
    path = tmp_path / "flight.csv"
    Journal(path, COLUMNS).close()
    with pytest.raises(FileExistsError, match="give another name"):
        Journal(path, COLUMNS)


@pytest.mark.parametrize("row", [(0.0, 1.0), (0.0, 1.0, math.nan), (0.0, math.inf, 1.0)])
def test_a_row_that_cannot_be_read_back_is_refused_and_leaves_the_file_whole(tmp_path, row):
    with Journal(tmp_path / "flight.csv", COLUMNS) as journal:
        journal.write((0.0, 1.0, None))
        with pytest.raises(ValueError, match="row"):
            journal.write(row)
    assert journal.path.read_text() == "time_s,reference_m,height_m\n0.0,1.0,\n"
    assert journal.rows == 1
    with pytest.raises(ValueError, match="closed"):
        journal.write((0.0, 1.0, 2.0))


FULL_DISK = """
import resource, signal, sys
from deadtime.links import Journal

signal.signal(signal.SIGXFSZ, signal.SIG_IGN)  # an error instead, as of a full disk
resource.setrlimit(resource.RLIMIT_FSIZE, (16, 16))
with Journal(sys.argv[1], ["x_m"]) as journal:
    journal.write([1.25])
    journal.write([2.25])
    journal.write([3.25])
"""


def test_a_full_disk_leaves_whole_rows_and_the_error_names_the_file(tmp_path):
    pytest.importorskip("resource", reason="this system has no limit on the size of files")
    path = tmp_path / "flight.csv"
    result = subprocess.run(
        [sys.executable, "-c", FULL_DISK, str(path)], capture_output=True, text=True, check=False
    )
    assert result.returncode == 1
    assert str(path) in result.stderr.splitlines()[-1]
    assert path.read_text() == "x_m\n1.25\n2.25\n"  # The third row would end at byte 19.


ROOM_AGAIN = """
import resource, sys, time
from deadtime.links import Journal
most = resource.getrlimit(resource.RLIMIT_FSIZE)[1]
resource.setrlimit(resource.RLIMIT_FSIZE, (12, most))
journal, refused = Journal(sys.argv[1], ["x_m"]), 0
journal.write([1.25])
journal.write([2.25])
for _ in range(2000):
    time.sleep(0.01)
    try:
        journal._writer.check()
    except OSError:
        break
resource.setrlimit(resource.RLIMIT_FSIZE, (most, most))
for call in (lambda: journal.write([3.25]), journal.close):
    try:
        call()
    except OSError as error:
        refused += error.filename == sys.argv[1]
print(refused)
"""


def test_after_a_failed_write_nothing_is_written_and_every_call_raises(tmp_path):
    pytest.importorskip("resource", reason="this system has no limit on the size of files")
    path = tmp_path / "flight.csv"
    command = [sys.executable, "-c", ROOM_AGAIN, str(path)]
    assert subprocess.run(command, check=True, capture_output=True).stdout.split() == [b"2"]
    assert path.read_bytes() == b"x_m\n1.25\n"


LEFT_OPEN = """
import os, sys, time
from deadtime.links import Journal, journal
plain = journal._Writer._write
def slow(self, waiting):
    time.sleep(0.2)
    return plain(self, waiting)
journal._Writer._write = slow
kept = Journal(sys.argv[1], ["x_m"])
for row in range(500):
    kept.write([row])
if sys.argv[2] == "raises":
    raise ZeroDivisionError
if sys.argv[2] == "dropped":
    del kept
"""


@pytest.mark.parametrize("ends", ["returns", "raises", "dropped"])
def test_a_journal_that_is_not_closed_is_complete_when_the_program_ends(ends, tmp_path):
    path = tmp_path / "flight.csv"
    command = [sys.executable, "-c", LEFT_OPEN, str(path), ends]
    subprocess.run(command, check=False, capture_output=True)
    assert path.read_text().split() == ["x_m", *(f"{row}.0" for row in range(500))]


def test_many_rows_at_once_are_all_written_in_order(tmp_path):
    with Journal(tmp_path / "flight.csv", ["x"]) as journal:
        for row in range(20000):
            journal.write([row])
    found = journal.path.read_text().split()
    assert found == ["x", *(f"{row}.0" for row in range(20000))]


@pytest.mark.parametrize("columns", [(), ("a", "a"), ("a,b",), ('a"',), ("a\n",), ("",)])
def test_column_names_that_cannot_be_read_back_are_refused(tmp_path, columns):
    with pytest.raises(ValueError, match="name"):
        Journal(tmp_path / "flight.csv", columns)
    assert not (tmp_path / "flight.csv").exists()


@given(st.floats(-1e9, 1e9))
def test_numbers_are_written_with_twelve_digits(value):
    import tempfile
    from pathlib import Path

    with tempfile.TemporaryDirectory() as folder:
        with Journal(Path(folder) / "one.csv", ["x"]) as journal:
            journal.write([value])
        assert float(journal.path.read_text().split()[1]) == pytest.approx(value, rel=1e-11)
