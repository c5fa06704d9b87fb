"""Tables in text: encodings, separators, decimal commas, packing, and the passes over them."""

import gzip
import sys

import deadtime as dtm
import numpy as np
import pytest
from deadtime.recordings.readers._csv import _at_once, read_csv
from deadtime.recordings.readers._lines import read_lines
from deadtime.recordings.readers._text import as_text, indices
from hypothesis import given
from hypothesis import strategies as st
from step_table import COLUMNS, NAMES, as_csv, assert_is_the_table

EVER = (-np.inf, np.inf)


@pytest.fixture(params=["with pyarrow", "without pyarrow"])
def passes(request, monkeypatch):
    """Both passes over all numbers at once."""
    if request.param == "with pyarrow":
        pytest.importorskip("pyarrow.csv", reason="pyarrow is not installed")
    else:
        monkeypatch.setitem(sys.modules, "pyarrow", None)


@pytest.fixture
def fast(monkeypatch):
    """Refuse the pass line by line."""

    def refused(*_):
        raise AssertionError("the file was read line by line")

    monkeypatch.setattr("deadtime.recordings.readers._csv.read_lines", refused)


def read(folder, content, **options):
    path = folder / "flight.csv"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return dtm.read_recording(path, **(NAMES | options))


WRITINGS = {
    "plain": as_csv(),
    "line feeds and carriage returns": as_csv(end="\r\n"),
    "carriage returns": as_csv(end="\r"),
    "semicolons": as_csv(delimiter=";"),
    "tabs": as_csv(delimiter="\t"),
    "blanks": as_csv(delimiter="  "),
    "decimal commas": as_csv(delimiter=";").replace(".", ","),
    "decimal commas and tabs": as_csv(delimiter="\t").replace(".", ","),
    "decimal commas and blanks": as_csv(delimiter=" ").replace(".", ","),
    "comments": "# flight 3\n\n" + as_csv().replace("\n0.4,", "\n# a gust, \"hm\n\n0.4,"),
    "empty lines": as_csv(end="\n\n"),
    "without the last line end": as_csv().rstrip(),
    "UTF-8 with a mark": "\ufeff".encode() + as_csv().encode(),
    "UTF-16": as_csv().encode("utf-16"),
    "UTF-16, big-endian": b"\xfe\xff" + as_csv().encode("utf-16-be"),
    "packed": gzip.compress(as_csv().encode()),
    "packed UTF-16": gzip.compress(as_csv().encode("utf-16")),
    "blanks around the cells": as_csv().replace(",", " , "),
    "a column of text": as_csv(COLUMNS | {"mode": ["hover, \"safe\""] * 60}, delimiter=";"),
    "more columns": as_csv({"n": range(60)} | COLUMNS | {"battery": np.ones(60)}),
}  # fmt: skip


@pytest.mark.parametrize("writing", WRITINGS)
def test_a_table_is_read_bit_for_bit(writing, passes, tmp_path):
    assert_is_the_table(read(tmp_path, WRITINGS[writing], command="speed"))


@pytest.mark.parametrize("writing", sorted(WRITINGS.keys() - {"a column of text"}))
def test_a_clean_table_is_read_at_once(writing, passes, fast, tmp_path):
    assert_is_the_table(read(tmp_path, WRITINGS[writing], command="speed"))


def test_a_column_may_be_read_twice(passes, fast, tmp_path):
    flight = read(tmp_path, as_csv(), command="height_m")
    np.testing.assert_array_equal(flight.command, flight.output)


def test_quoted_decimal_commas_are_read(tmp_path):
    quoted = as_csv(delimiter='","').replace(".", ",").replace("\n", '"\n"')
    assert_is_the_table(read(tmp_path, f'"{quoted[:-1]}', command="speed"))


def test_names_in_latin_1_and_utf_8_are_found(tmp_path):
    for encoding in ("latin-1", "utf-8"):
        table = as_csv().replace("height_m", "höhe_m").encode(encoding)
        assert_is_the_table(read(tmp_path, table, output="höhe_m"))


def test_the_separator_is_the_one_that_finds_the_names(passes, tmp_path):
    renamed = {"t s": 0, "ref, m": 1, "height m": 2}
    table = as_csv(dict(zip(renamed, list(COLUMNS.values())[:3], strict=True)), delimiter=";")
    assert_is_the_table(read(tmp_path, table, time="t s", reference="ref, m", output="height m"))
    with pytest.raises(dtm.RecordingError, match=r"no column 't s'.* it has 't s;ref', 'm;height"):
        read(tmp_path, table, time="t s", reference="ref, m", output="height m", delimiter=",")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("\n0.5,", "\n0.5,,"), "line 7: 5 cells under 4 column names"),
        (("\n0.5,0.0,", "\n0.5,"), "line 7: 3 cells, so the column 'speed' has none"),
        (("\n0.5,0.0,", "\n0.5,,"), "line 7: '' in column 'ref_m' is not a number"),
        (("\n0.5,0.0,", "\n0.5,0x1p3,"), "line 7: '0x1p3' in column 'ref_m' is not a number"),
        (("\n0.5,0.0,", "\n0.5,1_0,"), "line 7: '1_0' in column 'ref_m' is not a number"),
        (("\n0.5,0.0,", "\n0.5,1e999,"), "line 7: 'ref_m' is inf"),
        (("\n0.5,0.0,", "\n0.5,-inf,"), "line 7: 'ref_m' is -inf"),
        (("\n0.5,0.0,", "\nNaN,0.0,"), "line 7: 't_s' is nan"),
        (("\n0.5,", "\n# gust\n\n0.1,"), "line 9: the time goes back .0.4 is followed by 0.1."),
        (("\n0.5,", "\n0.4,"), "line 7: the time repeats"),
        (("\n0.5,", "\n0.5\n"), "line 7: 1 cells, so the column 'ref_m' has none"),
        (("\n0.5,", '\n0.5,"'), "not a CSV file"),
        (("\n0.5,0.0,", '\n0.5,"0,0",'), "line 7: '0,0' .* a decimal comma, and line 2 has "),
        (("\n0.5,0.0,", '\n0.5,"1,000,000",'), "line 7: '1,000,000' .* no comma"),
    ],
)  # fmt: skip
def test_a_bad_line_is_named(change, words, passes, tmp_path):
    table = as_csv()
    assert change[0] in table
    with pytest.raises(dtm.RecordingError, match=words):
        read(tmp_path, table.replace(*change, 1), command="speed")


@pytest.mark.parametrize("delimiter", [",", ";", " "])
def test_a_line_that_is_too_long_is_refused_beside_one_that_is_too_short(
    delimiter, passes, tmp_path
):
    # loadtxt counts no cells behind those it reads.
    table = as_csv(delimiter=delimiter)
    last = table.splitlines()[-1]
    table = table.replace("\n0.5", f"\n0.45{delimiter}0", 1).replace(
        last, last[: last.rindex(delimiter)]
    )
    with pytest.raises(dtm.RecordingError, match="line 7: 5 cells under 4 column names"):
        read(tmp_path, table)


def test_rows_outside_the_window_may_hold_text(passes, tmp_path):
    table = as_csv().replace("\n0.2,0.0,", "\n0.2,none,")
    assert len(read(tmp_path, table, window=(0.5, None))) == 55
    with pytest.raises(dtm.RecordingError, match="line 4: 'none'"):
        read(tmp_path, table)


@pytest.mark.parametrize("window", [(0.5, 4.0), (None, 4.0), (0.3, 4.4)])
def test_values_outside_the_window_may_be_nan(window, passes, fast, tmp_path):
    inside = read(tmp_path, as_csv().replace("\n4.8,1.0,", "\n4.8,nan,"), window=window)
    low, high = window[0] or 0.0, window[1] or 4.5
    rows = (COLUMNS["t_s"] >= low - 1e-9) & (COLUMNS["t_s"] <= high + 1e-9)
    np.testing.assert_array_equal(inside.output, COLUMNS["height_m"][rows])


cells = st.sampled_from(
    ["0", "1", "-0.0", "2.5", "3e2", " 4", "nan", "inf", "", "x", "1,5", "7.", ".5", "+1", "0x1",
     "1_0", "1e999", "1d2", "#", '"1"', "1 2", "1\u00a0", "\u0661", "1e-400", "1e308"]
)  # fmt: skip
rows = st.lists(st.lists(cells, min_size=1, max_size=4), max_size=5)


@given(rows, st.sampled_from(",;\t "), st.sampled_from(["\n", "\r\n", "\n\n", "\r"]))
def test_what_is_read_at_once_is_what_is_read_line_by_line(rows, delimiter, end):
    table = end.join(delimiter.join(row) for row in [["t", "r", "y"], *rows]).encode()
    names = {"time": "t", "reference": "r", "output": "y"}
    text = as_text("flight.csv", table, names.values(), delimiter)
    with pytest.MonkeyPatch.context() as patch:
        for pyarrow in (True, False):
            if not pyarrow:
                patch.setitem(sys.modules, "pyarrow", None)
            found = _at_once(text, [0, 1, 2])
            if found is None or not all(np.isfinite(one).all() for one in found.values()):
                continue
            if (np.diff(found[0]) <= 0.0).any():
                continue
            slow = read_lines(text, names, indices(text, names), EVER)
            fast = read_csv(text, names, EVER)
            assert fast.keys() == slow.keys()
            for signal, column in slow.items():
                assert fast[signal].tobytes() == column.tobytes()


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (gzip.compress(as_csv().encode())[:-20], "cannot be unpacked, it is damaged"),
        (gzip.compress(as_csv().encode())[:300] + b"\xff" * 90, "cannot be unpacked"),
        (gzip.compress(b"PK\x03\x04" + bytes(99)), "is a zip archive"),
        (gzip.compress(b"PAR1" + bytes(99)), "holds no text: unpack it"),
        (gzip.compress(bytes(99)), "not a text file"),
        (b"\xff\xfe" + as_csv().encode("utf-16")[3:], "not a text file"),
        (b"time\x07reference", "not a text file"),
        (b"\xfe\xed\xfa\xce\x0f", "not a text file"),
    ],
)
def test_damaged_files_are_refused(content, words, tmp_path):
    with pytest.raises(dtm.RecordingError, match=words):
        read(tmp_path, content)


def test_a_file_that_unpacks_to_far_more_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("deadtime.recordings.readers._limits.UNPACKED", 0)
    long = as_csv() + "# a comment\n" * 1_000_000
    with pytest.raises(dtm.RecordingError, match="unpacks to more than"):
        read(tmp_path, gzip.compress(long.encode()))
