"""The unwritten end of a ULog file is cut off before it is searched for messages."""

from __future__ import annotations

import pytest
from deadtime.logs import _ulog


@pytest.mark.parametrize("byte", [b"\0", b"\xff"])
def test_the_library_gets_no_long_tail_of_bytes_that_nobody_has_written(monkeypatch, byte):
    """Each megabyte of it cost 1.4 s of zeros, and 4 s of 255."""
    pyulog = pytest.importorskip("pyulog.core")
    sizes = []

    def read(stream):
        sizes.append(len(stream.getbuffer()))
        raise pyulog.ULogException

    monkeypatch.setattr(pyulog, "ULog", read)
    content = b"ULog\x01\x12\x35\x01" + bytes(8) + b"A message" * 1000
    for tail in (0, 1000, 3_000_000):
        with pytest.raises(_ulog.RecordingError):
            _ulog.read_ulog(content + byte * tail, "flight.ulg")
    assert sizes == [len(content), len(content) + 1000, len(content) + _ulog.TAIL]
    assert _ulog.TAIL > 65535 + 3  # the longest message
