"""Proofs that a loop is stable while its delay and its gains change, which can be stored."""

from __future__ import annotations

import dataclasses
import json
import math
import reprlib
from dataclasses import dataclass
from typing import Any, Final

from deadtime.tuning.adaptive._check import check
from deadtime.tuning.adaptive._claims import Claims

_FORMAT: Final = "deadtime proof of a gain schedule"


@dataclass(frozen=True)
class SwitchingProof(Claims):
    """A quadratic form that decreases for every delay, every set of gains and their changes.

    Made by `adaptive_gains`. It contains the loop, the sets and the form v'Pv of the state, the
    filter and the measurements of the last samples. What it proves is said in the notes.

    Attributes
    ----------
    num, den : tuple of float
        The plant for a gain of one, descending.
    gain : (float, float)
        Interval of the plant's gain.
    sample_time : float
        s.
    Kp, Kv : float
        Gains for a factor of one.
    filter : (float, float, str) or None
        Corner in rad/s, damping and rule of the derivative's filter.
    factors : tuple of float
        The factor of each set on both gains.
    ages : tuple of (int, int)
        The interval of the delay of each set, in samples.
    limit : float or None
        Largest command.
    least_factor : float
        The form decreases also while the limit reduces the command to what this factor would give.
    decay : float
        While the limit is not met the state decays at least as e^(-decay t), 1/s.
    step : float
        Largest step of the reference, from rest, that is proved with the limit; without a limit
        the proof holds for any, and this is a matter of scale.
    form : tuple of tuple of float
        P. The states are those of the plant, y first, of the filter, and the last measurements
        y + (Kv/Kp) y', the latest first.

    Notes
    -----
    The controller runs every `sample_time`. At every time the vehicle obeys a command whose age is
    that of one of the delays in the interval of the set by which it was computed; which one may
    change at any time and by any rate. The command before a lost one becomes a sample older. With a
    plant that has a lag, commands are obeyed in the order in which they were given (a late one is
    ignored); without a lag, in any. The plant is what it is said to be. A delay of the measurement
    that changes, and samples that are left out, are not covered.

    Examples
    --------
    >>> import deadtime as dtm
    >>> from deadtime.tuning import SwitchingProof, adaptive_gains
    >>> loop = dtm.ControlLoop(dtm.Integrator(0.9), dtm.P(1.0), sample_time=0.1, limit=1.0)
    >>> proof = adaptive_gains(loop, (0.1, 0.4)).proof
    >>> proof.verify() >= 1.0
    True
    >>> SwitchingProof.from_json(proof.to_json()) == proof
    True
    """

    def __repr__(self) -> str:
        last = max(last for _, last in self.ages) * self.sample_time
        first = min(first for first, _ in self.ages) * self.sample_time
        return (
            f"<SwitchingProof: {len(self.factors)} sets of gains, delays of {first:g} to {last:g} "
            f"s, {len(self.form)} states>"
        )

    def verify(self) -> float:
        """Check every claim independently of the code that made it.

        The checker is plain Python: it makes the loop again from its numbers and decides all
        inequalities between fractions. It takes some milliseconds per matrix.

        Returns
        -------
        float
            The step.

        Raises
        ------
        CertificateError
            If a claim is false or not proved; the first one is named.

        Examples
        --------
        >>> import dataclasses
        >>> import deadtime as dtm
        >>> from deadtime.tuning import adaptive_gains
        >>> loop = dtm.ControlLoop(dtm.Integrator(0.9), dtm.P(1.0), sample_time=0.1)
        >>> proof = adaptive_gains(loop, (0.1, 0.4)).proof
        >>> dataclasses.replace(proof, Kp=4.0 * proof.Kp).verify()
        Traceback (most recent call last):
            ...
        deadtime._base.errors.CertificateError: the proof is false: the form is not proved to ...
        """
        return check(self)

    def to_json(self, indent: int | None = None) -> str:
        """Write the proof as JSON, with numbers in hexadecimal so that none is rounded.

        Parameters
        ----------
        indent : int, optional
            As in `json.dumps`.

        Returns
        -------
        str
        """
        return json.dumps({"format": _FORMAT, **_plain(dataclasses.asdict(self))}, indent=indent)

    @classmethod
    def from_json(cls, text: str) -> SwitchingProof:
        """Read what `to_json` wrote; only the form is checked, `verify` checks the claims.

        Parameters
        ----------
        text : str

        Returns
        -------
        SwitchingProof

        Raises
        ------
        ValueError
            If the text is not such a proof.
        """
        try:
            data = json.loads(text)
            if data.pop("format") != _FORMAT:
                raise KeyError("format")
            names = [field.name for field in dataclasses.fields(cls)]
            values = {name: _read(data.pop(name)) for name in names}
            if data:
                raise KeyError(*data)
            return cls(**values)
        except (KeyError, TypeError, ValueError, AttributeError, RecursionError) as error:
            raise ValueError(f"this is not the text of a proof: {error}") from error


def _plain(value: Any) -> Any:
    """Convert a value to types of JSON; floats become hexadecimal text."""
    if isinstance(value, dict):
        return {name: _plain(part) for name, part in value.items()}
    if isinstance(value, (tuple, list)):
        return [_plain(part) for part in value]
    return value.hex() if isinstance(value, float) else value


def _read(value: Any) -> Any:
    if isinstance(value, list):
        return tuple(map(_read, value))
    if value is None or value in ("tustin", "backward") or type(value) is int:
        return value
    if not isinstance(value, str):
        raise TypeError(f"{reprlib.repr(value)}: a number is written in hexadecimal")
    number = float.fromhex(value)
    if not math.isfinite(number):
        raise ValueError(f"{value} is not finite")
    return number
