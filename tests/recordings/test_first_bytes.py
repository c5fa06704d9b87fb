"""Formats are told by their first bytes, and what is no table is refused by its name."""

import gzip
import struct
import zipfile

import deadtime as dtm
import numpy as np
import pytest
from flights import flight_path
from step_table import COLUMNS, NAMES, as_csv, assert_is_the_table

TLOG = struct.pack(">Q", 1_700_000_000_000_000)


@pytest.mark.parametrize(
    ("head", "words"),
    [
        (b"ULog\x01\x12\x35\x00", "a ULog file of PX4: open it with dtm.open_log"),
        (b"\xa3\x95\x80\x80", "a DataFlash log of ArduPilot or PX4: open it with dtm.open_log"),
        (b"FMT, 128, 89, FMT, BBnNZ, Type", "DataFlash log of ArduPilot in text form: open it"),
        (b"H Product:Blackbox flight data recorder", "a Blackbox log .*: open it with dtm.open_lo"),
        (b"\xbc\x01", "a Crazyflie's memory card: open it with dtm.open_log"),
        (b"\xbc\x02", "a Crazyflie's memory card: open it with dtm.open_log"),
        (TLOG + b"\xfd\x09", r"a MAVLink log of a ground station \(tlog\): open it with"),
        (TLOG + b"\xfe\x09", "tlog"),
        (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", r"an Excel sheet \(.xls\).*: save the sheet as CSV"),
        (b"\x89PNG\r\n\x1a\n", "a PNG picture"),
        (b"%PDF-1.7", "a PDF document"),
        (b"#ROSBAG V2.0\n", "a ROS bag"),
        (b"\x89HDF\r\n\x1a\n", "an HDF5 file that does not come from MATLAB"),
        (b"SQLite format 3\0", "an SQLite database"),
    ],
)  # fmt: skip
def test_other_files_are_refused_by_their_name(head, words, tmp_path):
    path = tmp_path / "flight.csv"
    path.write_bytes(head + bytes(200))
    with pytest.raises(dtm.RecordingError, match=words):
        dtm.read_recording(path)


def test_written_archives_and_arrays_are_named(tmp_path):
    with zipfile.ZipFile(tmp_path / "a.csv", "w") as archive:
        archive.writestr("flight.csv", as_csv())
    np.save(tmp_path / "b.npy", COLUMNS["t_s"])
    for name, words in (("a.csv", "a zip archive"), ("b.npy", "a file of one NumPy array")):
        with pytest.raises(dtm.RecordingError, match=words):
            dtm.read_recording(tmp_path / name)


def test_the_name_of_a_file_does_not_matter(tmp_path):
    path = tmp_path / "flight.parquet"
    path.write_bytes(gzip.compress(as_csv().encode()))
    assert_is_the_table(dtm.read_recording(path, **NAMES))


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("px4_sitl_takeoff.ulg", "ULog"),
        ("px4_sample.ulg", "ULog"),
        ("px4_tagged_params.ulg", "ULog"),
        ("arducopter_2014-10-18_21-19-07.bin", "DataFlash"),
        ("ardupilot_sitl_guided_heights.bin", "DataFlash"),
        ("betaflight_error_recovery.bbl", "Blackbox"),
        ("crazyflie_log10.cfusd", "Crazyflie"),
        ("ardrone2_full_navdata_expD_every12.lp32", "neither a text file"),
    ],
)
def test_logs_of_vehicles_are_told_from_tables(name, words):
    with pytest.raises(dtm.RecordingError, match=words):
        dtm.read_recording(flight_path(name))


def test_a_separator_is_for_text():
    with pytest.raises(ValueError, match="delimiter=';': a table in memory has no delimiter"):
        dtm.read_recording(COLUMNS, **NAMES, delimiter=";")


@pytest.mark.parametrize("source", [3, None, b"flight.csv", [1.0, 2.0], np.zeros(9)])
def test_what_is_no_table_is_refused(source):
    with pytest.raises(TypeError, match="is not a table: give a path, a DataFrame"):
        dtm.read_recording(source)
