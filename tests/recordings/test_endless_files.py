"""Files that are too long for memory, or have no end, are refused before they are read."""

from __future__ import annotations

import os
import threading

import deadtime as dtm
import pytest
from deadtime.recordings import _first_bytes
from deadtime.recordings.readers._limits import largest

HEADS = {
    "text": b"time,reference,output\n",
    "zeros": b"\0",
    "gzip": b"\x1f\x8b\x08\0",
    "MAT": b"MATLAB 5.0 MAT-file".ljust(128) + b"\0",
    "Parquet": b"PAR1",
    "ULog": b"ULog\x01\x12\x35\x01" + bytes(8),
    "DataFlash": b"\xa3\x95\x80",
    "DataFlash text": b"FMT, 1, 23, ATT, Qcc, TimeUS,DesRoll,Roll\n",
    "Blackbox": b"H Product:Blackbox",
}

READERS = (dtm.read_recording, dtm.open_log, dtm.Recording.load)


@pytest.mark.parametrize("reader", READERS)
@pytest.mark.parametrize("head", HEADS)
def test_a_sparse_file_of_100_gb_is_refused(tmp_path, reader, head):
    """It was read until memory was gone."""
    path = tmp_path / "log"
    path.write_bytes(HEADS[head])
    os.truncate(path, 10**11)
    with pytest.raises(dtm.RecordingError, match="has more than 1000000000 bytes"):
        reader(path)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="Windows has no such pipes")
@pytest.mark.parametrize(
    ("reader", "head"),
    [(dtm.read_recording, "text"), (dtm.Recording.load, "text"), (dtm.open_log, "DataFlash")],
)
def test_a_pipe_without_end_is_refused_at_the_limit(tmp_path, monkeypatch, reader, head):
    """It was read until memory was gone."""
    monkeypatch.setattr(_first_bytes, "LARGEST_FILE", 3_000_000, raising=False)
    path = tmp_path / "pipe"
    os.mkfifo(path)

    def write():
        with path.open("wb", buffering=0) as pipe:
            pipe.write(HEADS[head])
            try:
                for _ in range(1000):  # 8 MB: the test ends also where all of it is read
                    pipe.write(b"0,0,0\n" * 1400)
            except BrokenPipeError:
                pass

    writer = threading.Thread(target=write)
    writer.start()
    with pytest.raises(dtm.RecordingError, match="has more than 3000000 bytes, or never ends"):
        reader(path)
    writer.join()


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="only Linux has it")
@pytest.mark.parametrize("device", ["/dev/full", "/dev/zero"])
@pytest.mark.parametrize("reader", READERS[:2])
def test_a_device_of_zeros_is_refused(device, reader):
    with pytest.raises(dtm.RecordingError, match=r"is not a log|is neither a text file"):
        reader(device)


def test_nothing_unpacks_to_more_than_the_largest_file():
    assert largest(10**9) == _first_bytes.LARGEST_FILE


def test_a_file_that_grows_while_it_is_read_is_refused_at_the_limit(tmp_path, monkeypatch):
    monkeypatch.setattr(_first_bytes, "LARGEST_FILE", 5_000)
    path = tmp_path / "table.csv"
    path.write_bytes(b"time,reference\n")
    with _first_bytes.opened(path) as stream, path.open("ab") as other:
        other.write(b"0,0\n" * 2_000)
        other.flush()
        with pytest.raises(dtm.RecordingError, match="has more than 5000 bytes"):
            _first_bytes.whole(stream, b"")
