"""An estimate as text: first the verdict with the delay, then the rest."""

from __future__ import annotations

import re

from deadtime._cli.show import print_text
from deadtime.estimation import DelayEstimate, unseen_in_words

#: How a message advises to fit more.
_FREE = re.compile(r"free=\(([^)]*)\)")

#: How a message advises to estimate without a plant, where the command was logged.
_NO_PLANT = re.compile(
    r"the call without the plant, dtm\.estimate_delay\(recording(, window=\([^)]*\))?\)$"
)


def print_headline(fit: DelayEstimate) -> None:
    """Print verdict and delay, and what the tests of the model leave open or what to do next."""
    reliable = fit.verdict == "reliable"
    print_text(_as_option(f"{fit.headline()} ({fit.method})"), "bold" if reliable else "yellow")
    if reliable:
        text = "The tests of the model find no contradiction at the 1 % level."
        if "unseen_lag" in fit.details:
            words = unseen_in_words(fit.details["unseen_lag"])
            text += f" {words[0].upper()}{words[1:]} be seen."
        print_text(text)
    elif fit.advice:
        print_text(f"next: try {_as_option(fit.advice)}")


def print_details(fit: DelayEstimate) -> None:
    """Print every fitted quantity, the method and the noise."""
    print_text("\n".join(fit.numbers()), wrapped=False)
    print_text(f"{fit.method}: {_as_option(fit.description)}", "dim")


def _as_option(text: str) -> str:
    """Advice in the words of the command line."""
    text = _NO_PLANT.sub("the same command without --kp and --plant", text)
    return _FREE.sub(lambda found: f"--free {found[1].replace(' ', '').replace(chr(39), '')}", text)
