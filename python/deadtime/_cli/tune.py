"""``deadtime tune``: gains from a recording or a log, in the form of the controller."""

from __future__ import annotations

import inspect
import shlex
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from deadtime._base.page import check_pages
from deadtime._cli import options as opt
from deadtime._cli.columns import COLUMNS
from deadtime._cli.design import CONTROLLERS, Kind, Objective
from deadtime._cli.exit_codes import NONE
from deadtime._cli.fills import Given, filled
from deadtime._cli.show import print_json, print_text, save_figure, stages
from deadtime._cli.windows import files_and_windows
from deadtime.logs import open_log, tune_loop
from deadtime.loops import PV, Controller
from deadtime.recordings import is_table, read_recording
from deadtime.tuning import (
    LOOPS_OF_FORMS,
    Form,
    ParallelForm,
    Proposal,
    one_pole_filter,
    tune,
)


@filled
def command(
    *,
    file: Annotated[
        Path,
        typer.Argument(
            help="A table with a bump test or a closed-loop recording, as FILE or FILE@LOW:HIGH. "
            "Or the log of a vehicle.",
            show_default=False,
        ),
    ],
    controller: Kind | None = None,
    form: Form | None = None,
    loop: str | None = None,
    firmware: str = "",
    kp: float | None = None,
    ki: float | None = None,
    kd: float | None = None,
    spans: opt.Ends | None = None,
    filter_hz: float | None = None,
    weight: float | None = None,
    columns: Annotated[Given, COLUMNS],
    window: opt.Window = None,
    sample_time: opt.Sample_time = None,
    limit: opt.Limit = None,
    plant: str | None = None,
    objective: Objective | None = None,
    max_sensitivity: float | None = None,
    gain_margin: float | None = None,
    phase_margin: float | None = None,
    delay_margin: float | None = None,
    allow_indication: bool = False,
    flight: opt.Flight = None,
    plot: opt.Plot = None,
    out: Path | None = None,
    as_json: opt.As_json = False,
) -> None:
    """Propose gains from a recording, in your controller's units, with predicted responses.

    Exit codes: 0 for gains; 3 for no gains, with the reason; 1 for an error.

    Parameters
    ----------
    controller
        Kind of controller. Default: PI for a table, the kind that was flown for a log.
    form
        Form and units in which your controller takes gains. Default: parallel for a table, the form
        of the firmware for a log.
    loop
        Loop of a vehicle, such as 'altitude' or 'roll rate'. Default: the first loop that the log
        determines.
    firmware
        Version of the firmware. Needed only for a table.
    kp
        Proportional gain that was in use. New gains differ from the gains in use by at most a
        factor of two.
    ki
        Integral gain that was in use.
    kd
        Derivative gain that was in use.
    spans
        Spans of the measurement and of the controller's output. With spans, the proportional band
        is given too.
    filter_hz
        Corner frequency of the derivative's filter, which has one pole, Hz.
    weight
        Weight of the set point in the proportional term. If your controller has no weight, give 1.
        Default: the weight with which a step settles first.
    plant
        Kind of plant, if it is known, such as 'two lags'.
    objective
        Quantity that the design makes best. Default: load, the response to a load.
    max_sensitivity
        Largest allowed Ms, the peak of the sensitivity function. Default: 1.6.
    gain_margin
        Smallest allowed gain margin, as a factor.
    phase_margin
        Smallest allowed phase margin, °.
    delay_margin
        Smallest allowed delay margin, s.
    allow_indication
        Propose gains even if the estimate is only an indication.
    out
        Write a page to this file, with the gains and the predicted responses.
    """
    if out is not None:
        check_pages()
    (path,), (part,) = files_and_windows([file], window)
    asked = {
        "objective": objective,
        "max_sensitivity": max_sensitivity,
        "gain_margin": gain_margin,
        "phase_margin": phase_margin,
        "delay_margin": delay_margin,
    }
    demands: dict[str, Any] = {name: value for name, value in asked.items() if value is not None}
    template = _template(controller, filter_hz, weight)
    is_log = path.is_file() and not is_table(path)
    with stages(1, quiet=as_json) as begin:
        begin("estimating and designing")
        if is_log:
            own = {"window": part, "plant": plant, "firmware": firmware, "spans": spans}
            gains = {"kp": kp, "ki": ki, "kd": kd}
            _refuse({**columns, **own, **gains, "sample-time": sample_time, "limit": limit})
            found = tune_loop(
                open_log(path, flight=flight),
                loop,
                controller=template,
                form=form,
                allow_indication=allow_indication,
                **demands,
            )
        else:
            if flight is not None:
                raise ValueError(
                    "--flight selects a flight in the log of a vehicle, but a table has no "
                    "flights: leave --flight out"
                )
            _check_form(form or "parallel", loop, firmware)
            columns["command"] = columns["command"] or "auto"
            found = tune(
                read_recording(path, **columns),
                controller=template or CONTROLLERS["PI"],
                form=form or "parallel",
                loop=loop or "",
                version=firmware,
                spans=spans,
                flown=_flown(controller, kp, ki, kd),
                sample_time=sample_time,
                limit=limit,
                allow_indication=allow_indication,
                window=part,
                known={"plant": plant},
                **demands,
            )
    _show(found, path, plot, out, as_json)


def _template(
    kind: Kind | None, corner: float | None, weight: float | None
) -> type[Controller] | Controller | None:
    """The kind of controller that is asked for, with its filter and weight; None where none is."""
    if corner is not None and kind not in ("PV", "PD", "PID"):
        raise ValueError(
            "--filter-hz belongs to a derivative, which this controller does not have: give "
            "--controller PV, PD or PID"
        )
    if weight is not None and kind not in (None, "PI", "PID"):
        raise ValueError(
            "--weight is the weight of the set point, which this controller does not have: give "
            "--controller PI or PID"
        )
    if corner is None and weight is None:
        return None if kind is None else CONTROLLERS[kind]
    found: Any = CONTROLLERS[kind or "PI"]
    names = inspect.signature(found).parameters
    parts: dict[str, Any] = {name: 1.0 for name in names if name.startswith("K")}
    if corner is not None:
        parts["filter"] = one_pole_filter(corner)
    if weight is not None:
        parts["weight"] = weight
    made: Controller = found(**parts)
    return made


def _check_form(form: Form, loop: str | None, firmware: str) -> None:
    """Refuse a loop of a vehicle without a form for it, and the reverse."""
    loops = LOOPS_OF_FORMS.get(form)
    if loops is None and (loop or firmware):
        option = "--loop" if loop else "--firmware"
        raise ValueError(
            f"{option} applies only to a form for a vehicle, and --form {form} is none: leave "
            f"{option} out, or give --form {', '.join(LOOPS_OF_FORMS)}"
        )
    if loops is not None and loop not in loops:
        raise ValueError(
            f"--loop {loop or 'is missing'}: give one of the loops of {form}, which are "
            f"{', '.join(loops)}"
        )


def _flown(
    kind: Kind | None, kp: float | None, ki: float | None, kd: float | None
) -> Controller | None:
    """The controller that was in use, by its gains."""
    if kp is None:
        if ki is not None or kd is not None:
            raise ValueError(
                "--ki and --kd are gains that were used together with --kp: give --kp too"
            )
        return None
    ki, kd = ki or 0.0, kd or 0.0
    return PV(kp, kd) if kind == "PV" else ParallelForm(kp, ki, kd).controller()


def _refuse(given: Given) -> None:
    """Refuse what a log says itself."""
    for name, value in given.items():
        if value not in (None, "", False):
            raise ValueError(
                f"--{name} applies only to tables, but the log of a vehicle is given: leave "
                f"--{name} out"
            )


def _show(found: Proposal, path: Path, plot: Path | None, out: Path | None, as_json: bool) -> None:
    following = _next(found, path)
    made = found.settings is not None
    if made and plot is not None:
        save_figure(found.figure(), plot)
    written = found.report(out) if made and out is not None else None
    if as_json:
        print_json("tune", found.to_dict() | {"next": following})
    else:
        style: Literal["bold", "yellow"] = "bold" if found.verdict == "reliable" else "yellow"
        print_text(found.headline(), style)
        print_text("\n".join(f"  {line}" for line in found.lines()), wrapped=False)
        if written is not None:
            print_text(f"report: {written}", wrapped=False)
        if following:
            print_text(f"next: {following}", wrapped=False)
    if not made:
        raise typer.Exit(NONE)


def _next(found: Proposal, path: Path) -> str:
    """The command for the recording that the gains are tried in."""
    if found.settings is None:
        return ""
    if found.settings.loop:
        words = ["deadtime", "tune", f"next{path.suffix}", "--loop", found.settings.loop]
    else:
        words = ["deadtime", "tune", f"next{path.suffix}", "--form", found.settings.form]
        for name, gain in found.controller.gains.items():
            option = "kd" if name == "Kv" else name.lower()
            words += [f"--{option}", f"{gain:.6g}"]
    return (
        "Try these gains, record a step of the set point, and check the recording: "
        f"{shlex.join(words)}"
    )
