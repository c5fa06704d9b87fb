"""Delay from the overshoot of a step, in the two ways that the paper compares.

By the dominant root: W0(-K Td)/Td (eq. 3) is to have the damping ratio (eq. 6) that a second-order
system with this overshoot has (eq. 5). By simulation: the delay at which the simulated loop has
this overshoot, here with exact simulations, without the error of a solver.
"""

from __future__ import annotations

import deadtime as dtm

#: Longest delay of the search, in units of 1/(gain Kp): the limit of stability is pi/2.
LONGEST = 1.55


def damping_of(root: complex) -> float:
    """Damping ratio of a pair of roots (eq. 6).

    Parameters
    ----------
    root : complex
        One of the pair, 1/s.

    Returns
    -------
    float
    """
    return -root.real / abs(root)


def delay_by_dominant_root(gain: float, part: float) -> float:
    """Delay at which the dominant root has the damping ratio of an overshoot (eqs. 3, 5, 6).

    Parameters
    ----------
    gain : float
        K = Kp of the unit integrator, 1/s.
    part : float
        Overshoot as a share of the step.

    Returns
    -------
    float
        s.

    Examples
    --------
    >>> from deadtime.paper import delay_by_dominant_root
    >>> round(delay_by_dominant_root(1.31, 0.0230), 4)
    0.3598
    """
    from scipy.optimize import brentq

    requested = dtm.damping_ratio(part)

    def excess(delay: float) -> float:
        return damping_of(complex(dtm.dde_roots(0.0, -gain, delay))) - requested

    # The root is real, and its damping ratio 1, up to gain * delay = 1/e.
    return float(brentq(excess, 0.3679 / gain, LONGEST / gain, xtol=1e-15))


def overshoot(loop: dtm.ControlLoop) -> float:
    """Overshoot of the step response of a loop, in percent; exact.

    Parameters
    ----------
    loop : ControlLoop

    Returns
    -------
    float
    """
    return loop.step_response().info()["overshoot"]


def delay_by_simulation(loop: dtm.ControlLoop, part: float) -> float:
    """Delay at which the simulated step response of a loop has an overshoot.

    Parameters
    ----------
    loop : ControlLoop
        An integrator under proportional control; its delay does not matter.
    part : float
        Overshoot as a share of the step.

    Returns
    -------
    float
        s.

    Examples
    --------
    >>> import deadtime as dtm
    >>> from deadtime.paper import delay_by_simulation
    >>> free = dtm.ControlLoop(dtm.Integrator(), dtm.P(Kp=1.31))
    >>> limited = free.replace(limit=1.0)
    >>> round(delay_by_simulation(free, 0.0230), 5), round(delay_by_simulation(limited, 0.0230), 5)
    (0.35874, 0.36864)
    """
    from scipy.optimize import brentq

    gain = loop.parameters["gain"] * loop.parameters["Kp"]

    def excess(delay: float) -> float:
        return overshoot(loop.replace(delay=delay)) - 100.0 * part

    return float(brentq(excess, 0.37 / gain, LONGEST / gain, xtol=1e-11))
