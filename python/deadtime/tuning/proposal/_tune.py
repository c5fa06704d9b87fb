"""`tune`: from a recording to gains that can be typed in."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from deadtime._base.validation import OpenRange
from deadtime.estimation import PlantEstimate, estimate_delay
from deadtime.loops import PI, PID, Controller
from deadtime.recordings import Recording
from deadtime.tuning._problem import controller_template
from deadtime.tuning._rules import compared
from deadtime.tuning.forms import LOOPS_OF_FORMS, Form, check_form, settings_of
from deadtime.tuning.proposal._gains import refusals, wanted_gains, why_none
from deadtime.tuning.proposal._prediction import predicted_load, predicted_set_point
from deadtime.tuning.proposal._proposal import Proposal


def tune(
    recording: Recording | list[Recording] | PlantEstimate,
    *,
    controller: type[Controller] | Controller = PI,
    form: Form = "parallel",
    loop: str = "",
    version: str = "",
    spans: tuple[float, float] | None = None,
    flown: Controller | None = None,
    sample_time: float | None = None,
    limit: float | None = None,
    level: float = 0.95,
    allow_indication: bool = False,
    window: OpenRange | list[OpenRange | None] | None = None,
    known: dict[str, Any] | None = None,
    **demands: Any,
) -> Proposal:
    """Propose gains from a recording of a process or of a vehicle's loop.

    The plant is estimated, gains are designed for all plants that the recording leaves possible,
    rounded as they are typed, and refused where they may not be used.

    Parameters
    ----------
    recording : Recording, list of Recording or PlantEstimate
        A bump test or a closed loop, with its command; or what was estimated from it.
    controller : Controller or class of one
        `P`, `PI`, `PD`, `PV`, `PID`, or an instance whose other numbers, such as the filter of its
        derivative, are kept.
    form, loop, version, spans
        How the gains are typed: see `settings_of`.
    flown : Controller, optional
        The controller of the recording. Gains change by at most a factor of two against it.
    sample_time : float, optional
        Time between the controller's commands, s; continuous without.
    limit : float, optional
        Largest size of the command, from where it rests.
    level : float
        Probability of the intervals that are designed for.
    allow_indication : bool
        Propose gains for an estimate that is an indication, too; the verdict says so.
    window : (low, high) or list of them, optional
        The part of the recording to use, s.
    known : dict, optional
        What else `estimate_delay` is to know, such as ``{"plant": "lag"}``.
    **demands
        What `design` is to keep and make best, such as ``gain_margin=3.0``.

    Returns
    -------
    Proposal
        Its verdict is ``"none"``, with the reasons, where there are no gains to use.

    Raises
    ------
    ValueError
        When no gains meet the demands, or the form cannot express them.

    See Also
    --------
    deadtime.estimate_delay, deadtime.design, deadtime.tuning.settings_of

    Examples
    --------
    A bump test: the heater steps by 5, the temperature answers 12 s later.

    >>> import numpy as np
    >>> import deadtime as dtm
    >>> time = np.arange(300.0)
    >>> heater = np.where(time < 30, 40.0, 45.0)
    >>> warmth = 9.0 * (1.0 - np.exp(-np.maximum(time - 42.0, 0.0) / 20.0))
    >>> warmth += np.random.default_rng(1).normal(0.0, 0.05, time.size)
    >>> found = dtm.tune(dtm.Recording(time, None, warmth, heater), form="ideal")
    >>> found.verdict, type(found.controller).__name__
    ('reliable', 'PI')
    >>> found.loop.is_stable()
    True
    """
    template = controller_template(controller)
    if form in LOOPS_OF_FORMS and isinstance(template, (PI, PID)) and template.weight is None:
        template = replace(template, weight=1.0)  # no firmware has another one
    check_form(template, form, loop, version)
    if isinstance(recording, PlantEstimate):
        fit = recording
    else:
        fit = estimate_delay(recording, None, window=window, **(known or {}))
    if reasons := why_none(fit, level, allow_indication):
        return Proposal("none", reasons, fit, flown=flown)
    found = wanted_gains(
        fit,
        template,
        sample_time=sample_time,
        limit=limit,
        level=level,
        flown=flown,
        demands=demands,
    )
    settings = settings_of(found.controller, form, loop=loop, version=version, spans=spans)
    typed, most = settings.controller, demands.get("max_sensitivity")
    if reasons := refusals(fit, found, typed, flown, settings.rounding, most):
        return Proposal("none", reasons, fit, flown=flown)
    loops = found.under(typed)
    set_point, shows_set_point = predicted_set_point(fit, loops)
    load, shows_load = predicted_load(fit, loops)
    return Proposal(
        verdict=fit.verdict,
        reasons=(),
        fit=fit,
        design=found.design,
        settings=settings,
        flown=flown,
        set_point=set_point,
        load=load,
        shows_set_point=shows_set_point,
        shows_load=shows_load,
        remarks=found.remarks,
        rules=compared(loops[0], "proposal"),
        _loops=loops,
    )
