"""What is fitted: the names of ``--free``, checked against the loop and the method."""

from __future__ import annotations

from collections.abc import Sequence

from deadtime.estimation import DelayEstimate
from deadtime.loops import ControlLoop

#: What only `waveform` fits.
OF_WAVEFORM = ("limit", "start")

#: Plants that have the other names.
FORMS = {"lag": "gain/(s*(lag*s+1))", "time_constant": "gain/(time_constant*s+1)"}


def checked_free(text: str | None, loop: ControlLoop, method: str) -> tuple[str, ...]:
    """The names in a list, each once; delay and gain for None."""
    if text is None:
        return ("delay", "gain")
    names = tuple(dict.fromkeys(name.strip() for name in text.split(",") if name.strip()))
    known = ["delay", *loop.plant.parameters]
    if method == "waveform":
        known += [name for name in OF_WAVEFORM if name != "limit" or loop.limit is not None]
    choice = f"choose from {', '.join(known)}"
    if not names:
        raise ValueError(f"--free names no parameter: {choice}")
    for name in names:
        if name in known:
            continue
        why = f"{name!r} cannot be fitted"
        if name in FORMS:
            why = f"this plant has no {name}. Only a plant {FORMS[name]} has this parameter"
        elif name in OF_WAVEFORM and method != "waveform":
            why = f"{name} can be fitted only by --method waveform"
        elif name == "limit":
            why = "the limit can be fitted only from an initial value: give --limit"
        raise ValueError(f"--free {text}: {why}; {choice}")
    if "delay" not in names and loop.delay is None:
        raise ValueError(
            f"--free {text}: the delay is not known, so it must be fitted. Add delay to --free; "
            f"{choice}"
        )
    return names


def check_fitted(names: Sequence[str], fit: DelayEstimate) -> None:
    """Refuse names that the method took as given."""
    left = [name for name in names if name not in fit.free]
    if left:
        raise ValueError(
            f"--free {','.join(names)}: --method {fit.method} cannot fit {' and '.join(left)}. It "
            f"can fit only {', '.join(fit.free)}"
        )
