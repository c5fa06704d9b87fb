"""Controllers given as transfer functions, of this package or of another one.

A quotient that is Kp, Kp + Ki/s, Kp + Kd s or Kp + Ki/s + Kd s is a `P`, `PI`, `PD` or `PID`. A
loop has no other controllers, and `deadtime.feedback` closes one around any transfer function.
"""

from __future__ import annotations

from deadtime.loops._controllers import PD, PI, PID, Controller, P
from deadtime.loops._given_plants import transfer_function_of
from deadtime.loops._plants import Plant


def controller_of(given: object) -> Controller:
    """The controller with this transfer function."""
    if isinstance(given, Controller):
        return given
    G = None if isinstance(given, Plant) else transfer_function_of(given)
    if G is None:
        raise TypeError(
            f"controller={given!r}: give a controller, such as P(Kp=1), or a transfer function"
        )
    if len(G.num.delays) == len(G.den.delays) == 1 and not (G.num.delays[0] or G.den.delays[0]):
        num, den = (h.coefficients[0].tolist() for h in (G.num, G.den))  # ascending powers of s
        if len(den) == 1 and len(num) <= 2:
            Kp, Kd = (*num, 0.0)[:2]
            return PD(Kp / den[0], Kd / den[0]) if Kd else P(Kp / den[0])
        if len(den) == 2 and den[0] == 0.0 and len(num) <= 3:
            Ki, Kp, Kd = (value / den[1] for value in (*num, 0.0, 0.0)[:3])
            return PID(Kp, Ki, Kd) if Kd else PI(Kp, Ki)
    raise ValueError(
        f"controller={G!r}: a loop takes P, PI, PD, PID and PV controllers. For another "
        "controller, close the loop with deadtime.feedback(C * G)"
    )
