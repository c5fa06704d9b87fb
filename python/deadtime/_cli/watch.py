"""``deadtime watch``: the delay of a loop while it runs."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Literal

import typer

from deadtime._base.errors import RecordingError
from deadtime._base.page import check_pages
from deadtime._cli import options as opt
from deadtime._cli.fills import Fills, Given, filled
from deadtime._cli.interruption import sigterm_as_ctrl_c
from deadtime._cli.show import print_json, print_text
from deadtime._cli.watch_page import WatchPage
from deadtime.estimation import DelayTrack, OnlineEstimate, OnlineEstimator
from deadtime.links.mavlink import LinkAddress, heard_rows, read_key
from deadtime.recordings import Row, Sent, growing_rows, read_recording


@filled
def command(
    *,
    source: Annotated[str, typer.Argument(show_default=False)],
    time: Annotated[str, typer.Option(help="Column of the time stamps, s.")] = "time",
    output: Annotated[str, typer.Option(help="Column of the measured output.")] = "output",
    command: str = "command",
    numbers: Annotated[Given, Fills(opt.described_loop, "plant gain lag")],
    lags: opt.Ends | None = None,
    delays: Annotated[Given, Fills(OnlineEstimator, "delays", delays=opt.Ends)],
    noise: float | None = None,
    followed: Annotated[
        Given, Fills(OnlineEstimator, "drift false_alarms_per_hour=--false-alarms")
    ],
    follow: bool = False,
    axis: Literal["x", "y", "z"] = "z",
    key: Path | None = None,
    system: Annotated[int | None, typer.Option(min=1, max=255)] = None,
    silence: float = math.inf,
    every: float = 1.0,
    page: bool = False,
    as_json: opt.As_json = False,
) -> None:
    """Follow the delay of a running loop: print delay and interval for each row.

    Parameters
    ----------
    source
        A table, as for `estimate`. With --follow, a CSV file that grows. Or udp:HOST:PORT, where
        the program listens to a MAVLink link and never sends.
    command
        Column of the command.
    lags
        Smallest and largest possible lag, s. Default: the lag is --lag.
    noise
        Standard deviation of the sensor's white noise. Default: noise and wind are estimated from
        the first seconds.
    follow
        Wait for further lines of a file that grows.
    axis
        Axis of the vehicle on a link.
    key
        File with the key that signs the messages of the link, as 32 bytes or 64 hexadecimal digits.
        Messages that are not signed are then ignored.
    system
        MAVLink system number of the vehicle on a link. Default: the system of the first autopilot
        that sends a heartbeat. Messages of other systems are ignored.
    silence
        End after this time without a new line or message, s.
    every
        Time between printed lines, s.
    page
        Also show a live page, in browsers of this computer only.
    """
    if page:
        check_pages()
    if lags:
        numbers["lag"] = numbers["lag"] or 0.1
    loop = opt.described_loop(1.0, **numbers)
    estimator = OnlineEstimator(loop, lags=lags, noise=noise, **delays, **followed)
    shown = WatchPage(source) if page else None
    if shown is not None and not as_json:
        print_text(f"page: {shown.address}")
    found: list[OnlineEstimate] = []
    events = _events(source, (time, output, command), follow, axis, silence, key, system)
    rows = 0
    try:
        with sigterm_as_ctrl_c():
            for estimate in _estimates(estimator, events):
                rows += 1
                if shown is not None:
                    shown.show(estimate)
                if not found or _line_is_due(estimate, found[-1], every):
                    found.append(estimate)
                    if not as_json:
                        print_text(_said(estimate))
    except KeyboardInterrupt:
        if not found:
            raise
    finally:
        if shown is not None:
            shown.close()
        if found:  # an error loses no row that was printed
            _print_summary(source, found, rows, as_json)
    if not found:
        raise RecordingError(f"no row has arrived from {source}")


def _print_summary(source: str, found: list[OnlineEstimate], rows: int, as_json: bool) -> None:
    track = DelayTrack.of(found)
    if as_json:
        print_json("watch", {"source": source, **track.to_dict()})
    else:
        print_text(f"Summary of the {rows} rows that are printed above:")
        print_text(track.summary())


def _events(
    source: str,
    columns: tuple[str, str, str],
    follow: bool,
    axis: str,
    silence: float,
    key: Path | None,
    system: int | None,
) -> Iterator[Row | Sent]:
    if source.startswith(("udp:", "udpout:", "tcp:")):
        secret = None if key is None else read_key(key)
        return heard_rows(LinkAddress.of(source), axis, silence, secret, system)
    if key is not None:
        raise ValueError(
            f"--key is the key that signs messages of a link, but {source} is a file: leave "
            "--key out"
        )
    if system is not None:
        raise ValueError(
            f"--system selects a vehicle on a link, but {source} is a file: leave --system out"
        )
    if follow:
        return growing_rows(Path(source), columns, silence)
    return recorded_rows(Path(source), columns)


def recorded_rows(file: Path, columns: tuple[str, str, str]) -> Iterator[Row]:
    """The rows of a table that is complete."""
    time, output, command = columns
    found = read_recording(file, time=time, output=output, command=command)
    assert found.command is not None
    values = (found.time, found.output, found.command)
    rows = zip(*(column.tolist() for column in values), strict=True)
    return (Row(now, None if math.isnan(y) else y, u) for now, y, u in rows)


def _estimates(
    estimator: OnlineEstimator, events: Iterator[Row | Sent]
) -> Iterator[OnlineEstimate]:
    for event in events:
        if isinstance(event, Sent):
            estimator.command(*event)
        else:
            yield estimator.update(*event)


def _line_is_due(now: OnlineEstimate, last: OnlineEstimate, every: float) -> bool:
    """Whether a line is due: by time, or because of news."""
    is_news = now.changed or now.verdict != last.verdict or now.known != last.known
    return is_news or now.time - last.time >= every


def _said(estimate: OnlineEstimate) -> str:
    return f"{estimate}. The delay has changed" if estimate.changed else str(estimate)
