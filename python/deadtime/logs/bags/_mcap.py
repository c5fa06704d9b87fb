"""Read MCAP files with the libraries `mcap` and `mcap-ros2-support`.

The file is streamed chunk by chunk, so one that was cut off is read as far as it goes, and a long
one does not have to fit into memory. Messages in CDR of ROS 2 and in JSON are decoded.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterable, Iterator
from contextlib import redirect_stderr
from dataclasses import replace
from io import StringIO
from pathlib import Path
from typing import Any

from deadtime._base.errors import MissingExtraError
from deadtime._base.extras import library
from deadtime.logs.bags._bag import Bag, Message, bag_of
from deadtime.logs.bags._bounded import Bounded
from deadtime.logs.bags._index import Index

EXTRA = "'deadtime[logs]'"

#: Most bytes of an unpacked chunk, in all and times the size of the file: writers make chunks of
#: 1 to 10 MB, and a damaged size could ask for any memory.
CHUNK, CHUNK_FACTOR = 32 << 20, 4

#: Largest window of zstd, bytes: that of its strongest usual level.
WINDOW = 8 << 20


class _Mcap:
    """A file, read from its start each time."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.types: dict[str, str] = {}
        self.cut = False
        self.lost = 0

    def messages(self, wanted: Iterable[str] | None = None) -> Iterator[Message]:
        """The messages of these topics, or all."""
        names = None if wanted is None else set(wanted)
        decoders = library("mcap_ros2.decoder", "reading MCAP files of ROS 2", EXTRA)
        kinds = library("mcap.records", "reading MCAP files", EXTRA)
        factory = decoders.DecoderFactory()
        schemas: dict[int, Any] = {}
        channels: dict[int, Any] = {}
        for record in self._all_records():
            if isinstance(record, kinds.Schema):
                schemas.setdefault(record.id, record)
            elif isinstance(record, kinds.Channel):
                channels.setdefault(record.id, record)
            elif isinstance(record, kinds.Message) and record.channel_id in channels:
                channel = channels[record.channel_id]
                if names is None or channel.topic in names:
                    schema = schemas.get(channel.schema_id)
                    kind = schema.name if schema is not None else channel.message_encoding
                    self.types.setdefault(channel.topic, kind)
                    decode = _decoder(factory, channel, schema, record.data)
                    yield channel.topic, record.log_time, decode

    def _all_records(self) -> Iterator[Any]:
        """All records up to the end or the first damage outside of a chunk."""
        streams = library("mcap.stream_reader", "reading MCAP files", EXTRA)
        kinds = library("mcap.records", "reading MCAP files", EXTRA)
        self.cut, self.lost = False, 0
        with Bounded(self.path) as source:
            found = streams.StreamReader(
                source, emit_chunks=True, record_size_limit=source.size
            ).records
            while True:
                try:
                    record = next(found)
                except StopIteration:
                    return
                except Exception:  # the library raises what the damage leads to
                    self.cut = True
                    return
                if not isinstance(record, kinds.Chunk):
                    yield record
                    continue
                try:
                    parts = streams.breakup_chunk(_unpacked(record, source.size))
                except MissingExtraError:
                    raise
                except Exception:  # the libraries of each compression have their own errors
                    self.lost += 1
                    continue
                yield from parts


def _unpacked(chunk: Any, size: int) -> Any:
    """A chunk without compression, or an error where it would take more memory than it may."""
    most = CHUNK + CHUNK_FACTOR * size
    if chunk.uncompressed_size > most:
        raise ValueError(f"a chunk of {chunk.uncompressed_size} bytes")
    if chunk.compression == "zstd":
        zstd = library("zstandard", "reading MCAP files packed by zstd", "zstandard")
        unpack = zstd.ZstdDecompressor(max_window_size=WINDOW).stream_reader(chunk.data)
        data = unpack.read(chunk.uncompressed_size)
    elif chunk.compression == "lz4":
        lz4 = library("lz4.frame", "reading MCAP files packed by lz4", "lz4")
        data = lz4.LZ4FrameDecompressor().decompress(chunk.data, chunk.uncompressed_size)
    elif chunk.compression:
        raise ValueError(f"an unknown compression, {chunk.compression}")
    else:
        return chunk
    return replace(chunk, compression="", data=data)


def _decoder(factory: Any, channel: Any, schema: Any, data: bytes) -> Callable[[], Any]:
    def decode() -> Any:
        if channel.message_encoding == "json":
            return json.loads(data)
        with redirect_stderr(StringIO()):  # the library prints what it finds damaged
            make = factory.decoder_for(channel.message_encoding, schema)
        if make is None:
            raise ValueError(f"the encoding {channel.message_encoding} is not known")
        return make(data)

    return decode


def read_mcap(path: str | os.PathLike[str]) -> Bag:
    """The topics of an MCAP file."""
    file = _Mcap(Path(path))
    index = Index()
    index.fill(file.messages(), lambda topic: file.types[topic])
    remarks = index.remarks()
    if file.cut:
        remarks.append("the file is cut off or damaged, so it is read only up to this place")
    if file.lost:
        remarks.append(f"{file.lost} damaged chunks are left out")
    ends = index.ends or (0, 0)
    return bag_of(file.path.name, "MCAP", index.topics(), ends, file.messages, remarks)
