"""Tables in memory: DataFrames, dicts, structured arrays, Datasets and Arrow tables."""

import sys

import deadtime as dtm
import numpy as np
import pytest
from step_table import COLUMNS, NAMES, assert_is_the_table

T, R, Y, U = COLUMNS.values()


def structured():
    table = np.empty(T.size, dtype=[(name, float) for name in COLUMNS])
    for name, values in COLUMNS.items():
        table[name] = values
    return table


def pandas_indexed():
    return pytest.importorskip("pandas").DataFrame(COLUMNS).set_index("t_s")


def pandas_nullable():
    return pytest.importorskip("pandas").DataFrame(COLUMNS).convert_dtypes()


def xarray_dataset():
    data = {name: ("t_s", values) for name, values in COLUMNS.items()}
    return pytest.importorskip("xarray").Dataset(data)


class Stream:
    """An object with nothing but the interface of Arrow."""

    def __init__(self, table):
        self.table = table

    def __arrow_c_stream__(self, requested_schema=None):
        return self.table.__arrow_c_stream__(requested_schema)


TABLES = {
    "dict of arrays": lambda: COLUMNS,
    "dict of lists": lambda: {name: values.tolist() for name, values in COLUMNS.items()},
    "structured array": structured,
    "pandas": lambda: pytest.importorskip("pandas").DataFrame(COLUMNS),
    "pandas, time as index": pandas_indexed,
    "pandas, nullable": pandas_nullable,
    "pandas, Arrow": lambda: (
        pytest.importorskip("pandas").DataFrame(COLUMNS).convert_dtypes(dtype_backend="pyarrow")
    ),
    "polars": lambda: pytest.importorskip("polars").DataFrame(COLUMNS),
    "polars, lazy": lambda: pytest.importorskip("polars").LazyFrame(COLUMNS),
    "xarray": xarray_dataset,
    "Arrow": lambda: pytest.importorskip("pyarrow").table(COLUMNS),
    "Arrow batch": lambda: pytest.importorskip("pyarrow").record_batch(COLUMNS),
    "Arrow stream": lambda: Stream(pytest.importorskip("pyarrow").table(COLUMNS)),
}


@pytest.mark.parametrize("kind", TABLES)
def test_a_table_is_read_bit_for_bit(kind):
    assert_is_the_table(dtm.read_recording(TABLES[kind](), **NAMES, command="speed"))


@pytest.mark.parametrize("kind", TABLES)
def test_a_missing_column_is_named_with_a_similar_one(kind):
    with pytest.raises(dtm.RecordingError, match=r"no column 'heigth_m'.*did you mean 'height_m'"):
        dtm.read_recording(TABLES[kind](), **(NAMES | {"output": "heigth_m"}))


def with_missing(kind, row, column="height_m"):
    """The table with a value that is missing, which is null and not NaN."""
    values = [None if k == row else value for k, value in enumerate(COLUMNS[column].tolist())]
    columns = COLUMNS | {column: values}
    if kind == "masked":
        mask = np.arange(T.size) == row
        return COLUMNS | {column: np.ma.array(COLUMNS[column], mask=mask)}
    if kind == "polars":
        return pytest.importorskip("polars").DataFrame(columns)
    if kind == "Arrow":
        return pytest.importorskip("pyarrow").table(columns)
    pandas = pytest.importorskip("pandas")
    return pandas.DataFrame(columns | {column: pandas.array(values, dtype="Float64")})


KINDS_OF_MISSING = ["masked", "pandas", "polars", "Arrow"]


@pytest.mark.parametrize("kind", KINDS_OF_MISSING)
@pytest.mark.parametrize("column", NAMES.values())
def test_a_missing_value_is_a_row_that_is_missing(kind, column):
    flight = dtm.read_recording(with_missing(kind, 30, column), **NAMES)
    if column == NAMES["reference"]:  # it holds
        assert flight == dtm.read_recording(COLUMNS, **NAMES)
        return
    assert np.isnan(flight.output).any() == (column == NAMES["output"])
    np.testing.assert_array_equal(flight.complete().time, np.delete(T, 30))
    np.testing.assert_array_equal(flight.complete().output, np.delete(Y, 30))


@pytest.mark.parametrize("kind", KINDS_OF_MISSING)
def test_a_missing_value_that_hides_a_step_is_refused(kind):
    with pytest.raises(dtm.RecordingError, match="row 10 is missing, and the reference changes"):
        dtm.read_recording(with_missing(kind, 10, "ref_m"), **NAMES)


@pytest.mark.parametrize("kind", KINDS_OF_MISSING)
def test_missing_values_outside_the_window_do_not_matter(kind):
    table = with_missing(kind, 10, "ref_m")
    with pytest.raises(dtm.RecordingError, match="so there is no step"):
        dtm.read_recording(table, **NAMES, window=(1.5, None))
    assert len(dtm.read_recording(with_missing(kind, 50), **NAMES, window=(0.2, 2.0))) == 19


@pytest.mark.parametrize("kind", ["dict of arrays", "pandas", "polars", "xarray", "Arrow"])
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_an_infinite_value_is_refused_with_its_row_and_nan_is_missing(kind, value):
    spoilt = COLUMNS | {"height_m": np.where(T[30] == T, value, Y)}
    columns = dict(COLUMNS)
    try:
        COLUMNS.update(spoilt)
        table = TABLES[kind]()
    finally:
        COLUMNS.update(columns)
    table = spoilt if kind == "dict of arrays" else table
    if np.isnan(value):
        assert np.flatnonzero(np.isnan(dtm.read_recording(table, **NAMES).output)).tolist() == [30]
        return
    with pytest.raises(dtm.RecordingError, match=f"the table, row 30: 'height_m' is {value}"):
        dtm.read_recording(table, **NAMES)
    assert len(dtm.read_recording(table, **NAMES, window=(None, 2.0))) == 21


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"t_s": T[::-1]}, "the table, row 1: the time goes back"),
        ({"t_s": np.where(T[7] == T, T[6], T)}, "the table, row 7: the time repeats"),
        ({"t_s": np.where(T[7] == T, np.nan, T)}, "the table, row 7: 't_s' is nan"),
        ({"height_m": Y[:-1]}, "have different lengths: {'t_s': 60, 'ref_m': 60, 'height_m': 59}"),
        ({"height_m": Y[:, None]}, r"column 'height_m' has shape \(60, 1\)"),
        (
            {"height_m": Y * 1j},
            "'height_m' is not a column of numbers: it contains complex numbers",
        ),
        ({"height_m": ["1.5"] * 60}, "it contains text"),
        ({"height_m": [1.5, "1.5"] * 30}, "it contains text"),
        ({"height_m": [{}] * 60}, "is not a column of numbers"),
        ({"height_m": Y * 1e200}, "another unit"),
        ({"ref_m": np.ones(60)}, "the reference 'ref_m' is 1 throughout"),
        ({name: values[:5] for name, values in COLUMNS.items()}, "5 samples, but at least 8"),
    ],
)
def test_a_bad_table_is_refused(change, words):
    with pytest.raises(dtm.RecordingError, match=words):
        dtm.read_recording(COLUMNS | change, **NAMES)


def test_two_columns_of_one_name_are_refused():
    frame = pytest.importorskip("pandas").DataFrame(COLUMNS).rename(columns={"speed": "ref_m"})
    with pytest.raises(dtm.RecordingError, match="2 columns with the name 'ref_m'"):
        dtm.read_recording(frame, **NAMES)


MILLISECONDS = np.arange(60) * 65


@pytest.mark.parametrize(
    "stamps",
    [
        MILLISECONDS.astype("timedelta64[ms]"),
        np.datetime64("2026-03-01T12:00:00") + MILLISECONDS.astype("timedelta64[ms]"),
    ],
)
@pytest.mark.parametrize("kind", ["dict", "pandas", "pandas with a zone", "polars", "xarray"])
def test_dates_and_durations_become_seconds(stamps, kind):
    table = COLUMNS | {"t_s": stamps}
    if kind.startswith("pandas"):
        table = pytest.importorskip("pandas").DataFrame(table)
        if "zone" in kind and stamps.dtype.kind == "M":
            table["t_s"] = table["t_s"].dt.tz_localize("Europe/Paris")
    elif kind == "polars":
        table = pytest.importorskip("polars").DataFrame(table)
    elif kind == "xarray":
        data = {name: ("t_s", values) for name, values in table.items()}
        table = pytest.importorskip("xarray").Dataset(data)
    flight = dtm.read_recording(table, **NAMES, window=(0.065, None))
    np.testing.assert_allclose(flight.time, MILLISECONDS[1:] * 1e-3, rtol=1e-14)


def test_no_library_is_loaded_for_a_dict(monkeypatch):
    for name in ("pandas", "polars", "pyarrow", "xarray", "h5py"):
        monkeypatch.setitem(sys.modules, name, None)
    assert_is_the_table(dtm.read_recording(COLUMNS, **NAMES, command="speed"))


def test_the_table_does_not_change_with_its_source():
    columns = {name: values.copy() for name, values in COLUMNS.items()}
    flight = dtm.read_recording(columns, **NAMES)
    columns["height_m"][:] = 5.0
    assert_is_the_table(flight)
