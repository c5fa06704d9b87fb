"""An estimate as text: first the delay and whether the model is adequate, then the rest."""

from __future__ import annotations

import math
import re

from deadtime._base.digits import between, stated
from deadtime._cli.show import print_text
from deadtime.estimation import DelayEstimate, unseen_in_words

#: What begins the reasons in the message of an estimate.
_NOT_ADEQUATE = "; not adequate: "

#: How a message advises to fit more.
_FREE = re.compile(r"free=\(([^)]*)\)")

#: Advice in a message, in the words of the command line.
_ADVICE = re.compile(r" \(try [^)]*\)")


def print_headline(fit: DelayEstimate) -> None:
    """Print the delay with its interval, and whether the model is adequate or why it is not."""
    known = fit.calibrated and "delay" in fit.free
    error = fit.stderr["delay"] if known else math.nan
    text = f"delay {stated(fit.delay, error, 's')}"
    if "delay" not in fit.free:
        text += ", as it was given"
    elif known:
        text += f", 95 % interval {between(*fit.ci(0.95), error, 's')}"
    else:
        text += ", without an interval"
    print_text(f"{text} ({fit.method})", "bold")
    if fit.adequate:
        text = "The model is adequate: no test of it fails at the 1 % level."
        if "unseen_lag" in fit.details:
            words = unseen_in_words(fit.details["unseen_lag"])
            text += f" {words[0].upper()}{words[1:]} be seen."
        print_text(text)
        return
    message = _as_option(fit.message)
    _, _, why = message.partition(_NOT_ADEQUATE)
    why = why or (
        f"the residuals are not white (lag-1 autocorrelation {fit.whiteness.autocorrelation:.2f})"
    )
    advice = _ADVICE.search(message)
    if advice is not None and advice[0] not in why:
        why += advice[0]
    consequence = ", so the interval need not hold the true delay" if fit.calibrated else ""
    print_text(f"The model is not adequate{consequence}: {why}.", "yellow")


def print_details(fit: DelayEstimate) -> None:
    """Print every fitted quantity, the method and the noise."""
    first, *rest = fit.summary().splitlines()
    print_text("\n".join(rest), wrapped=False)
    print_text(_as_option(first.partition(_NOT_ADEQUATE)[0]), "dim")


def _as_option(text: str) -> str:
    """Advice in the words of the command line."""
    return _FREE.sub(lambda found: f"--free {found[1].replace(' ', '').replace(chr(39), '')}", text)
