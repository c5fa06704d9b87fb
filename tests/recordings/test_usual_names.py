"""Columns are found by their usual names, dates are read, and repeated times are placed."""

import deadtime as dtm
import numpy as np
import pytest

ROWS = 200


def table(header, time=lambda row: f"{row}"):
    """A CSV table under a header; its cells are the row and tenths after it."""
    width = header.count(",") + 1
    lines = [
        ",".join([time(row), *(f"{row}.{column}" for column in range(1, width))])
        for row in range(ROWS)
    ]
    return "\n".join([header, *lines]) + "\n"


def read(folder, text, **options):
    path = folder / "run.csv"
    path.write_text(text, encoding="utf-8")
    return dtm.read_recording(path, **({"command": "auto"} | options))


def digit(values):
    """Which column values were read from: the tenths of its cells."""
    return None if values is None or np.isnan(values[3]) else round((values[3] - 3.0) * 10)


@pytest.mark.parametrize(
    ("header", "found"),
    [
        ("t,u,y", (None, 2, 1)),
        ("Time (s),SP,PV,OP", (1, 2, 3)),
        ("Time [s],PV,Q,OP,SP", (4, 1, 3)),
        ("t_s,ref_m,height_m,speed,cmd_mps", (1, 2, 4)),
        ("sec,Setpoint,Process Value,Controller Output", (1, 2, 3)),
        ("Seconds,set-point (%),Measured [°C],MV (%)", (1, 2, 3)),
        ("time,T,temp,PV,U", (None, 3, 4)),
        ("t,T,y,y2,u", (None, 2, 4)),
    ],
)
def test_usual_names_are_found(header, found, tmp_path):
    run = read(tmp_path, table(header))
    assert (digit(run.reference), digit(run.output), digit(run.command)) == found
    assert np.array_equal(run.time, np.arange(ROWS))


def test_what_is_named_is_taken_and_not_found_again(tmp_path):
    run = read(tmp_path, table("t,y,u,T1,Q1"), output="T1", command="Q1")
    assert (digit(run.output), digit(run.command)) == (3, 4)
    run = read(tmp_path, table("time,reference,output"), command="reference")
    assert (digit(run.reference), digit(run.command)) == (1, 1)
    run = read(tmp_path, table("t,y,pv,u"), output="u", command="y")
    assert (digit(run.output), digit(run.command)) == (3, 1)


@pytest.mark.parametrize("signal", ["time", "output", "command"])
def test_without_a_usual_name_the_columns_and_the_option_are_told(signal, tmp_path):
    headers = {"time": "tick,y,u", "output": "t,T1,u", "command": "t,y,Q1"}
    with pytest.raises(dtm.RecordingError) as caught:
        read(tmp_path, table(headers[signal]))
    for word in (*headers[signal].split(","), f"{signal}=", f"--{signal}"):
        assert word in str(caught.value)


def test_stamps_that_are_no_seconds_since_1970_are_refused():
    rows = np.arange(20.0)
    table = {"Timestamp": 1.7e12 + 1e3 * rows, "pv": rows, "op": rows % 5}
    with pytest.raises(dtm.RecordingError, match="which cannot be seconds"):
        dtm.read_recording(table, command="auto")
    table["Timestamp"] *= 1e-3
    assert len(dtm.read_recording(table, command="auto")) == 20


def test_a_reference_or_a_command_has_to_be_there(tmp_path):
    assert not read(tmp_path, table("t,u,y")).has_reference
    # Where there is no reference the command is read unasked.
    assert read(tmp_path, table("t,u,y"), command=None).command is not None
    with pytest.raises(dtm.RecordingError, match="usual name for the reference"):
        read(tmp_path, table("t,Q1,y"), command=None)


@pytest.mark.parametrize(
    "written",
    [
        "2026-01-05 08:{:02d}:{:06.3f}",
        "2026-01-05T08:{:02d}:{:06.3f}Z",
        "2026/01/05 08:{:02d}:{:06.3f}+01:00",
    ],
)
def test_dates_become_seconds(written, tmp_path):
    def stamp(row):
        return written.format(int(0.75 * row // 60), 0.75 * row % 60)

    text = table("Timestamp,PV,OP", stamp)
    run = read(tmp_path, text)
    assert np.array_equal(run.time, 0.75 * np.arange(ROWS))
    assert len(read(tmp_path, text, window=(10.0, 20.0))) == 13


def test_dates_and_numbers_are_not_mixed(tmp_path):
    text = table("Timestamp,PV,OP", lambda row: "2026-01-05 08:00:00" if row == 5 else str(row))
    with pytest.raises(dtm.RecordingError, match=r"line 7: '2026-01-05 08:00:00' .* is a date"):
        read(tmp_path, text)


def test_a_repeated_time_is_placed_before_its_row(tmp_path):
    # The first rows of a log that begins with one row before the step and one after, both at 0.
    first = read(tmp_path, table("t,y,u", lambda row: str(max(row - 1, 0))))
    assert np.array_equal(first.time, np.arange(ROWS) - 1.0)
    later = read(tmp_path, table("t,y,u", lambda row: str(11 if row == 10 else row)))
    assert later.time[9:12].tolist() == [9.0, 10.0, 11.0]
    columns = {"t": np.maximum(np.arange(ROWS) - 1, 0), "y": first.output, "u": first.command}
    assert np.array_equal(dtm.read_recording(columns, command="u").time, first.time)


def test_times_that_repeat_often_or_go_back_are_refused(tmp_path):
    with pytest.raises(dtm.RecordingError, match="line 3: the time repeats"):
        read(tmp_path, table("t,y,u", lambda row: str(row // 2)))
    with pytest.raises(dtm.RecordingError, match="line 12: the time goes back"):
        read(tmp_path, table("t,y,u", lambda row: str(5 if row == 10 else row)))


@pytest.mark.parametrize("stamp", ["01/05/2026 08:00:00 AM", "8:00:00"])
def test_other_dates_are_refused_with_the_one_that_is_read(tmp_path, stamp):
    with pytest.raises(dtm.RecordingError, match="write a date as 2026-01-31 08:00:00"):
        read(tmp_path, table("Timestamp,PV,OP", lambda _: stamp))


@pytest.mark.parametrize(
    ("name", "count"),
    [
        ("time_ms", 1e3),
        ("t_us", 1e6),
        ("Time [ns]", 1e9),
        ("Time (min)", 1 / 60),
        ("t_h", 1 / 3600),
    ],
)
def test_times_in_another_unit_become_seconds(tmp_path, name, count):
    time = np.arange(ROWS) / 8
    columns = {name: time * count, "y": np.arange(ROWS) % 7, "u": np.arange(ROWS) % 3}
    rows = np.column_stack(list(columns.values())).tolist()
    text = "\n".join([",".join(columns), *(",".join(map(repr, row)) for row in rows)])
    for found in (
        dtm.read_recording(columns, command="auto", window=(2.0, 5.0)),
        read(tmp_path, text, window=(2.0, 5.0)),
        read(tmp_path, text, window=(2.0, 5.0), time=name),
    ):
        assert found.time == pytest.approx(time[16:41], rel=1e-15)
    dates = columns | {name: (1000 * time).astype("datetime64[ms]")}
    assert dtm.read_recording(dates, command="auto").time == pytest.approx(time)
