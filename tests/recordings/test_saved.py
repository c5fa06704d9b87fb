"""Recordings written and read again, bit for bit, and handed to other packages."""

import deadtime as dtm
import numpy as np
import pytest
from hypothesis import given, strategies as st
from step_table import COLUMNS, NAMES, assert_is_the_table

ENDINGS = [".csv", ".parquet"]

FLIGHT = dtm.read_recording(COLUMNS, **NAMES, command="speed")


def saved(flight, folder, ending):
    if ending == ".parquet":
        pytest.importorskip("pyarrow", reason="pyarrow writes Parquet files")
    path = folder / f"run{ending}"
    flight.save(path)
    return path


def assert_same_bits(found, flight):
    assert found == flight
    for name in ("time", "reference", "output", "command"):
        one, other = getattr(found, name), getattr(flight, name)
        assert (one is None) == (other is None)
        assert one is None or one.tobytes() == other.tobytes()


values = st.floats(allow_nan=False, min_value=-1e100, max_value=1e100)
#: What a format may quote, cut or change. A table of all characters takes seconds to make.
CHARACTERS = "a Z0,;'\"\\\n\r\t\0\x1b\x85\xa0é中\u2028\ufeff\ufffd\U0001f681"

columns = st.lists(values, min_size=9, max_size=9)


@pytest.mark.parametrize("ending", ENDINGS)
@given(
    time=st.lists(values, min_size=9, max_size=9, unique=True),
    reference=columns,
    output=columns,
    command=st.none() | columns,
    units=st.dictionaries(st.sampled_from(["time", "output"]), st.text(CHARACTERS, max_size=9)),
    source=st.text(CHARACTERS, max_size=20),
)
def test_a_recording_is_read_as_it_was_saved(
    ending, tmp_path_factory, time, reference, output, command, units, source
):
    flight = dtm.Recording(sorted(time), reference, output, command, units, source)
    path = saved(flight, tmp_path_factory.mktemp("saved"), ending)
    assert_same_bits(dtm.Recording.load(path), flight)


@pytest.mark.parametrize("ending", ENDINGS)
def test_zeros_keep_their_signs_and_small_numbers_their_bits(ending, tmp_path):
    output = np.array([0.0, -0.0, 5e-324, -5e-324, 2.2250738585072014e-308, 0.1, 1 / 3, 1e100])
    flight = dtm.Recording(np.arange(8.0), np.ones(8), output)
    assert_same_bits(dtm.Recording.load(saved(flight, tmp_path, ending)), flight)


@pytest.mark.parametrize("ending", ENDINGS)
def test_a_saved_recording_is_a_table_as_well(ending, tmp_path):
    path = saved(FLIGHT, tmp_path, ending)
    assert_is_the_table(dtm.read_recording(path, command="command"))


@pytest.mark.parametrize("ending", ENDINGS)
def test_the_format_of_a_saved_recording_is_told_by_its_bytes(ending, tmp_path):
    path = saved(FLIGHT, tmp_path, ending)
    assert_same_bits(dtm.Recording.load(path.rename(tmp_path / "run")), FLIGHT)


def test_the_file_is_as_documented(tmp_path):
    flight = dtm.Recording(np.arange(8.0), np.ones(8), np.zeros(8), units={"output": "m"})
    text = saved(flight, tmp_path, ".csv").read_text().splitlines()
    assert text[:4] == [
        "# deadtime recording",
        '# {"source": "", "units": {"output": "m"}}',
        "time,reference,output",
        "0.0,1.0,0.0",
    ]
    assert len(text) == 11


def test_other_endings_are_refused(tmp_path):
    with pytest.raises(ValueError, match=r"ends in '.txt': give a path ending in .csv or .parquet"):
        FLIGHT.save(tmp_path / "run.txt")


@pytest.mark.parametrize(
    "content",
    [
        "time,reference,output\n0,1,2\n",
        "# deadtime recording\ntime,reference,output\n0,1,2\n",
        "# deadtime recording\n# {]\ntime,reference,output\n0,1,2\n",
        '# deadtime recording\n# {"source": 3, "units": {}}\ntime,reference,output\n0,1,2\n',
        '# deadtime recording\n# {"source": "", "units": []}\ntime,reference,output\n0,1,2\n',
        '# deadtime recording\n# {"source": "", "units": {"a": 3}}\ntime,reference,output\n0,1\n',
        "# deadtime recording\n# " + "[" * 100_000 + "\ntime,reference,output\n",
    ],
)
def test_files_that_were_not_saved_are_refused(content, tmp_path):
    path = tmp_path / "run.csv"
    path.write_text(content)
    with pytest.raises(dtm.RecordingError, match=r"was not written by Recording\.save"):
        dtm.Recording.load(path)


def test_a_parquet_file_that_was_not_saved_is_refused(tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet", reason="pyarrow writes Parquet files")
    pyarrow = pytest.importorskip("pyarrow")
    parquet.write_table(pyarrow.table(COLUMNS), tmp_path / "run.parquet")
    with pytest.raises(dtm.RecordingError, match=r"was not written by Recording\.save"):
        dtm.Recording.load(tmp_path / "run.parquet")


def test_a_damaged_file_is_refused_with_the_line(tmp_path):
    path = saved(FLIGHT, tmp_path, ".csv")
    path.write_text(path.read_text().replace("\n0.2,", "\n0.2,x,", 1))
    with pytest.raises(
        dtm.RecordingError, match="line 6 has 5 cells, but there are 4 column names"
    ):
        dtm.Recording.load(path)
    with pytest.raises(dtm.RecordingError, match="does not exist"):
        dtm.Recording.load(tmp_path / "nowhere.csv")


def test_a_data_frame_holds_the_columns_and_can_be_read_again():
    pytest.importorskip("pandas")
    flight = dtm.Recording(
        FLIGHT.time, FLIGHT.reference, FLIGHT.output, units={"output": "m"}, source="x"
    )
    frame = flight.to_dataframe()
    assert list(frame) == ["time", "reference", "output"]
    assert frame.attrs == {"source": "x", "units": {"output": "m"}}
    frame.loc[0, "output"] = 7.0
    assert flight.output[0] == 0.0
    assert_is_the_table(dtm.read_recording(FLIGHT.to_dataframe(), command="command"))


def test_a_dataset_holds_the_columns_over_time_with_their_units():
    pytest.importorskip("xarray")
    flight = dtm.Recording(
        FLIGHT.time, FLIGHT.reference, FLIGHT.output, units={"output": "m"}, source="x"
    )
    data = flight.to_xarray()
    assert data["output"].dims == ("time",)
    assert data["output"].attrs == {"units": "m"}
    assert data.attrs == {"source": "x"}
    assert float(data["output"].sel(time=5.9, method="nearest")) == flight.output[-1]
    assert_is_the_table(dtm.read_recording(FLIGHT.to_xarray(), command="command"))
