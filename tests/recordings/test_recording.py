"""Recordings and their files: what is read, what is refused, and the text of the errors."""

import math

import deadtime as dtm
import numpy as np
import pytest
from hypothesis import given, strategies as st

ROWS = [(k * 0.1, 0.0 if k < 5 else 1.0, 0.01 * k) for k in range(20)]


def write(folder, rows=ROWS, header="t_s,ref_m,height_m", name="flight.csv", end="\n"):
    path = folder / name
    lines = [header, *(",".join(str(cell) for cell in row) for row in rows)]
    path.write_text(end.join(lines) + end, encoding="utf-8")
    return path


def read(path, **options):
    names = {"time": "t_s", "reference": "ref_m", "output": "height_m"}
    return dtm.read_recording(path, **(names | options))


def test_columns_are_found_by_name(tmp_path):
    flight = read(write(tmp_path))
    np.testing.assert_array_equal(flight.time, [row[0] for row in ROWS])
    np.testing.assert_array_equal(flight.reference, [row[1] for row in ROWS])
    np.testing.assert_array_equal(flight.output, [row[2] for row in ROWS])
    assert flight.command is None
    assert flight.source == "flight.csv"


def test_an_optional_command_is_read(tmp_path):
    flight = read(write(tmp_path), command="height_m")
    np.testing.assert_array_equal(flight.command, flight.output)


@pytest.mark.parametrize("end", ["\n", "\r\n"])
@pytest.mark.parametrize("mark", ["", "\ufeff"])
def test_line_ends_and_byte_order_marks_do_not_matter(tmp_path, end, mark):
    flight = read(write(tmp_path, header=mark + "t_s,ref_m,height_m", end=end))
    assert len(flight) == 20


@pytest.mark.parametrize("delimiter", [";", "\t"])
def test_other_delimiters_are_detected_from_the_header(tmp_path, delimiter):
    path = write(tmp_path)
    path.write_text(path.read_text().replace(",", delimiter))
    assert len(read(path)) == 20
    assert len(read(path, delimiter=delimiter)) == 20


def test_comments_and_empty_lines_are_left_out(tmp_path):
    path = write(tmp_path)
    path.write_text("# a flight\n\n" + path.read_text().replace("\n0.3,", "\n\n# gust\n0.3,"))
    assert len(read(path)) == 20


def test_a_window_includes_its_ends(tmp_path):
    flight = read(write(tmp_path), window=(0.3, 1.2))
    assert flight.time[0] == pytest.approx(0.3)
    assert flight.time[-1] == pytest.approx(1.2)


def test_values_outside_the_window_need_not_be_valid(tmp_path):
    rows = [*ROWS, (2.5, math.inf, math.nan)]
    assert len(read(write(tmp_path, rows), window=(0.0, 2.0))) == 20
    with pytest.raises(dtm.RecordingError, match="line 22"):
        read(write(tmp_path, rows))


def broken(**change):
    rows = [list(row) for row in ROWS]
    for key, value in change.items():
        row, column = (int(part) for part in key.strip("_").split("_"))
        rows[row][column] = value
    return rows


@pytest.mark.parametrize(
    ("rows", "words"),
    [
        (broken(_4_2="-inf"), ["line 6", "height_m", "-inf"]),
        (broken(_4_1="inf"), ["line 6", "ref_m", "inf"]),
        (broken(_7_2="high"), ["line 9", "'high'", "not a number"]),
        (broken(_7_0=0.2), ["line 9", "goes back"]),
        (broken(_7_0=ROWS[6][0]), ["line 9", "repeats"]),
        ([(t, 1.0, z) for t, _, z in ROWS], ["no step", "throughout"]),
        (ROWS[:5], ["5 samples", "at least 8"]),
        ([], ["0 samples"]),
        ([*ROWS, (9.0, 1.0)], ["line 22", "2 cells"]),
    ],
)
def test_bad_rows_are_refused_with_their_line(tmp_path, rows, words):
    with pytest.raises(dtm.RecordingError) as caught:
        read(write(tmp_path, rows))
    for word in words:
        assert word in str(caught.value)


def test_a_missing_column_is_named_with_a_similar_one(tmp_path):
    with pytest.raises(dtm.RecordingError, match=r"no column 'heigth_m'.*did you mean 'height_m'"):
        read(write(tmp_path), output="heigth_m")


def test_two_columns_of_one_name_are_refused(tmp_path):
    path = write(tmp_path, [(*row, 0) for row in ROWS], header="t_s,ref_m,height_m,ref_m")
    with pytest.raises(dtm.RecordingError, match="2 columns with the name 'ref_m'"):
        read(path)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "is empty"),
        (b"\n\n", "is empty"),
        (bytes(range(256)), "neither a text file"),
        (b"PK\x03\x04\0\0\0\0", "is a zip archive"),
        (b"t_s,ref_m,height_m\n", "0 samples"),
        (b'"t_s,ref_m\n', "not a CSV file"),
    ],
)
def test_files_that_are_not_recordings_are_refused(tmp_path, content, words):
    path = tmp_path / "flight.csv"
    path.write_bytes(content)
    with pytest.raises(dtm.RecordingError, match=words):
        read(path)


def test_a_missing_file_and_a_folder_are_refused(tmp_path):
    with pytest.raises(dtm.RecordingError, match="does not exist"):
        read(tmp_path / "nowhere.csv")
    with pytest.raises(dtm.RecordingError, match="folder"):
        read(tmp_path)


@given(st.binary(max_size=400))
def test_arbitrary_bytes_are_refused_by_name(tmp_path_factory, content):
    path = tmp_path_factory.mktemp("fuzz") / "flight.csv"
    path.write_bytes(content)
    with pytest.raises(dtm.RecordingError):
        read(path)


@given(st.text(alphabet="t_s,ref_mheight\n0123456789.-+einfa\"'; \t#", max_size=300))
def test_any_text_is_read_or_refused_by_name(tmp_path_factory, content):
    path = tmp_path_factory.mktemp("fuzz") / "flight.csv"
    path.write_text("t_s,ref_m,height_m\n" + content, encoding="utf-8")
    try:
        flight = read(path)
    except dtm.RecordingError:
        return
    assert np.all(np.diff(flight.time) > 0)
    assert np.all(np.isfinite(flight.output))


def make(**change):
    columns = {
        "time": np.arange(10.0),
        "reference": np.ones(10),
        "output": np.zeros(10),
    }
    return dtm.Recording(**(columns | change))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"output": np.zeros(9)}, "have different lengths"),
        ({"time": np.zeros(10)}, "at row 1 the time repeats"),
        ({"time": np.arange(10.0)[::-1]}, "at row 1 the time goes back"),
        ({"output": [*np.zeros(9), np.inf]}, "inf at row 9"),
        ({"output": [*np.zeros(7), *[np.nan] * 3]}, "known in 7 of 10 rows, but at least 8"),
        ({"time": [*np.arange(9.0), np.nan]}, "time is nan at row 9"),
        ({"command": np.full(10, np.nan)}, "command is nan at row 0"),
        ({"output": np.zeros((10, 1))}, "shape"),
        ({"output": ["a"] * 10}, "not an array of numbers"),
        ({"command": np.full(10, np.inf)}, "command is inf"),
    ],
)
def test_a_recording_checks_its_columns(change, words):
    with pytest.raises(dtm.RecordingError, match=words):
        make(**change)


def test_a_recording_is_immutable():
    source = np.zeros(10)
    flight = make(output=source)
    source[:] = 5.0
    assert not flight.output.any()
    with pytest.raises(ValueError, match="read-only"):
        flight.output[0] = 1.0
    with pytest.raises(AttributeError):
        flight.output = source


def test_a_window_without_samples_is_refused_with_the_time_range():
    with pytest.raises(dtm.RecordingError, match=r"0 samples.*from 0 to 9 s"):
        make().window(100, 200)
    with pytest.raises(dtm.RecordingError, match="low below high"):
        make().window(5, 2)


def test_steps_are_the_changes_of_the_reference():
    flight = make(reference=[0, 0, 0, 1, 1, 1, 1, -2, -2, -2])
    assert [(step.index, step.time, step.amplitude) for step in flight.steps()] == [
        (3, 3.0, 1.0),
        (7, 7.0, -3.0),
    ]
