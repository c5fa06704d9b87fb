"""A serial port of this computer, such as a telemetry radio or a USB cable."""

from __future__ import annotations

import asyncio
import os
from collections.abc import Callable

from deadtime._base.errors import LinkError, MissingExtraError

#: Most bytes that are read at once.
READ = 4096


class SerialPort:
    """Bytes to and from a serial port, in the event loop.

    What does not fit into the buffer of the port is lost, as a datagram is, so that no set point
    waits behind many old ones.

    Parameters
    ----------
    device : str
    baud : int
        Bits a second.
    receive : callable
        Called with what comes.

    Raises
    ------
    LinkError
        If it cannot be opened, or the event loop cannot wait for it, as on Windows.
    MissingExtraError
        If pyserial is not installed.
    """

    def __init__(self, device: str, baud: int, receive: Callable[[bytes], None]) -> None:
        try:
            import serial  # type: ignore[import-untyped, unused-ignore]
        except ImportError as error:
            raise MissingExtraError(
                "a serial port needs pyserial, which is not installed. This command installs "
                "it: pip install 'deadtime[mavlink]'"
            ) from error
        self._receive, self._loop = receive, asyncio.get_running_loop()
        try:
            self._port = serial.Serial(device, baud, timeout=0, exclusive=True)
        except (OSError, ValueError) as error:
            raise LinkError(f"{device} at {baud} baud cannot be opened: {error}") from None
        try:
            self._file: int | None = self._port.fileno()
            self._loop.add_reader(self._file, self._read)
        except (AttributeError, NotImplementedError, OSError) as error:
            self._port.close()
            raise LinkError(
                f"{device}: in this operating system, the program cannot wait for a serial "
                "port. Let a router forward the port to UDP"
            ) from error

    def _read(self) -> None:
        assert self._file is not None
        try:
            data = os.read(self._file, READ)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        if data:
            self._receive(data)
        else:  # unplugged; the following silence is detected
            self.close()

    def send(self, data: bytes) -> None:
        """Send what fits at once."""
        if self._file is None:
            return
        try:
            os.write(self._file, data)
        except BlockingIOError:
            pass
        except OSError:
            self.close()

    def close(self) -> None:
        """Close it."""
        if self._file is not None:
            self._loop.remove_reader(self._file)
            self._file = None
            self._port.close()
