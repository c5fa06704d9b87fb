"""`tune_loop`: gains for a loop of a vehicle, from its log, in the parameters of its firmware."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from deadtime._base.errors import NotIdentifiableError
from deadtime.logs._log import Log, LogLoop
from deadtime.loops import PI, Controller
from deadtime.tuning import LOOPS_OF_FORMS, Form, Proposal, controller_of, tune

#: The form of the parameters of each autopilot.
FORMS: Mapping[str, Form] = {
    "ArduPilot": "ardupilot",
    "PX4": "px4",
    "Betaflight": "betaflight",
}

#: The unit of what a controller of each kind commands; empty where it has none.
UNITS = {"rate": "", "attitude": "rad/s", "velocity": "m/s²", "position": "m/s"}

#: In what order loops are tried: the slow ones have the fewest gains and the clearest moves.
ORDER = ("position", "velocity", "attitude", "rate")


def tune_loop(
    log: Log,
    loop: str | None = None,
    *,
    controller: type[Controller] | Controller | None = None,
    form: Form | None = None,
    allow_indication: bool = False,
    **demands: Any,
) -> Proposal:
    """Propose gains for a loop of a vehicle, in the parameters of its firmware.

    The plant is what lies between the command of the loop's controller and its response. The log's
    parameters hold the gains that were flown; the new ones differ by at most a factor of two.

    Parameters
    ----------
    log : Log
        Of ArduPilot, PX4 or Betaflight.
    loop : str, optional
        Name of the loop, such as ``"altitude"``; by default the first whose plant the log
        determines, from the outermost inwards.
    controller : Controller or class of one, optional
        By default the kind that was flown, with the filter of its derivative.
    form : str, optional
        How the gains are typed; by default as the log's autopilot has them. See
        `deadtime.tuning.settings_of`.
    allow_indication : bool
        Propose gains for an estimate that is an indication, too.
    **demands
        See `deadtime.design`.

    Returns
    -------
    deadtime.tuning.Proposal

    Raises
    ------
    NotIdentifiableError
        If no loop of the log can be tuned; the message says why for each.
    ValueError
        If the log has no such loop, or its command is not that of the loop's gains.

    Examples
    --------
    >>> import deadtime as dtm
    >>> log = dtm.open_log("flight.bin")  # doctest: +SKIP
    >>> found = dtm.logs.tune_loop(log, "altitude")  # doctest: +SKIP
    >>> print(*found.settings.lines)  # doctest: +SKIP
    PSC_POSZ_P,1.62
    """
    firmware = FORMS.get(log.autopilot)
    if firmware is None:
        names = ", ".join(FORMS)
        raise ValueError(
            f"{log.source} is a log of {log.autopilot or 'no autopilot'}, but gains can be "
            f"proposed only for {names}"
        )
    if loop is not None:
        return _tuned(log, log.loop(loop), firmware, controller, form, allow_indication, demands)
    refused = []
    known = [
        log_loop for log_loop in log.loops.values() if log_loop.name in LOOPS_OF_FORMS[firmware]
    ]
    for log_loop in sorted(known, key=lambda each: ORDER.index(each.kind)):
        try:
            found = _tuned(log, log_loop, firmware, controller, form, allow_indication, demands)
        except (ValueError, NotIdentifiableError) as error:
            refused.append(f"{log_loop.name}: {str(error).removeprefix(f'{log_loop.name}: ')}")
            continue
        if found.verdict != "none":
            return found
        refused.append(f"{log_loop.name}: {'; '.join(found.reasons)}")
    why = "; ".join(refused) or (
        f"the log has none of the loops {', '.join(LOOPS_OF_FORMS[firmware])}"
    )
    raise NotIdentifiableError(f"gains cannot be proposed for any loop of {log.source}: {why}")


def _tuned(
    log: Log,
    loop: LogLoop,
    firmware: Form,
    controller: type[Controller] | Controller | None,
    form: Form | None,
    allow_indication: bool,
    demands: Mapping[str, Any],
) -> Proposal:
    if loop.name not in LOOPS_OF_FORMS[firmware]:
        names = ", ".join(LOOPS_OF_FORMS[firmware])
        raise ValueError(
            f"{loop.name}: gains can be proposed for {firmware} only in the loops {names}"
        )
    record = loop.recording(command="actuator")
    if loop.actuator is not None and loop.actuator.unit != UNITS[loop.kind]:
        unit = loop.actuator.unit or "no unit"
        raise ValueError(
            f"{loop.name}: the log contains the command {loop.actuator.source} in {unit}, but "
            f"the gains of this loop give {UNITS[loop.kind] or 'a torque'}"
        )
    flown = _flown(log, loop.name, firmware)
    if flown is None and controller is None:
        raise ValueError(
            f"{loop.name}: the log contains no gain of this loop, so its controller is not "
            "known. Give the controller by controller=, or by --controller on the command line"
        )
    own = form is None or form == firmware
    return tune(
        record,
        controller=controller or flown or PI,
        form=firmware if form is None else form,
        loop=loop.name if own else "",
        version=log.firmware if own else "",
        flown=flown,
        allow_indication=allow_indication,
        # The controller computes its command far more often than the log has rows.
        known={"between": "straight", "closed_loop": True},
        **demands,
    )


def _flown(log: Log, loop: str, firmware: Form) -> Controller | None:
    """The controller of the log's parameters; None where they lack its gain, or it is zero."""
    try:
        return controller_of(log.parameters, firmware, loop=loop, version=log.firmware)
    except ValueError as error:
        if "missing" in str(error) or "the loop is open" in str(error):
            return None
        raise
