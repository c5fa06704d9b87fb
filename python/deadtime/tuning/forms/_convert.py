"""`settings_of` and `controller_of`: gains to a form that people type in, and back."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Literal, TypeAlias, get_args

from deadtime.loops import Controller
from deadtime.tuning.forms import _ardupilot, _betaflight, _classical, _firmware, _px4
from deadtime.tuning.forms._settings import Settings, numbers_from

Form: TypeAlias = Literal["ideal", "series", "parallel", "ardupilot", "px4", "betaflight"]


def settings_of(
    controller: Controller,
    form: Form,
    *,
    loop: str = "",
    version: str = "",
    spans: tuple[float, float] | None = None,
) -> Settings:
    """Return the gains of a controller as people type them.

    Parameters
    ----------
    controller : Controller
        `P`, `PV`, `PD`, `PI` or `PID`, in SI units: rad/s, rad, m/s or m, to what the firmware
        commands (see `loop`).
    form : {"ideal", "series", "parallel", "ardupilot", "px4", "betaflight"}
        What to write.
    loop : str
        Loop of the vehicle, by the names that `open_log` gives: ``"roll rate"`` (rad/s to torque,
        -1 to 1; of Betaflight to thousandths of it), ``"roll"`` (rad to rad/s), ``"north
        velocity"`` and ``"vertical speed"`` (m/s to m/s²), ``"north position"`` and ``"altitude"``
        (m to m/s), ``"vertical acceleration"`` (m/s² to throttle, 0 to 1). The same for other axes.
    version : str
        Version of the firmware, such as ``"4.7"``: names changed. By default the names before
        ArduPilot 4.7 and Betaflight 4.6.
    spans : (float, float), optional
        Spans of measurement and output, for a proportional band beside the gain.

    Returns
    -------
    Settings

    Raises
    ------
    ValueError
        If the form cannot express the controller: a gain that the firmware lacks, a filter of
        another kind, a derivative of the wrong signal, a negative gain, zeros that the series form
        has not. If there is no such form or loop.

    Examples
    --------
    >>> import deadtime as dtm
    >>> from deadtime.tuning import settings_of
    >>> print(*settings_of(dtm.PI(Kp=1.2, Ki=0.03), "ideal").lines, sep="; ")
    Kc = 1.2; Ti = 40 s; Td = 0 s
    >>> print(*settings_of(dtm.P(1.3), "ardupilot", loop="altitude").lines)
    PSC_POSZ_P,1.3
    >>> print(settings_of(dtm.PI(82.58, 1120.2), "betaflight", loop="roll rate").lines[:2])
    ('set p_roll = 45', 'set i_roll = 80')
    """
    if not isinstance(controller, Controller):
        raise TypeError(f"controller={controller!r}: give P, PV, PD, PI or PID")
    _check(form, loop, version)
    if form in _classical.FORMS:
        return _classical.write(controller, form, spans)
    if spans is not None:
        raise ValueError(
            f"spans={spans}: only the forms ideal, series and parallel have a proportional "
            "band. Leave spans out"
        )
    if form == "betaflight":
        return _betaflight.write(controller, loop, _numbers(version))
    where = _FIRMWARES[form]
    found = _loop_of(form, loop, version)
    return _firmware.written(controller, found, form, loop, where.WRITTEN, where.SOURCE)


def check_form(controller: Controller, form: Form, loop: str, version: str = "") -> None:
    """Refuse a form that cannot express a controller of this kind, before its gains are known."""
    _check(form, loop, version)
    if form == "betaflight":
        _betaflight.check(controller)
    elif form not in _classical.FORMS:
        _firmware.check(controller, _loop_of(form, loop, version), form, loop)


def _loop_of(form: Form, loop: str, version: str) -> _firmware.FirmwareLoop:
    found: _firmware.FirmwareLoop = _FIRMWARES[form].loops(_numbers(version))[loop]
    return found


def controller_of(
    settings: Mapping[str, float] | str, form: Form, *, loop: str = "", version: str = ""
) -> Controller:
    r"""Return the controller of typed numbers; the way back from `settings_of`.

    Parameters
    ----------
    settings : mapping of str to float, or str
        Numbers by name, such as the parameters of a log, or text: lines such as ``Ti = 40 s``, a
        ``.param`` file, lines of ``param set``, the output of ``dump``. Other names are skipped,
        except in the forms without a firmware.
    form : {"ideal", "series", "parallel", "ardupilot", "px4", "betaflight"}
        What is read.
    loop, version : str
        As for `settings_of`.

    Returns
    -------
    Controller
        The simplest one with these gains. Where the firmware takes the derivative of the
        measurement, without an integral a `PV`.

    Raises
    ------
    ValueError
        If the proportional gain is missing, a number is none, or the controllers here have no such
        filter.

    Examples
    --------
    >>> from deadtime.tuning import controller_of
    >>> controller_of("ATC_RAT_RLL_P,0.135\nATC_RAT_RLL_I,0.09", "ardupilot", loop="roll rate")
    PI(Kp=0.135, Ki=0.09)
    """
    _check(form, loop, version)
    if form in _classical.FORMS:
        return _classical.read(settings, form)
    if form == "betaflight":
        return _betaflight.read(settings, loop)
    found = _loop_of(form, loop, version)
    return _firmware.controller_of(numbers_from(settings, form, _FIRMWARES[form].LINE), found)


#: Firmwares whose loops are a table of parameters.
_FIRMWARES = {"ardupilot": _ardupilot, "px4": _px4}

#: The loops of each firmware.
LOOPS_OF_FORMS: dict[str, tuple[str, ...]] = {
    "ardupilot": tuple(_ardupilot.LOOPS),
    "px4": tuple(_px4.LOOPS),
    "betaflight": _betaflight.LOOPS,
}


def _check(form: str, loop: str, version: str) -> None:
    if form not in get_args(Form):
        raise ValueError(f"form={form!r}: give one of {', '.join(get_args(Form))}")
    if form in _classical.FORMS:
        for name, value in (("loop", loop), ("version", version)):
            if value:
                raise ValueError(
                    f"{name}={value!r}: the form {form!r} does not belong to a vehicle. "
                    f"Leave {name} out"
                )
    if form in LOOPS_OF_FORMS and loop not in LOOPS_OF_FORMS[form]:
        raise ValueError(
            f"loop={loop!r}: give one of the loops of {form}, which are "
            f"{', '.join(LOOPS_OF_FORMS[form])}"
        )


def _numbers(version: str) -> tuple[int, ...] | None:
    """The first two numbers of a version, None if it has none."""
    found = re.search(r"(\d+)\.(\d+)", version)
    return None if found is None else (int(found[1]), int(found[2]))
