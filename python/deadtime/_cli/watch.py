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
from deadtime._cli.show import print_json, print_text
from deadtime._cli.watch_page import WatchPage
from deadtime._cli.watched import Columns, Row, Sent, growing, heard, recorded
from deadtime.estimation import DelayTrack, OnlineEstimate, OnlineEstimator
from deadtime.links.mavlink.addresses import LinkAddress


def command(
    source: Annotated[
        str,
        typer.Argument(
            help="A table as of `estimate`; with --follow a CSV that grows; or udp:HOST:PORT, "
            "where a MAVLink link is listened to. Nothing is ever sent.",
            show_default=False,
        ),
    ],
    time: opt.Time = "time",
    output: opt.Output = "output",
    command: Annotated[str, typer.Option(help="Column of the command.")] = "command",
    plant: opt.Plant = None,
    gain: opt.Gain = 1.0,
    lag: opt.Lag = 0.0,
    lags: Annotated[
        opt.Ends | None,
        typer.Option(help="The lag is between these, s. Without: it is --lag.", show_default=False),
    ] = None,
    delays: Annotated[opt.Ends, typer.Option(help="The delay is between these, s.")] = (0.0, 0.6),
    noise: Annotated[
        float | None,
        typer.Option(
            help="Deviation of the sensor's white noise. Without: noise and air are learned from "
            "the first seconds.",
            show_default=False,
        ),
    ] = None,
    drift: Annotated[
        float, typer.Option(help="What the delay gains by drifting in a second, s.")
    ] = 0.001,
    false_alarms: Annotated[
        float, typer.Option(help="Changes reported where there is none, an hour at most.")
    ] = 1.0,
    follow: Annotated[
        bool, typer.Option("--follow", help="The file grows: wait for further lines.")
    ] = False,
    axis: Annotated[Literal["x", "y", "z"], typer.Option(help="Of a link.")] = "z",
    silence: Annotated[
        float, typer.Option(help="End after so many seconds without a line or message.")
    ] = math.inf,
    every: Annotated[float, typer.Option(help="Time between lines that are printed, s.")] = 1.0,
    page: Annotated[
        bool, typer.Option("--page", help="Serve a live page as well, to this computer alone.")
    ] = False,
    as_json: opt.As_json = False,
) -> None:
    """Follow the delay of a loop row by row, with its interval, while the loop runs."""
    if page:
        check_pages()
    loop = opt.described_loop(1.0, gain=gain, lag=lag or (0.1 if lags else 0.0), plant=plant)
    estimator = OnlineEstimator(
        loop,
        delays=delays,
        lags=lags,
        noise=noise,
        drift=drift,
        false_alarms_per_hour=false_alarms,
    )
    shown = WatchPage(source) if page else None
    if shown is not None and not as_json:
        print_text(f"page: {shown.address}")
    found: list[OnlineEstimate] = []
    events = _events(source, Columns(time, output, command), follow, axis, silence)
    rows = 0
    try:
        for estimate in _estimates(estimator, events):
            rows += 1
            if shown is not None:
                shown.show(estimate)
            if not found or _is_told(estimate, found[-1], every):
                found.append(estimate)
                if not as_json:
                    print_text(_said(estimate))
    except KeyboardInterrupt:
        if not found:
            raise
    finally:
        if shown is not None:
            shown.close()
    if not found:
        raise RecordingError(f"{source}: no row has come")
    track = DelayTrack.of(found)
    if as_json:
        print_json("watch", {"source": source, **track.to_dict()})
    else:
        print_text(f"{rows} rows; of those that are printed above:")
        print_text(track.summary())


def _events(
    source: str, columns: Columns, follow: bool, axis: str, silence: float
) -> Iterator[Row | Sent]:
    if source.startswith(("udp:", "udpout:", "tcp:")):
        return heard(LinkAddress.of(source), axis, silence)
    if follow:
        return growing(Path(source), columns, silence)
    return recorded(Path(source), columns)


def _estimates(
    estimator: OnlineEstimator, events: Iterator[Row | Sent]
) -> Iterator[OnlineEstimate]:
    for event in events:
        if isinstance(event, Sent):
            estimator.command(*event)
        else:
            yield estimator.update(*event)


def _is_told(now: OnlineEstimate, last: OnlineEstimate, every: float) -> bool:
    """Whether a line is due: by time, or because of news."""
    is_news = now.changed or now.adequate != last.adequate or now.known != last.known
    return is_news or now.time - last.time >= every


def _said(estimate: OnlineEstimate) -> str:
    text = str(estimate) if estimate.known else f"{estimate.time:.2f} s: {estimate.message}"
    return f"{text}; the delay has changed" if estimate.changed else text
