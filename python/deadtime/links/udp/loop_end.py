"""What plant and controller share: an endpoint, and a recording of the run."""

from __future__ import annotations

import asyncio
from collections import deque
from contextlib import ExitStack
from pathlib import Path

from deadtime.links.addresses import Address
from deadtime.links.journal import Journal
from deadtime.links.udp.endpoint import Endpoint
from deadtime.links.udp.statistics import KEPT
from deadtime.recordings import MINIMUM_SAMPLES, Recording


class LoopEnd:
    """One end of the loop, with the rows of its recording: time, reference, output, command, ...

    Parameters
    ----------
    endpoint : Endpoint
        Its socket.
    name : str
        The source of its recording.
    """

    def __init__(self, endpoint: Endpoint, name: str) -> None:
        self._endpoint, self._name = endpoint, name
        self._journal: Journal | None = None
        self._rows: deque[tuple[float, ...]] = deque(maxlen=KEPT)

    async def _open(self, listen: Address, path: Path | None, columns: tuple[str, ...]) -> None:
        """Open the socket, and the file of the recording if there is one."""
        self._loop = asyncio.get_running_loop()
        await self._endpoint.open(listen)
        with ExitStack() as stack:
            stack.callback(self._endpoint.close)
            if path is not None:
                self._journal = stack.enter_context(Journal(path, columns))
            self._stack = stack.pop_all()

    @property
    def address(self) -> Address:
        """The address of this end."""
        return self._endpoint.address

    def _recording(self) -> Recording | None:
        """The recording until now; None if it is too short."""
        if len(self._rows) < MINIMUM_SAMPLES:
            return None
        time, reference, output, command, *_ = zip(*self._rows, strict=True)
        return Recording(time, reference, output, command, source=self._name)
