"""Control loops: random ones, and that of the held integrator."""

from __future__ import annotations

import deadtime as dtm
import numpy as np
from hypothesis import strategies as st

INTEGRATOR = dtm.Integrator()

#: Time between two samples, s.
TS = 0.065


def held_loop(Kp=1.31, delay=0.36, lag=0.0, gain=1.0, sample_time=TS, limit=1.0):
    """An integrator, with or without a lag, under P control with hold and limit."""
    plant = dtm.Integrator(gain, lag)
    return dtm.ControlLoop(plant, dtm.P(Kp), delay=delay, sample_time=sample_time, limit=limit)


plants = st.one_of(
    st.builds(dtm.Integrator, gain=st.floats(0.3, 2.0), lag=st.sampled_from([0.0, 0.1, 0.35])),
    st.builds(dtm.FirstOrder, gain=st.floats(0.3, 2.0), time_constant=st.floats(0.2, 2.0)),
    st.just(dtm.kit_plant()),
)
controllers = st.one_of(
    st.builds(dtm.P, Kp=st.floats(0.2, 2.5)),
    st.builds(
        dtm.PV,
        Kp=st.floats(0.2, 2.5),
        Kv=st.floats(-0.2, 0.4),
        filter=st.sampled_from([None, dtm.DerivativeFilter(20.0, 0.7)]),
    ),
    st.builds(dtm.PI, Kp=st.floats(0.2, 1.5), Ki=st.floats(0.1, 0.6)),
    st.builds(
        dtm.PID,
        Kp=st.floats(0.2, 1.5),
        Ki=st.floats(0.1, 0.6),
        Kd=st.floats(0.0, 0.2),
        filter=st.just(dtm.DerivativeFilter(15.0)),
    ),
)
sample_times = st.sampled_from([None, 0.05, 0.065, 0.2])


NO_LIMIT = st.none()


@st.composite
def loops(draw, limits=NO_LIMIT):
    return dtm.ControlLoop(
        draw(plants),
        draw(controllers),
        delay=draw(st.sampled_from([0.0, 0.065, 0.1, 0.2731, 0.5])),
        sample_time=draw(sample_times),
        limit=draw(limits),
    )


TIMES = np.linspace(0.0, 4.0, 41)
