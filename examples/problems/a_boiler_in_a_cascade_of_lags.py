"""
A boiler: are gains for a dead time safe for many lags?
=======================================================

**Question.** The steam pressure of a boiler follows its burner through four equal lags, without a
dead time. An estimate describes the boiler by a dead time and two poles. Are PI gains for the
estimated plant safe?

**Data.** The first lines of the script simulate a bump test: time (s), burner (%) and pressure
(bar). The boiler has a gain of 1.5 and four lags of 15 s. The noise is 0.1 bar.

**Answer.** Yes. The verdict is *reliable*, and the numbers that a controller needs are right. The
estimated largest stable gain is 2.57 (95 %: 2.47 to 2.68), and that of the true boiler is 2.667.
The dead time of 13.2 s (95 %: 6.9 to 14.0 s) is a property of the estimated plant, because the
boiler has only lags. With Kp = 0.372 and Ki = 0.01119, the true loop has a gain margin of 3.86.

**Next.** Enter the gains in the controller and record a step of the set point. Check the gains with
this record::

    deadtime tune step.csv --kp 0.372 --ki 0.01119
"""

import deadtime as dtm
import matplotlib.pyplot as plt
import numpy as np

s = dtm.s
boiler = 1.5 / (15.0 * s + 1.0) ** 4
time = np.arange(900.0)
burner = np.select([time < 100, time < 400, time < 650], [50.0, 55.0, 48.0], 52.0)
pressure = 70.0 + np.ravel(boiler.simulate(time, burner - 50.0).outputs)
pressure += np.random.default_rng(1).normal(0.0, 0.1, time.size)

fit = dtm.estimate_delay(dtm.Recording(time, None, pressure, burner))
print(fit.summary())
best = dtm.design(fit.loop(dtm.PI(1.0, 0.01)), controller=dtm.PI, delay=fit.ci())
print(best.summary())
true = dtm.ControlLoop(boiler, best.loop.controller, delay=0.0)
print(f"true boiler: gain margin {true.margin().gain_margin:.3g}")
limit = dtm.ControlLoop(boiler, dtm.P(1.0), delay=0.0).stable_range("Kp")[1]
print(f"true boiler: largest stable gain {limit:.4g}")

fig, ax = plt.subplots(layout="constrained")
for label, loop in (("estimated plant", best.loop), ("true boiler", true)):
    response = loop.simulate(np.linspace(0.0, 500.0, 501))
    ax.plot(response.time, response.outputs, label=label)
ax.set(xlabel="time (s)", ylabel="pressure (bar)", title="A step of the set point by 1 bar")
ax.legend()
