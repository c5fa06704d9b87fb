"""The best PI of a process of first order with a dead time, by brute force in NumPy alone.

Gains on a grid; the largest sensitivity on a grid of frequencies; responses by exact steps of the
process with the command held over a short step.
"""

import numpy as np

#: Time between steps, s, as a share of the dead time.
STEP = 1.0 / 120.0


class Process:
    """gain exp(-delay s)/(lag s + 1)."""

    def __init__(self, gain, lag, delay):
        self.gain, self.lag, self.delay = gain, lag, delay

    def sensitivity(self, kp, ki):
        """Ms of each pair of gains; they are stable where it is that of a stable loop."""
        omega = np.geomspace(0.01, 30.0, 700) / self.delay
        s = 1j * omega
        plant = self.gain * np.exp(-s * self.delay) / (self.lag * s + 1.0)
        loop = plant * (np.asarray(kp)[..., None] + np.asarray(ki)[..., None] / s)
        return np.max(1.0 / np.abs(1.0 + loop), axis=-1)

    def responses(self, kp, ki, duration, load):
        """Output of each pair of gains after a unit step of the set point or a unit load."""
        kp, ki = np.asarray(kp, float), np.asarray(ki, float)
        step = STEP * self.delay
        late, count = round(self.delay / step), round(duration / step)
        decay = np.exp(-step / self.lag)
        sent = np.zeros((late, *kp.shape))
        x, integral = np.zeros(kp.shape), np.zeros(kp.shape)
        outputs = np.empty((count, *kp.shape))
        for k in range(count):
            outputs[k] = x
            error = (0.0 if load else 1.0) - x
            command = kp * error + integral + (1.0 if load else 0.0)
            integral += ki * step * error
            arrived = sent[k % late].copy()
            sent[k % late] = command
            x = decay * x + (1.0 - decay) * self.gain * arrived
        return step * np.arange(count), outputs

    def settling(self, kp, ki, duration):
        """2 % settling time of a step of the set point; infinite where it has not settled."""
        time, outputs = self.responses(kp, ki, duration, load=False)
        outside = np.abs(outputs - 1.0) > 0.02
        last = time.size - 1 - np.argmax(outside[::-1], axis=0)
        found = np.where(last < time.size - 1, time[np.minimum(last + 1, time.size - 1)], np.inf)
        return np.where(np.all(np.abs(outputs[-1:]) < 10.0, axis=0), found, np.inf)

    def stable_grid(self, points):
        """Gains on a grid, up to the largest stable ones."""
        most = 1.2 * self.lag / (self.gain * self.delay) + 0.6 / self.gain
        kp = np.linspace(0.02, 1.0, points) * most
        ki = np.linspace(0.01, 1.0, points) * most / (2.5 * self.delay)
        return (one.ravel() for one in np.meshgrid(kp, ki))

    def best_load_ie(self, most, points=48):
        """Least 1/Ki, the integral of the error after a unit load, with Ms of at most `most`."""
        kp, ki = self.stable_grid(points)
        fits = self.sensitivity(kp, ki) <= most
        largest = np.argsort(ki[fits])[::-1][:40]
        kp, ki = kp[fits][largest], ki[fits][largest]
        # Loops with a small Ms that are not stable are found by their responses.
        stable = np.isfinite(self.settling(kp, ki, 40.0 * self.delay))
        return 1.0 / ki[stable].max()

    def best_settling(self, most, points=48):
        """Least settling time with Ms of at most `most`."""
        kp, ki = self.stable_grid(points)
        fits = self.sensitivity(kp, ki) <= most
        return float(self.settling(kp[fits], ki[fits], 40.0 * self.delay).min())
