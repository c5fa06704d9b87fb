"""The table of the times of a log, and the lines below it, of loops as they may be found."""

from dataclasses import replace

import pytest
from deadtime.logs import Advice, LatencyTable, LoopLatency, Spread
from deadtime.logs.latencies._below import below

NAN = float("nan")


def loop(name, verdict="reliable", reason="", command="setpoint", time=0.0421, **more):
    interval = more.pop("interval", (time - 0.002, time + 0.002))
    return LoopLatency(name, "", "rate", command, verdict, reason, time, interval, **more)


def spread(slope=0.0, interval=(-1.0, 1.0), between=0.0, p_value=0.5):
    return Spread(6, 0.04, 1e-3, (0.038, 0.042), between, 0.1, p_value, slope, interval)


def lines_of(*loops, advice=()):
    return below(loops, advice)


def wanted(loops):
    return [(one.loop, one.command) for one in loops]


def test_a_row_can_be_printed_before_the_next_is_known():
    loops = [loop("roll rate", windows=((0.0, 4.0),)), loop("yaw", "indication", "why")]
    table = LatencyTable(wanted(loops))
    head, *rows = [table.head(), *table.rows(loops)]
    for column, cells in (("time", ("42.1 ms", "about 42 ms")), ("verdict", ("reliable", "indi"))):
        at = head.index(column)
        assert [row[at : at + len(cell)] for row, cell in zip(rows, cells, strict=True)] == [*cells]
    assert "1 window" in rows[0]
    assert "40.1 to 44.1 ms" in rows[0]


@pytest.mark.parametrize("screen", [80, 100])
def test_it_fits_the_screen(screen):
    loops = [
        loop("vertical speed", time=1.234, interval=(1.1, 1.36)),
        loop("north velocity", "indication", command="actuator", time=0.58613),
    ]
    table = LatencyTable(wanted(loops), screen)
    lines = [table.head(), *table.rows(loops)]
    assert max(map(len, lines)) <= screen
    assert ("flown" in lines[0]) == (screen == 100)


def test_a_long_table_has_rows_for_times_alone_and_fifteen_of_them():
    none = [loop(f"still {k}", "none", "the setpoint does not move", time=NAN) for k in range(9)]
    found = [loop(f"loop {k}") for k in range(17)]
    few = LatencyTable(wanted([*none, *found[:6]]))
    assert len(few.rows([*none, *found[:6]])) == 15
    many = LatencyTable(wanted([*none, *found]))
    assert len(many.rows([*none, *found])) == 15
    first, *_, last = lines_of(*none, *found)
    assert first == "2 more times: --verbose"
    assert last == "none: still 0, still 1, still 2 and 6 more: the setpoint does not move"


def test_loops_that_share_a_reason_have_one_line():
    by = "by moves the log gives {} ms, but the fit gives {} ms"
    first = loop("roll", "indication", by.format(71.5, 59))
    second = loop("pitch", "indication", f"{by.format(80, 61)}; and more")
    assert lines_of(first, second) == [f"indication: roll: {first.reason}; likewise pitch"]
    actuator = loop("yaw", "none", "it rests", command="actuator", time=NAN)
    both = [replace(actuator, loop="roll"), loop("roll", "none", "it rests", time=NAN), actuator]
    assert lines_of(*both) == ["none: roll; from actuator yaw: it rests"]
    # Of several reasons why time is left out, the one that leaves out most.
    mode = "in this flight mode the loop is open"
    why = f"9.3 s are left out: it is on the ground; 188 s are left out: {mode}"
    assert lines_of(loop("yaw", "none", why)) == [f"none: yaw: {mode}"]


def test_a_plain_number_that_contradicts_the_fit_has_a_line_of_its_own():
    few = "a time needs 8 windows that determine the time alone, but there are only 3"
    by = "by moves the log gives 12 ms, but the fit gives 6 ms"
    doubted = loop("yaw", "indication", f"{few}; {by}")
    assert lines_of(doubted) == [f"indication: yaw: {few}", f"indication: yaw: {by}"]


def test_loops_without_a_time_that_were_fitted_come_first():
    asked = [loop(f"loop {k}", "none", f"reason {'abc'[k]}", time=NAN) for k in range(3)]
    asked[2] = replace(asked[2], windows=((0.0, 4.0),))
    assert lines_of(*asked)[0] == "none: loop 2: reason c"


def test_lines_are_few_and_fit_a_screen_where_their_parts_do():
    reasons = [f"reason {'abcdefghi'[k]}, which is long: {'words ' * 20}" for k in range(9)]
    loops = [loop(f"loop {k}", "none", reasons[k], time=NAN) for k in range(9)]
    loops += [loop("roll", "indication", reasons[0], spread=spread(between=0.02, p_value=1e-4))]
    advice = [Advice(f"set this: {'words ' * 20}", "a page")] * 4
    lines = lines_of(*loops, advice=advice)
    assert len(lines) == 5
    assert max(map(len, lines)) <= 100
    assert lines[0].startswith(
        "roll: the time changes during the log, with a standard deviation of 20 ms"
    )
    assert lines[3].endswith("; for others: --verbose")
    assert lines[4] == "next: set this"


def test_a_time_that_depends_on_the_size_of_the_movement_is_said_in_numbers():
    slow = spread(slope=-0.02, interval=(-0.026, -0.014))
    told = lines_of(loop("roll", spread=slow), loop("pitch", spread=spread()))
    assert told == ["roll takes 13.9 ± 2.1 ms longer if the setpoint moves half as much"]
    fast = spread(slope=0.02, interval=(0.014, 0.026))
    assert "ms less if" in lines_of(loop("roll", spread=fast))[0]


def test_zero_has_no_sign():
    (row,) = LatencyTable([("roll", "setpoint")]).rows(
        [loop("roll", time=0.003, interval=(-0.00001, 0.02))]
    )
    assert "-0" not in row
