"""Proofs that a loop is stable while its delay and its gains change, which can be stored."""

from __future__ import annotations

from dataclasses import dataclass

from deadtime.roots.certificate import Stored
from deadtime.tuning.adaptive._check import check, check_form
from deadtime.tuning.adaptive._claims import Claims


@dataclass(frozen=True)
class SwitchingProof(Claims, Stored):
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

    _FORMAT = "deadtime proof of a gain schedule"
    _NOUN = "proof"

    def __repr__(self) -> str:
        last = max(last for _, last in self.ages) * self.sample_time
        first = min(first for first, _ in self.ages) * self.sample_time
        return (
            f"<SwitchingProof: {len(self.factors)} sets of gains, delays of {first:g} to {last:g} "
            f"s, {len(self.form)} states>"
        )

    def _check_form(self) -> None:
        check_form(self)

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
        deadtime._base.errors.CertificateError: the proof is false: with the loop gains ...
        """
        return check(self)
