"""`Proposal`: gains proposed from a recording, with what they are expected to do."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite, isinf
from os import PathLike
from pathlib import Path
from typing import Any

from numpy.typing import ArrayLike

from deadtime._base.arrays import Array
from deadtime._base.drawing import Axes, Figure
from deadtime._base.frozen import ReadOnlyArrays
from deadtime._base.notebook import Pictured
from deadtime._base.page import write_page
from deadtime._base.plain import plain_fields
from deadtime._base.validation import one_dimensional
from deadtime._base.verdicts import Verdict
from deadtime.estimation import PlantEstimate
from deadtime.loops import Controller, ControlLoop, LoadResponse
from deadtime.tuning._result import Design, LeastMargins
from deadtime.tuning._rules import RuleTable, compared
from deadtime.tuning.forms import Settings
from deadtime.tuning.proposal._page import render
from deadtime.tuning.proposal._prediction import Prediction, banded


@dataclass(frozen=True, eq=False, repr=False)
class Proposal(ReadOnlyArrays, Pictured):
    """Gains proposed from a recording; made by `tune`.

    Attributes
    ----------
    verdict : {"reliable", "indication", "none"}
        Whether the gains hold for all plants that the recording leaves possible; whether they were
        taken from an estimate that is an indication, as was asked; or whether there are none.
    reasons : tuple of str
        Why there are no gains, in sentences; empty where there are.
    fit : PlantEstimate
        The plant that the recording shows.
    design : Design or None
        The design over the intervals of the estimate.
    settings : Settings or None
        The gains as they are typed.
    flown : Controller or None
        The controller of the recording, where it was given.
    set_point, load : Prediction or None
        What the typed gains are expected to do.
    shows_set_point, shows_load : bool
        Whether the recording has the same move, so that both can be drawn over each other.
    remarks : tuple of str
        What else has to be known, in sentences.
    rules : RuleTable or None
        The gains beside those of rules of thumb, each on the likeliest plant.
    """

    verdict: Verdict
    reasons: tuple[str, ...]
    fit: PlantEstimate
    design: Design | None = None
    settings: Settings | None = None
    flown: Controller | None = None
    set_point: Prediction | None = None
    load: Prediction | None = None
    shows_set_point: bool = False
    shows_load: bool = False
    remarks: tuple[str, ...] = ()
    rules: RuleTable | None = None
    _loops: tuple[ControlLoop, ...] = ()

    def __repr__(self) -> str:
        return f"<Proposal {self.headline()}>"

    @property
    def controller(self) -> Controller:
        """The controller with the gains as they are typed.

        Raises
        ------
        ValueError
            If there are none; the message says why.
        """
        return self._made().controller

    @property
    def loop(self) -> ControlLoop:
        """The likeliest plant under `controller`.

        Raises
        ------
        ValueError
            If there are no gains.
        """
        self._made()
        return self._loops[0]

    def _made(self) -> Settings:
        if self.settings is None:
            raise ValueError(f"no gains: {'; '.join(self.reasons)}")
        return self.settings

    def predict(self, time: ArrayLike, reference: ArrayLike) -> tuple[Array, Array, Array]:
        """Predict the response to any set point, from rest at its first value.

        Parameters
        ----------
        time : array_like, shape (n,)
            Times, s, increasing.
        reference : array_like, shape (n,)
            The set point, which holds from row to row.

        Returns
        -------
        outputs, low, high : ndarray, shape (n,)
            Output of the likeliest plant, and the ends of the band.

        Raises
        ------
        ValueError
            If there are no gains.
        """
        self._made()
        times, target = one_dimensional("time", time), one_dimensional("reference", reference)
        level = float(target[0])
        outputs = [
            level + loop.simulate(times, target - level, reference_time=times).outputs
            for loop in self._loops
        ]
        return outputs[0], *banded(outputs, self.fit.noise_std)

    def headline(self) -> str:
        """The verdict and the gains, in a line.

        Returns
        -------
        str
        """
        if self.settings is None:
            return f"none: no gains were proposed, because {'; '.join(self.reasons)}"
        gains = ", ".join(f"{name} = {value:.4g}" for name, value in self.controller.gains.items())
        return f"{self.verdict}: {type(self.controller).__name__} with {gains}"

    def lines(self) -> list[str]:
        """The summary but for its first line, a line each.

        Returns
        -------
        list of str
        """
        lines = [self.fit.headline()]
        if self.settings is None or self.design is None:
            return [*lines, f"next: {self.fit.advice().words}"]
        lines += self.settings.summary().splitlines()
        lines += [*self.expected(), *self.remarks]
        return lines if self.rules is None else [*lines, *repr(self.rules).splitlines()]

    def expected(self) -> list[str]:
        """Margins, and what the gains are expected to do, in sentences.

        Returns
        -------
        list of str

        Raises
        ------
        ValueError
            If there are no gains.
        """
        self._made()
        return [self._margins(), *self._responses()]

    @property
    def margins(self) -> LeastMargins:
        """The least margins over all plants that the recording leaves possible.

        Raises
        ------
        ValueError
            If there are no gains.
        """
        self._made()
        each = [loop.margin() for loop in self._loops]

        def worst(name: str) -> float:
            most = max if name.startswith("max_") else min
            return most(float(getattr(margins, name)) for margins in each)

        return LeastMargins(*map(worst, LeastMargins._fields))

    def _margins(self) -> str:
        least = self.margins
        return (
            "least margins over all plants that agree with the recording: gain "
            f"{least.gain_margin:.3g}, phase {least.phase_margin:.3g}°, delay "
            f"{least.delay_margin:.3g} s; Ms at most {least.max_sensitivity:.3g}"
        )

    def _responses(self) -> list[str]:
        """What the gains are expected to do."""
        said = []
        if self.set_point is not None:
            info = self.loop.step_response().info()
            said.append(
                f"step of the set point: overshoot {info['overshoot']:.2g} %, settling time "
                f"{info['settling_time']:.3g} s"
            )
        met = self._met()
        if self.load is not None and met is not None:
            words = f"load of {self.load.size:.3g}: the output deviates by {met.peak:.3g}"
            if isfinite(met.recovery_time):
                words += f", and has returned after {met.recovery_time:.3g} s"
            if isinf(met.iae) and isinstance(met.steady_state, float):
                words += f", and a deviation of {abs(met.steady_state):.3g} remains"
            said.append(words)
        return said

    def _met(self) -> LoadResponse | None:
        """The response to the load of the recording; None without one, or if it has no end."""
        if self.load is None:
            return None
        try:
            return self.loop.load_response(size=self.load.size)
        except ValueError:
            return None

    def summary(self) -> str:
        """Verdict, gains as they are typed, margins, what is expected.

        Returns
        -------
        str
        """
        return "\n".join([self.headline(), *self.lines()])

    def to_dict(self) -> dict[str, Any]:
        """The proposal as plain values for JSON, without the arrays."""
        info = None if self.settings is None else self.loop.step_response().info()
        steps = ("overshoot", "settling_time")
        met = self._met()
        moves = {"set_point": self.set_point, "load": self.load}
        found: dict[str, Any] = {
            "verdict": self.verdict,
            "headline": self.headline(),
            "reasons": self.reasons,
            "gains": None if self.settings is None else self.controller.gains,
            "settings": None if self.settings is None else self.settings.to_dict(),
            "flown": None if self.flown is None else self.flown.gains,
            "margins": None if self.settings is None else self.margins._asdict(),
            "load_response": None if met is None else met.info(),
            "step": None if info is None else {name: info[name] for name in steps},
            "remarks": self.remarks,
            "rules": None if self.rules is None else [row._asdict() for row in self.rules],
            "estimate": self.fit.to_dict(),
        }
        found |= {
            name: None
            if move is None
            else {"size": move.size, "start": move.start, "peak": move.peak}
            for name, move in moves.items()
        }
        return plain_fields(found)

    def plot(self, ax: Sequence[Axes] | None = None) -> Sequence[Axes]:
        """Draw the predicted responses over the recording.

        Parameters
        ----------
        ax : sequence of matplotlib.axes.Axes, optional
            One for the set point, one for the load. By default those of a new figure.

        Returns
        -------
        sequence of matplotlib.axes.Axes

        Raises
        ------
        ValueError
            If there are no gains.
        ImportError
            If matplotlib is not installed.
        """
        from deadtime.tuning.proposal._plots import plot_proposal

        self._made()
        return plot_proposal(self, ax)

    def figure(self) -> Figure:
        """Draw the predicted responses over the recording, in a figure of its own.

        Returns
        -------
        matplotlib.figure.Figure

        Raises
        ------
        ValueError
            If there are no gains.
        ImportError
            If matplotlib is not installed.
        """
        from deadtime.tuning.proposal._plots import figure_of

        self._made()
        return figure_of(self)

    def report(self, path: str | PathLike[str]) -> Path:
        """Write a page with the gains, what they are expected to do, and the loop to explore.

        Parameters
        ----------
        path : str or path
            The page, HTML.

        Returns
        -------
        pathlib.Path

        Raises
        ------
        ValueError
            If there are no gains.
        ImportError
            If matplotlib or jinja2 are not installed.
        """
        settings, expected = self._made(), [*self.expected(), *self.remarks]
        figure = self.figure()
        rules = compared(self.loop, "proposal") if self.rules is None else self.rules
        text = render(self.headline(), self.fit, settings, expected, figure, self.loop, rules)
        return write_page(text, Path(path))

    def _picture(self) -> Figure | None:
        return None if self.settings is None else self.figure()
