"""Tables in text: encodings, separators, decimal commas, packing, quotes, and what is refused."""

import csv
import gzip
import re
import tempfile
from pathlib import Path

import deadtime as dtm
import numpy as np
import pytest
from hypothesis import assume, example, given, strategies as st
from step_table import COLUMNS, NAMES, as_csv, assert_is_the_table


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
def test_a_table_is_read_bit_for_bit(writing, tmp_path):
    assert_is_the_table(read(tmp_path, WRITINGS[writing], command="speed"))


def test_a_column_may_be_read_twice(tmp_path):
    flight = read(tmp_path, as_csv(), command="height_m")
    np.testing.assert_array_equal(flight.command, flight.output)


def test_quoted_decimal_commas_are_read(tmp_path):
    quoted = as_csv(delimiter='","').replace(".", ",").replace("\n", '"\n"')
    assert_is_the_table(read(tmp_path, f'"{quoted[:-1]}', command="speed"))


def test_names_in_latin_1_and_utf_8_are_found(tmp_path):
    for encoding in ("latin-1", "utf-8"):
        table = as_csv().replace("height_m", "höhe_m").encode(encoding)
        assert_is_the_table(read(tmp_path, table, output="höhe_m"))


@pytest.mark.parametrize(
    "first", ["0.0,55.0,-55.31,+3e-2", "0,5;1,0;nan", "2026-01-05 08:00:00,54.88,,40.", "1 2 3"]
)
def test_a_table_without_names_is_told_where_they_have_to_be(first, tmp_path):
    path = tmp_path / "run.csv"
    path.write_text(f"# a comment\n{first}\n{first}\n")
    words = f"contains numbers, {first!r}. Add a line with the names of the columns"
    for names in ({}, NAMES):
        with pytest.raises(dtm.RecordingError, match=re.escape(words)):
            dtm.read_recording(path, **names)


def test_numbers_are_names_where_they_are_asked_for(tmp_path):
    numbered = "0,1,2,3\n" + as_csv().partition("\n")[2]
    read(tmp_path, numbered, time="0", reference="1", output="2")


def test_the_separator_is_the_one_that_finds_the_names(tmp_path):
    renamed = {"t s": 0, "ref, m": 1, "height m": 2}
    table = as_csv(dict(zip(renamed, list(COLUMNS.values())[:3], strict=True)), delimiter=";")
    assert_is_the_table(read(tmp_path, table, time="t s", reference="ref, m", output="height m"))
    with pytest.raises(
        dtm.RecordingError, match=r"no column 't s'.* Its columns are 't s;ref', 'm;height"
    ):
        read(tmp_path, table, time="t s", reference="ref, m", output="height m", delimiter=",")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("\n0.5,", "\n0.5,,"), "line 7 has 5 cells, but there are 4 column names"),
        (("\n0.5,0.0,", "\n0.5,"), "line 7 has 3 cells, so the cell of the column 'speed' is"),
        (("\n0.5,0.0,", "\n0.5,0x1p3,"), "line 7: '0x1p3' in column 'ref_m' is not a number"),
        (("\n0.5,0.0,", "\n0.5,1_0,"), "line 7: '1_0' in column 'ref_m' is not a number"),
        (("\n0.5,0.0,", "\n0.5,1e999,"), "line 7: 'ref_m' is inf"),
        (("\n0.5,0.0,", "\n0.5,-inf,"), "line 7: 'ref_m' is -inf"),
        (("\n0.5,0.0,", "\nNaN,0.0,"), "line 7: 't_s' is nan"),
        (("\n0.5,", "\n# gust\n\n0.1,"), "line 9: the time goes back .0.4 is followed by 0.1."),
        (("\n0.5,", "\n0.4,"), "line 7: the time repeats"),
        (("\n0.5,", "\n0.5\n"), "line 7 has 1 cells, so the cell of the column 'ref_m' is missing"),
        (("\n0.5,", '\n0.5,"'), "not a CSV file"),
        (("\n0.5,0.0,", '\n0.5,"0,0",'), "line 7: '0,0' .* a decimal comma, but line 2 has "),
        (("\n0.5,0.0,", '\n0.5,"1,000,000",'), "line 7: '1,000,000' .* no comma"),
    ],
)  # fmt: skip
def test_a_bad_line_is_named(change, words, tmp_path):
    table = as_csv()
    assert change[0] in table
    with pytest.raises(dtm.RecordingError, match=words):
        read(tmp_path, table.replace(*change, 1), command="speed")


@pytest.mark.parametrize("delimiter", [",", ";", " "])
def test_a_line_that_is_too_long_is_refused_beside_one_that_is_too_short(delimiter, tmp_path):
    table = as_csv(delimiter=delimiter)
    last = table.splitlines()[-1]
    table = table.replace("\n0.5", f"\n0.45{delimiter}0", 1).replace(
        last, last[: last.rindex(delimiter)]
    )
    with pytest.raises(
        dtm.RecordingError, match="line 7 has 5 cells, but there are 4 column names"
    ):
        read(tmp_path, table)


def test_rows_outside_the_window_may_hold_text(tmp_path):
    table = as_csv().replace("\n0.2,0.0,", "\n0.2,none,")
    assert len(read(tmp_path, table, window=(0.5, None))) == 55
    with pytest.raises(dtm.RecordingError, match="line 4: 'none'"):
        read(tmp_path, table)


@pytest.mark.parametrize("window", [(0.5, 4.0), (None, 4.0), (0.3, 4.4)])
def test_values_outside_the_window_may_be_nan(window, tmp_path):
    inside = read(tmp_path, as_csv().replace("\n4.8,1.0,", "\n4.8,nan,"), window=window)
    low, high = window[0] or 0.0, window[1] or 4.5
    rows = (COLUMNS["t_s"] >= low - 1e-9) & (COLUMNS["t_s"] <= high + 1e-9)
    np.testing.assert_array_equal(inside.output, COLUMNS["height_m"][rows])


def values(texts):
    """The output of a table with these cells in quotes, read by the package."""
    rows = "".join(f'{k},{min(k, 1)},"{text}"\n' for k, text in enumerate([*texts, *"00000000"]))
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "flight.csv")
        file.write_text("time,reference,output\n" + rows)
        return dtm.read_recording(file).output[: len(texts)]


digits = st.text("0123456789", max_size=25)
written = st.builds(
    "{}{}.{}{}".format,
    st.sampled_from(["", "-", "+"]),
    st.text("0123456789", min_size=1, max_size=25),
    digits,
    st.one_of(st.just(""), st.integers(-330, 300).map("e{}".format)),
)
#: `Recording` takes no larger ones.
doubles = st.floats(-1e100, 1e100)
numbers = st.one_of(doubles.map(repr), doubles.map("{:.17g}".format), written)


@given(st.lists(numbers, min_size=1, max_size=20))
@example(["9007199254740993", "9007199254740992.0", "0.30000000000000004", "-0", "-.0", "5."])
@example(["2.2250738585072011e-308", "4.9e-324", "2.47e-324", "1e-400"])
@example(["0.0000000000000000000001", "12345678901234567890", "9" * 100, " 7 ", "1E5"])
def test_numbers_are_those_of_python_bit_for_bit(texts):
    known = [float(text) for text in texts]
    assume(all(abs(value) <= 1e100 for value in known))
    assert values(texts).tobytes() == np.array(known).tobytes()


columns = st.lists(doubles, min_size=8, max_size=30)


@given(columns, columns, st.sampled_from(",;\t"), st.sampled_from(["\n", "\r\n"]), st.booleans())
def test_tables_are_those_of_pandas(references, outputs, delimiter, end, is_quoted):
    pandas = pytest.importorskip("pandas", reason="pandas is not installed")
    rows = min(len(references), len(outputs))
    assume(len(set(references[:rows])) > 1)
    table = pandas.DataFrame(
        {"time": np.arange(rows) / 7.0, "reference": references[:rows], "output": outputs[:rows]}
    )
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "flight.csv")
        quoting = csv.QUOTE_ALL if is_quoted else csv.QUOTE_MINIMAL
        table.to_csv(file, index=False, sep=delimiter, lineterminator=end, quoting=quoting)
        known = pandas.read_csv(file, sep=delimiter)
        found = dtm.read_recording(file)
    for name in table:
        assert getattr(found, name).tobytes() == known[name].to_numpy(float).tobytes()


cells = st.sampled_from(
    ["0", "1", "-0.0", "2.5", "3e2", " 4", "nan", "inf", "", "x", "7.", ".5", "+1", "0x1", "1_0",
     "1e999", "1d2", "#", '"1"', '"1', '"2"3', '""', "1 2", "1\u00a0", "\u0661", "1e-400", "1e308"]
)  # fmt: skip
rows = st.lists(st.lists(cells, min_size=1, max_size=4), max_size=5)

#: Rows before those that are drawn: a recording has eight samples at least.
BEFORE = [[str(k), str(k // -4 + 2), "0.5"] for k in range(-8, 0)]


def by_python(table, delimiter):
    """The columns of a table by the csv module and float(), None where they make no recording."""
    lines = [line for line in table.splitlines() if line.strip() and line.strip()[0] != "#"]
    try:
        found = [*csv.reader(lines, delimiter=delimiter, strict=True)][1:]
        assert not any(
            "_" in cell or not cell.strip("\xa0").isascii() for row in found for cell in row
        )
        assert not any("".join(row[3:]).strip() for row in found)
        columns = np.array(
            [[float(row[0]), *(float(cell.strip() or "nan") for cell in row[1:3])] for row in found]
        )
        assert columns.shape[1] == 3
        assert not np.isinf(columns).any()
        assert not np.isnan(columns[:, 0]).any()
        read = dtm.Recording(*columns.T)
        assert read.steps()
        columns[:, 1] = read.reference
    except (AssertionError, csv.Error, IndexError, ValueError):
        return None
    return columns.T


@given(rows, st.sampled_from(",;\t"), st.sampled_from(["\n", "\r\n", "\n\n", "\r"]))
@example([["0", "0", "1"], ["1", '"1"', ".5"], ["2.5", "7.", "nan"]], ";", "\n")
@example([["0", "0", "1"], ["1", '"1"', ".5"], ["2.5", "7.", "1\u00a0"]], ";", "\n")
@example([["0", "0", "1"], ["1", '"1"', ".5"], ["2.5", "7.", "3e2", " "]], ",", "\r\n")
def test_what_is_read_is_what_python_reads(rows, delimiter, end):
    table = end.join(
        delimiter.join(row) for row in [["time", "reference", "output"], *BEFORE, *rows]
    )
    known = by_python(table, delimiter)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "flight.csv")
        file.write_bytes(table.encode())
        if known is None:
            with pytest.raises(dtm.RecordingError):
                dtm.read_recording(file, delimiter=delimiter)
            return
        found = dtm.read_recording(file, delimiter=delimiter)
    for column, name in zip(known, ("time", "reference", "output"), strict=True):
        assert getattr(found, name).tobytes() == column.tobytes()


def test_an_empty_cell_is_a_missing_output(tmp_path):
    flight = read(tmp_path, as_csv().replace("\n0.5,0.0,", "\n0.5,,"))
    assert flight == read(tmp_path, as_csv())
    lines = as_csv().splitlines()
    place = lines[0].split(",").index("height_m")
    cells = lines[31].split(",")
    cells[place] = " "
    lines[31] = ",".join(cells)
    flight = read(tmp_path, "\n".join(lines))
    assert np.flatnonzero(np.isnan(flight.output)).tolist() == [30]
    assert len(flight.complete()) == len(flight) - 1


def test_a_quoted_cell_may_hold_line_ends(tmp_path):
    header, *lines = as_csv().splitlines()
    rows = [f'{line},"a ""gust""\n# and\r\nmore"\n' for line in lines]
    assert_is_the_table(read(tmp_path, f"{header},note\n{''.join(rows)}"))
    rows[7] = rows[7].replace(",", ",x", 1)
    with pytest.raises(dtm.RecordingError, match=r"line 25: 'x0.0' in column 'ref_m' is not a num"):
        read(tmp_path, f"{header},note\n{''.join(rows)}")


def test_a_separator_may_be_any_character(tmp_path):
    for encoding in ("latin-1", "utf-8"):
        table = as_csv(delimiter="¦").encode(encoding)
        assert_is_the_table(read(tmp_path, table, delimiter="¦"))
    for wrong in ("", ", ", '"', "\n"):
        with pytest.raises(dtm.RecordingError, match="give one character, but not a quote or"):
            read(tmp_path, as_csv(), delimiter=wrong)


THOUSANDS = "0,0,950\n" + "".join(f'{k},1,"1,{k}20"\n' for k in range(1, 9))


def test_a_comma_that_may_stand_for_thousands_is_refused(tmp_path):
    names = {"time": "t", "reference": "r", "output": "y"}
    with pytest.raises(
        dtm.RecordingError, match=r"line 3: '1,120' in column 'y' may be 1.12 or 1120"
    ):
        read(tmp_path, "t,r,y\n" + THOUSANDS, **names)
    with pytest.raises(dtm.RecordingError, match=r"'1,120' .* a decimal comma, but line 2 has"):
        read(tmp_path, "t,r,y\n" + THOUSANDS.replace("950", "950.5"), **names)
    # Cells that can be nothing but decimals decide for all.
    for decimal in ('"0,950"', '"1,02"', '"1234,567"', '"1,0201"', '"1,020e0"', '"01,950"'):
        found = read(tmp_path, "t,r,y\n" + THOUSANDS.replace("950", decimal), **names)
        assert found.output[1:].tolist() == [1.12, 1.22, 1.32, 1.42, 1.52, 1.62, 1.72, 1.82]


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (gzip.compress(as_csv().encode(), mtime=0)[:-20], "is damaged and cannot be unpacked"),
        (gzip.compress(as_csv().encode(), mtime=0)[:300] + b"\xff" * 90, "cannot be unpacked"),
        (gzip.compress(b"PK\x03\x04" + bytes(99), mtime=0), "is a zip archive"),
        (gzip.compress(b"PAR1" + bytes(99), mtime=0), "does not contain text: unpack the file"),
        (gzip.compress(bytes(99), mtime=0), "neither a text file"),
        (b"\xff\xfe" + as_csv().encode("utf-16")[3:], "neither a text file"),
        (b"time\x07reference", "neither a text file"),
        (b"\xfe\xed\xfa\xce\x0f", "neither a text file"),
    ],
)
def test_damaged_files_are_refused(content, words, tmp_path):
    with pytest.raises(dtm.RecordingError, match=words):
        read(tmp_path, content)


def test_a_file_that_unpacks_to_far_more_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("deadtime.recordings.readers._limits.UNPACKED", 0)
    long = as_csv() + "# a comment\n" * 1_000_000
    with pytest.raises(dtm.RecordingError, match="but more than"):
        read(tmp_path, gzip.compress(long.encode()))
