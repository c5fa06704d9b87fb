"""Parquet, Arrow and Feather files."""

import deadtime as dtm
import numpy as np
import pytest
from step_table import COLUMNS, NAMES, assert_is_the_table

pyarrow = pytest.importorskip("pyarrow", reason="pyarrow reads Parquet and Arrow files")
feather = pytest.importorskip("pyarrow.feather")
parquet = pytest.importorskip("pyarrow.parquet")

TABLE = pyarrow.table(COLUMNS | {"mode": ["hover"] * 60, "height_cm": np.arange(60)})


def as_stream(table, path):
    with pyarrow.OSFile(str(path), "wb") as file, pyarrow.ipc.new_stream(file, table.schema) as out:
        out.write_table(table)


def as_file(table, path):
    with pyarrow.OSFile(str(path), "wb") as file, pyarrow.ipc.new_file(file, table.schema) as out:
        out.write_table(table, max_chunksize=7)


WRITERS = {
    "Parquet": parquet.write_table,
    "Parquet, packed": lambda table, path: parquet.write_table(
        table, path, compression="zstd", row_group_size=9
    ),
    "Feather": feather.write_feather,
    "Arrow": as_file,
    "Arrow stream": as_stream,
}


def written(folder, writer, table=TABLE):
    path = folder / "flight.csv"
    WRITERS[writer](table, path)
    return path


@pytest.mark.parametrize("writer", WRITERS)
def test_a_file_is_read_bit_for_bit(writer, tmp_path):
    path = written(tmp_path, writer)
    assert_is_the_table(dtm.read_recording(path, **NAMES, command="speed"))
    flight = dtm.read_recording(path, **(NAMES | {"output": "height_cm"}), window=(0.5, 1.5))
    assert flight.output.tolist() == list(range(5, 16))


@pytest.mark.parametrize("writer", WRITERS)
def test_a_missing_column_is_named_with_a_similar_one(writer, tmp_path):
    with pytest.raises(dtm.RecordingError, match=r"no column 'heigth_m'.*did you mean 'height_m'"):
        dtm.read_recording(written(tmp_path, writer), **(NAMES | {"output": "heigth_m"}))


@pytest.mark.parametrize("writer", WRITERS)
def test_a_column_of_text_is_refused(writer, tmp_path):
    with pytest.raises(dtm.RecordingError, match="column 'mode' is not a column of numbers"):
        dtm.read_recording(written(tmp_path, writer), **(NAMES | {"output": "mode"}))


def test_missing_values_are_rows_that_are_missing(tmp_path):
    heights = COLUMNS["height_m"].tolist()
    heights[30] = None
    table = pyarrow.table(COLUMNS | {"height_m": heights})
    flight = dtm.read_recording(written(tmp_path, "Parquet", table), **NAMES)
    np.testing.assert_array_equal(flight.complete().time, np.delete(COLUMNS["t_s"], 30))
    reference = COLUMNS["ref_m"].tolist()
    reference[10] = None
    table = pyarrow.table(COLUMNS | {"ref_m": reference})
    with pytest.raises(dtm.RecordingError, match="row 10 is missing, and the reference changes"):
        dtm.read_recording(written(tmp_path, "Parquet", table), **NAMES)


def test_whole_numbers_with_missing_values_and_dates_are_read(tmp_path):
    stamps = pyarrow.array(range(0, 60 * 65, 65), pyarrow.timestamp("ms", tz="UTC"))
    counts = pyarrow.array([None if k == 40 else k for k in range(60)], pyarrow.int32())
    table = pyarrow.table(COLUMNS | {"t_s": stamps, "height_m": counts})
    flight = dtm.read_recording(written(tmp_path, "Parquet", table), **NAMES)
    assert np.flatnonzero(np.isnan(flight.output)).tolist() == [40]
    np.testing.assert_allclose(np.diff(flight.time[:40]), 0.065, rtol=1e-12)
    assert flight.output[-1] == 59.0


def test_a_file_that_says_it_holds_far_more_is_refused(tmp_path, monkeypatch):
    # A column of one value takes a few bytes, however long it is.
    monkeypatch.setattr("deadtime.recordings.readers._limits.UNPACKED", 0)
    long = pyarrow.table(dict.fromkeys(NAMES.values(), np.zeros(1_000_000)))
    with pytest.raises(dtm.RecordingError, match="should contain 3000000 numbers"):
        dtm.read_recording(written(tmp_path, "Parquet", long), **NAMES)


@pytest.mark.parametrize("writer", WRITERS)
def test_a_file_that_is_cut_off_is_refused(writer, tmp_path):
    path = written(tmp_path, writer)
    content = path.read_bytes()
    path.write_bytes(content[: len(content) // 2])
    with pytest.raises(dtm.RecordingError, match="may be damaged or cut off"):
        dtm.read_recording(path, **NAMES)


def test_a_separator_is_for_text(tmp_path):
    with pytest.raises(ValueError, match="is a file of Parquet, which has no delimiter"):
        dtm.read_recording(written(tmp_path, "Parquet"), **NAMES, delimiter=";")
