"""``deadtime design``: gains for a loop, with margins, for a delay known to an interval."""

from __future__ import annotations

from typing import Annotated, Literal

import typer

from deadtime._base.validation import finite
from deadtime._cli import options as opt
from deadtime._cli.show import print_json, print_text, save_figure, stages
from deadtime.loops import PD, PI, PID, PV, Controller, DerivativeFilter, P
from deadtime.tuning import Design, design as find_design

Objective = Literal[
    "load",
    "load_ie",
    "set_point",
    "set_point_settling",
    "abscissa",
    "damping",
    "settling_time",
    "overshoot",
]
Kind = Literal["P", "PV", "PD", "PI", "PID"]

CONTROLLERS: dict[str, type[Controller]] = {"P": P, "PV": PV, "PD": PD, "PI": PI, "PID": PID}


def command(
    delay: opt.Delay = None,
    delay_to: Annotated[
        float | None,
        typer.Option(
            help=(
                "Upper end of the interval of the delay, s. The interval begins at --delay. "
                "Default: the delay is exact."
            )
        ),
    ] = None,
    controller: Annotated[Kind, typer.Option(help="Kind of controller.")] = "PV",
    kp: Annotated[opt.Ends | None, typer.Option(help="Range of the proportional gain.")] = None,
    kv: Annotated[opt.Ends | None, typer.Option(help="Range of the velocity gain.")] = None,
    ki: Annotated[opt.Ends | None, typer.Option(help="Range of the integral gain.")] = None,
    kd: Annotated[opt.Ends | None, typer.Option(help="Range of the derivative gain.")] = None,
    fix: Annotated[
        list[str] | None,
        typer.Option(
            help=(
                "Keep one gain at this value, such as Kp=2. For several gains, repeat the option."
            )
        ),
    ] = None,
    plant: opt.Plant = None,
    gain: opt.Gain = 1.0,
    gain_to: Annotated[
        float | None,
        typer.Option(
            help=(
                "Upper end of the interval of the plant's gain. The interval begins at --gain. "
                "Default: the gain is exact."
            )
        ),
    ] = None,
    lag: opt.Lag = 0.0,
    sample_time: opt.Sample_time = None,
    limit: opt.Limit = None,
    filter: opt.Filter = None,  # noqa: A002
    choose_filter: Annotated[
        bool,
        typer.Option(
            "--choose-filter", help=("Also choose the corner frequency of the derivative's filter.")
        ),
    ] = False,
    objective: Annotated[
        Objective | None,
        typer.Option(
            help=(
                "Quantity that the design makes best. Default: load; with --choose-filter, "
                "abscissa."
            )
        ),
    ] = None,
    max_sensitivity: Annotated[
        float | None,
        typer.Option(
            help="Largest allowed Ms, the peak of the sensitivity function, for loads and set "
            "points. Default: 1.6."
        ),
    ] = None,
    noise_gain: Annotated[
        float | None,
        typer.Option(
            help="Largest allowed ratio of the command's noise to the measurement's noise."
        ),
    ] = None,
    settling_time: Annotated[
        float | None, typer.Option(help="Longest allowed settling time of a step, s.")
    ] = None,
    gain_margin: Annotated[
        float | None, typer.Option(help=("Smallest allowed gain margin, as a factor."))
    ] = None,
    phase_margin: Annotated[
        float | None, typer.Option(help="Smallest allowed phase margin, °.")
    ] = None,
    delay_margin: Annotated[
        float | None, typer.Option(help="Smallest allowed delay margin, s.")
    ] = None,
    amplitude: Annotated[float, typer.Option(help="Size of the step.")] = 1.0,
    plot: opt.Plot = None,
    as_json: opt.As_json = False,
) -> None:
    """Find the gains that are best in the worst case, with the margins you require."""
    if choose_filter and filter is not None:
        raise ValueError(
            "--filter gives the corner frequency of the filter, but --choose-filter lets the "
            "design choose this frequency: give only one of the two options"
        )
    delay = opt.delay_beside(plant, delay)
    # The gains are varied: any that are not zero will do.
    loop = opt.described_loop(
        1.0, 0.1, delay, gain, lag, sample_time=sample_time, limit=limit, corner=filter, plant=plant
    )
    low = loop.specification.known_delay
    in_plant = low - delay
    high = low if delay_to is None else delay_to + in_plant
    opt.check_duration(loop.replace(delay=high))
    given = {"Kp": kp, "Kv": kv, "Ki": ki, "Kd": kd}
    ranges = {name: ends for name, ends in given.items() if ends is not None}
    smooth: DerivativeFilter | Literal["auto"] | None = None
    if choose_filter or filter is not None:
        smooth = "auto" if filter is None else DerivativeFilter(filter)
    with stages(1, quiet=as_json) as begin:
        begin("mapping and searching")
        found = find_design(
            loop,
            controller=CONTROLLERS[controller],
            delay=low if delay_to is None else (low, high),
            gain=None if gain_to is None else (gain, gain_to),
            objective=objective or ("abscissa" if choose_filter else "load"),
            fixed=dict(map(_gain, fix)) if fix else None,
            max_sensitivity=max_sensitivity,
            noise_gain=noise_gain,
            settling_time=settling_time,
            gain_margin=gain_margin,
            phase_margin=phase_margin,
            delay_margin=delay_margin,
            filter=smooth,
            ranges=ranges or None,
            amplitude=amplitude,
        )
    if plot is not None:
        choice = found.filter_choice
        save_figure(found.plot() if choice is None else choice.plot(), plot)
    if as_json:
        print_json("design", _as_dict(found))
        return
    print_text(found.summary(), wrapped=False)


def _gain(text: str) -> tuple[str, float]:
    """A name and a number from ``Kp=2``."""
    name, equals, number = text.partition("=")
    try:
        value = float(number)
    except ValueError:
        equals = ""
    if not equals:
        raise ValueError(f"--fix {text}: give the name and the value of a gain, such as --fix Kp=2")
    return name.strip(), finite(name.strip(), value)


def _as_dict(found: Design) -> dict[str, object]:
    choice = found.filter_choice
    return {
        "gains": found.gains,
        "abscissa": found.abscissa,
        "damping": found.damping,
        "delays": found.delays,
        "objective": found.objective,
        "value": found.value,
        "margins": found.margins._asdict(),
        "worst": found.worst,
        "checked": found.checked,
        "proved": found.proved,
        "step": found.step_info,
        "noise_gain": found.noise_gain,
        "traded": {trade.requirement: trade.words for trade in found.traded},
        "filter": None if choice is None else choice.omega,
    }
