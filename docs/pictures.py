"""Make the pictures of these pages: ``python docs/pictures.py``.

The pictures are stored beside the pages, so that building the pages does not run the package.
"""

import shutil
import tempfile
from pathlib import Path

import deadtime as dtm
import matplotlib.pyplot as plt
import numpy as np
from deadtime import paper
from deadtime._base.drawing import new_figure
from deadtime.estimation import Waveform
from deadtime.flights import FlightPlan, FlownVehicle, fly_experiment
from deadtime.flights._plots import plot_checked, plot_learned, plot_telemetry
from deadtime.flights._runs import read_telemetry
from deadtime.internet._loop import run_internet_loop
from deadtime.internet._plots import plot_internet_loop
from deadtime.links import udp, virtual_time
from deadtime.links.ardrone2.emulator import Thruster, ThrustMotion
from scipy.optimize import least_squares

IMAGES = Path(__file__).parent / "images"
NUMBERS = Path(__file__).parent / "paper/reproduction-numbers.md"


def fixed_steps() -> None:
    """A filtered loop at a step of one sample, by six solvers, beside the exact response."""
    filtered = dtm.PV(Kp=2.0, Kv=0.19, filter=dtm.DerivativeFilter(omega=38.0))
    loop = dtm.ControlLoop(
        dtm.Integrator(), filtered, delay=0.36, limit=1.0, delay_path="measurement"
    )
    figure, axes = plt.subplots(figsize=(7.0, 4.0), layout="constrained")
    for solver in ("ode1", "ode2", "ode3", "ode4", "ode5", "ode8"):
        found = dtm.simulate_fixed_step(loop, 4.0, step=0.065, solver=solver)
        axes.plot(found.time, found.outputs, ".-", linewidth=0.8, markersize=3, label=solver)
    exact = loop.simulate(np.linspace(0.0, 4.0, 801))
    axes.plot(exact.time, exact.outputs, "k", linewidth=1.5, label="exact")
    axes.set(xlabel="time (s)", ylabel="height (m)", ylim=(-0.1, 1.4))
    axes.set_title("One loop, steps of 0.065 s, six solvers")
    axes.legend(ncols=2)
    figure.savefig(IMAGES / "fixed-steps.png", dpi=110)


def mackey_glass() -> None:
    """The chaotic attractor of Mackey and Glass, against its own past."""
    found = dtm.solve_dde(
        lambda t, y, z: 0.2 * z[0] / (1 + z[0] ** 10) - 0.1 * y,
        (0.0, 500.0),
        0.5,
        [17.0],
        rtol=1e-9,
        vectorized=True,
        dense_output=True,
    )
    times = np.linspace(150.0, 500.0, 7001)
    now, before = found.sol(times)[0], found.sol(times - 17.0)[0]
    figure, axes = plt.subplots(figsize=(5.0, 4.0), layout="constrained")
    axes.plot(now, before, linewidth=0.8)
    axes.set(xlabel="y(t)", ylabel="y(t - 17 s)")
    figure.savefig(IMAGES / "mackey-glass.png", dpi=100)


def reproduction() -> None:
    """The figures of the reproduced paper, and the table of its numbers."""
    found = paper.reproduce()
    for name, figure in found.figures().items():
        figure.savefig(IMAGES / f"paper-{name}.png", dpi=75)
    lines = [found.summary(), ""]
    for name, part in found.parts.items():
        if part.comparisons:
            lines += [
                f"**{paper.TITLES[name]}**",
                "",
                "| where | what | printed | ours | verdict |",
            ]
            lines += ["|---|---|---|---|---|"]
            lines += [
                f"| {one.where} | {one.quantity} | {one.printed} | {one.shown} | {one.outcome} |"
                for one in part.comparisons
            ]
            lines += [""]
    NUMBERS.write_text("\n".join(lines).replace("<", "&lt;"), encoding="utf-8")


def guess(Kp: float = 1.31) -> dtm.ControlLoop:
    """The loop of the page on planning."""
    plant = dtm.Integrator(gain=1.0, lag=0.06)
    return dtm.ControlLoop(plant, dtm.P(Kp), delay=0.36, sample_time=0.065, limit=1.0)


def planned_step() -> None:
    """The smallest standard errors that a step on the guessed loop can give."""
    plan = dtm.identifiability(guess(), dtm.Experiment.step(5.0), noise=0.01, initial_output=0.0)
    plan.plot()[0].figure.savefig(IMAGES / "planned-step.png", dpi=90)


def hold() -> None:
    """Bounds on the delay and on delay + lag over the hold of the reference."""
    holds = 0.065 * np.array([2, 3, 4, 5, 6, 7, 8, 10, 12, 15, 18, 22, 26, 30])
    figure, axes = plt.subplots(1, 2, figsize=(9.0, 3.8), layout="constrained", sharex=True)

    def errors(experiment: dtm.Experiment) -> list[float]:
        plan = dtm.identifiability(guess(), experiment, noise=0.01, initial_output=0.0)
        return [1e3 * plan.stderr["delay"], 1e3 * plan.stderr["delay+lag"]]

    square = np.array([errors(dtm.Experiment.square(20.0, 0.4, h)) for h in holds])
    binary = np.array(
        [[errors(dtm.Experiment.prbs(20.0, 0.4, h, seed)) for h in holds] for seed in range(8)]
    )
    for ax, i, name in zip(axes, (0, 1), ("delay, lag and gain free", "delay + lag"), strict=True):
        ax.fill_between(
            holds, binary[..., i].min(axis=0), binary[..., i].max(axis=0), color="C0", alpha=0.25
        )
        ax.plot(holds, binary[..., i].mean(axis=0), "C0.-", label="binary sequence, eight seeds")
        ax.plot(holds, square[:, i], "C1.-", label="square wave")
        ax.axvline(0.36, color="0.6", linewidth=0.8, linestyle="--")
        ax.set(xlabel="hold (s)", title=name, ylim=(0.0, None))
        ax.grid(alpha=0.25)
    axes[0].set_ylabel("smallest standard error (ms)")
    axes[0].annotate("delay", (0.37, 0.3), color="0.4")
    axes[1].legend()
    figure.savefig(IMAGES / "hold.png", dpi=90)


def designing() -> None:
    """A design for an interval of the delay, one for its middle alone, and a filter."""
    vehicle = dtm.ControlLoop(
        dtm.Integrator(0.85, 0.1), dtm.P(1.0), delay=0.25, sample_time=0.065, limit=1.0
    )
    smooth = dtm.PV(1.0, 0.1, dtm.DerivativeFilter(38.0))
    interval = (0.2, 0.3)
    best = dtm.design(
        vehicle, controller=smooth, delay=interval, objective="settling_time", gain_margin=3.0
    )
    best.plot().savefig(IMAGES / "designing-plot.png", dpi=80)

    figure, axes = plt.subplots(figsize=(7.0, 4.0), layout="constrained")
    delays = np.linspace(0.15, 0.35, 81)
    middle = dtm.design(vehicle, controller=smooth, objective="abscissa")
    worst = dtm.design(vehicle, controller=smooth, delay=interval, objective="abscissa")
    for found, label in ((middle, "for 0.25 s alone"), (worst, "for 0.2 to 0.3 s")):
        gains = ", ".join(f"{name} {value:.3g}" for name, value in found.gains.items())
        abscissas = [found.loop.replace(delay=late).spectral_abscissa() for late in delays]
        axes.plot(delays, abscissas, linewidth=1.6, label=f"{label}: {gains}")
    axes.axvspan(*interval, color="0.92", zorder=0)
    axes.set(xlabel="delay (s)", ylabel="spectral abscissa (1/s)")
    axes.set_title("The most stable gains, for one delay and for the worst of an interval")
    axes.legend(frameon=False)
    figure.savefig(IMAGES / "designing-interval.png", dpi=100)

    paper = dtm.ControlLoop(dtm.Integrator(), dtm.P(1.0), delay=0.36)
    choice = dtm.design_filter(paper, fixed={"Kp": 2.0})
    choice.plot().savefig(IMAGES / "designing-filter.png", dpi=80)
    for one in (best, middle, worst, choice):
        print(one.summary(), end="\n\n")


def estimating() -> None:
    """Fits with a lag, without a lag, and of three recordings, and a design for the fitted loop."""
    vehicle = dtm.ControlLoop(
        dtm.Integrator(gain=0.9, lag=0.1), dtm.P(1.6), delay=0.3, sample_time=0.065, limit=1.0
    )
    known = dtm.ControlLoop(dtm.Integrator(), dtm.P(1.6), sample_time=0.065, limit=1.0)
    step, free = dtm.Experiment.step(8.0, rest=1.04), ("delay", "gain", "lag")
    flight = step.run(vehicle, noise=0.002, seed=2)
    fit = dtm.estimate_delay(flight, known, free=free)
    fit.plot()[0].figure.savefig(IMAGES / "estimate-lag.png", dpi=80)
    dtm.estimate_delay(flight, known).plot()[0].figure.savefig(
        IMAGES / "estimate-lagless.png", dpi=80
    )

    gains = (0.8, 1.6, 2.4)
    flights = [step.run(vehicle.replace(Kp=Kp), 0.002, seed) for seed, Kp in enumerate(gains)]
    joint = dtm.estimate_delay(flights, [known.replace(Kp=Kp) for Kp in gains], free=free)
    joint.plot()[0].figure.savefig(IMAGES / "estimate-joint.png", dpi=65)

    smooth = dtm.PV(1.0, 0.1, dtm.DerivativeFilter(38.0))
    best = dtm.design(
        fit.loop,
        controller=smooth,
        delay=fit.ci(0.95),
        objective="settling_time",
        gain_margin=2.5,
    )
    figure, axes = plt.subplots(figsize=(7.0, 3.8), layout="constrained")
    time = np.linspace(0.0, 6.0, 601)
    before = vehicle.simulate(time)
    axes.plot(time, before.outputs, color="0.5", label="with the recorded gain: Kp 1.6")
    after = vehicle.replace(controller=best.loop.controller).simulate(time)
    labels = ", ".join(f"{name} {value:.3g}" for name, value in best.gains.items())
    axes.plot(time, after.outputs, "C0", label=f"with the designed gains: {labels}")
    axes.axhline(1.0, color="0.6", linewidth=0.8, linestyle="--")
    axes.set(xlabel="time (s)", ylabel="height (m)")
    axes.legend(frameon=False)
    figure.savefig(IMAGES / "estimate-design.png", dpi=90)


def flying() -> None:
    """The experiment of `deadtime fly`, on the emulator in virtual time."""
    with tempfile.TemporaryDirectory() as folder:
        connect = FlownVehicle.emulated().connect
        found = fly_experiment(connect, FlightPlan(), Path(folder), run=virtual_time.run)
        figure, axes = new_figure(7.5, 4.6, rows=2)
        plot_checked(axes, [found.before, *found.checked])
        figure.savefig(IMAGES / "flying-before-after.png", dpi=90)
        figure, axes = new_figure(7.5, 4.4, rows=2, even=True)
        plot_learned(axes, found.learned.flights, found.learned.fit)
        figure.savefig(IMAGES / "flying-learned.png", dpi=90)
        told = read_telemetry(found.before)
        figure, axes = new_figure(7.5, 4.2, rows=2)
        plot_telemetry(axes, told, found.before)
        figure.savefig(IMAGES / "flying-telemetry.png", dpi=90)
    print(found.headline())


def internet_loop() -> None:
    """The Internet loop on a network with jitter and losses, and the effect of the policies."""
    bad = udp.Network(delay=udp.Normal(0.05, 0.01), loss=udp.Bursts.of(0.05, 4.0))
    jitters = udp.Network(delay=udp.Normal(0.05, 0.01), loss=0.05)
    found = run_internet_loop(udp.Trial(gain=8.0, forward_path=jitters, return_path=jitters))
    printed = {
        float(gain): paper.delay_by_dominant_root(gain, percent / 100.0)
        for gain, percent in paper.PRINTED_OVERSHOOTS.items()
    }
    figure, axes = new_figure(10.0, 4.2, columns=2)
    plot_internet_loop(found, printed, axes)
    figure.savefig(IMAGES / "internet-loop.png", dpi=90)

    policies = {
        "newest wins": udp.NewestWins(),
        "hold 5, then zero": udp.HoldThenZero(5),
        "jitter buffer of 140 ms": udp.JitterBuffer(0.14),
    }
    figure, axes = plt.subplots(
        1, 3, sharey=True, sharex=True, figsize=(10.0, 3.4), layout="constrained"
    )
    for ax, (name, policy) in zip(axes, policies.items(), strict=True):
        for seed in range(40):
            trial = udp.Trial(
                gain=6.0, forward_path=bad, return_path=bad, seed=seed, policy=policy, duration=4.0
            )
            recording = virtual_time.run(udp.run_trial(trial)).plant.recording
            ax.plot(recording.time - 1.0, recording.output, "C0", alpha=0.25, linewidth=0.8)
        ax.plot(recording.time - 1.0, recording.reference, "k--", linewidth=0.8)
        ax.set(xlabel="time (s)", title=name, xlim=(-0.2, 3.0))
        ax.grid(alpha=0.25)
    axes[0].set(ylabel="output")
    figure.savefig(IMAGES / "internet-policies.png", dpi=90)


TS = 0.065


def thrust_step(gain: float, step: float, noise: float = 0.0) -> dtm.Recording:
    """A step of the height of the rotor model under P control, with a delay of four samples."""
    motion, random = ThrustMotion(Thruster()), np.random.default_rng(1)
    motion.settle(0, 0.0)
    heights, commands = [], []
    reference = np.where(np.arange(160) >= 16, step, 0.0)
    for k, height in enumerate(reference):
        now = k * 65_000
        if k >= 4:
            motion.follow(now, commands[k - 4])
        heights.append(motion.at(now)[0] + noise * random.standard_normal())
        commands.append(float(np.clip(gain * (height - heights[-1]), -2.0, 2.0)))
    return dtm.Recording(np.arange(160) * TS, reference, heights, commands)


def first_order_climb(amplitude: float, time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The climb after a step of its setpoint, divided by the step, and the fitted lag and delay."""
    motion = ThrustMotion(Thruster())
    motion.settle(0, 0.0)
    motion.follow(0, amplitude)
    climb = np.array([motion.at(round(1e6 * t))[1] for t in time]) / amplitude

    def error(parameters: np.ndarray) -> np.ndarray:
        lag, delay = parameters
        return -np.expm1(-np.maximum(time - delay, 0.0) / lag) - climb

    return climb, least_squares(error, [0.12, 0.04]).x


def thrust() -> None:
    """Climb and height of the thrust model, beside first-order fits to them."""
    figure, axes = plt.subplots(1, 3, figsize=(12.5, 3.8), layout="constrained")
    time = np.arange(0.0, 0.8, 0.002)
    print("setpoint (m/s)  lag (s)  delay (s)  lag + delay (s)")
    for amplitude in (0.1, 1.0, -1.0, 2.0, -2.0):
        climb, (lag, delay) = first_order_climb(amplitude, time)
        print(f"{amplitude:4.1f}  {lag:.3f}  {delay:.3f}  {lag + delay:.3f}")
        axes[0].plot(time, climb, linewidth=1.2, label=f"setpoint {amplitude:+.1f} m/s")
        if amplitude == 0.1:
            first = -np.expm1(-np.maximum(time - delay, 0.0) / lag)
    axes[0].plot(time, first, "k--", linewidth=1.0, label="delay and first-order lag")
    axes[0].set(xlabel="time (s)", ylabel="climb / setpoint", title="A step of the commanded climb")
    axes[0].legend(frameon=False)

    thruster, gain = Thruster(), 2.0
    c = thruster.speed_gain
    exact = dtm.RationalPlant([c], [thruster.motor_lag, 1.0, c, 0.0])
    lag, more = first_order_climb(0.1, time)[1]
    print("transport delay (s)  largest gain  by first order")
    for transport in (0.0, 0.02, 0.05, 0.1, 0.26):
        loops = (
            dtm.ControlLoop(exact, dtm.P(1.0), delay=transport),
            dtm.ControlLoop(dtm.Integrator(1.0, lag), dtm.P(1.0), delay=transport + more),
        )
        largest, by_first_order = (loop.margin().gain_margin for loop in loops)
        print(f"{transport}  {largest:.2f}  {by_first_order:.2f}")
    loop = dtm.ControlLoop(exact, dtm.P(gain), delay=0.26, sample_time=TS)
    known = dtm.ControlLoop(dtm.Integrator(), dtm.P(gain), sample_time=TS, limit=2.0)
    print("step (m)  overshoot (%)  of the fit  delay  lag  sum  gain  gain margin  delay margin")
    margin = loop.margin()
    overshoot = loop.simulate(np.arange(160) * TS).info()["overshoot"]
    print(
        f"linear: {overshoot:.1f} %, margins {margin.gain_margin:.3f}, {margin.delay_margin:.3f} s"
    )
    for number, step in enumerate((0.1, 0.4, 0.8, 1.6)):
        clean, noisy = (thrust_step(gain, step, noise) for noise in (0.0, 0.002))
        fit = dtm.estimate_delay(
            noisy, known, free=("delay", "gain", "lag"), method=Waveform(initial_output=0.0)
        )
        margin = fit.loop.replace(limit=None).margin()
        fitted = fit.loop.simulate(np.arange(144) * TS, step).outputs
        print(
            f"{step}  {100 * (np.max(clean.output) / step - 1):.1f}  "
            f"{100 * (np.max(fitted) / step - 1):.1f}  {fit.delay:.3f}  {fit.lag:.3f}  "
            f"{fit.delay + fit.lag:.3f}  {fit.gain:.3f}  {margin.gain_margin:.3f}  "
            f"{margin.delay_margin:.3f}  {fit.verdict}"
        )
        late = clean.time[16:] - clean.time[16]
        color, height = f"C{number}", clean.output[16:]
        axes[1].plot(late, height / step, color, linewidth=1.4, label=f"step {step} m")
        axes[2].plot(late, 100 * (fitted - height) / step, color, linewidth=1.2)
    axes[1].set(xlabel="time (s)", ylabel="height / step", title="Height: Kp 2, limit 2 m/s")
    axes[1].legend(frameon=False)
    axes[2].set(
        xlabel="time (s)", ylabel="percent of the step", title="First-order fit minus height"
    )
    figure.savefig(IMAGES / "thrust.png", dpi=90)


def latency() -> None:
    """What a log of a take-off shows: the time of each loop of two axes, and one of the fits.

    The log is that of a simulated PX4, `px4_sitl_takeoff.ulg`, beside the project.
    """
    log = Path(__file__).resolve().parents[2] / "shared/data/flights/px4_sitl_takeoff.ulg"
    if not log.exists():
        print(f"latency: there is no {log.name} beside the project, the pictures stay as they are")
        return
    found = dtm.latency(log, axes=("roll", "pitch"))
    found.plot().savefig(IMAGES / "latency-loops.png", dpi=90)
    fit = found.loop("roll").estimate
    above, _ = fit.plot()
    above.set(title="Roll in a take-off, and the fit", ylabel="roll / rad")
    above.figure.savefig(IMAGES / "latency-roll.png", dpi=90)


def rows_of_logs() -> None:
    """Roll in two logs, one with rows as close as its delay and one with rows further apart."""
    flights = Path(__file__).resolve().parents[2] / "shared/data/flights"
    names = ("px4_sitl_takeoff.ulg", "arducopter_2014-10-18_21-19-07.bin")
    if not all((flights / name).exists() for name in names):
        print(f"rows of logs: {' or '.join(names)} is not beside the project")
        return
    figure, axes = plt.subplots(2, 1, figsize=(8.0, 5.5), layout="constrained")
    for ax, name in zip(axes, names, strict=True):
        log = dtm.open_log(flights / name)
        loop = log.loop("roll")
        answer = dtm.latency(log, loops=("roll",)).loop("roll")
        middle = 0.5 * sum(answer.windows[0][:2])
        for signal, label, style in (
            (loop.setpoint, "setpoint", {"drawstyle": "steps-post", "color": "0.5"}),
            (loop.response, "response", {"color": "C0"}),
        ):
            near = np.abs(signal.time - middle) < 2.0
            values = np.degrees(signal.values[near])
            ax.plot(signal.time[near], values, ".-", linewidth=1.0, label=label, **style)
        rows = f"a row each {1e3 * loop.response.period:.0f} ms"
        ax.set(title=f"{log.vehicle}: {rows}", xlabel="time / s", ylabel="roll / °")
        ax.grid(alpha=0.3)
    axes[0].legend()
    figure.savefig(IMAGES / "rows-of-logs.png", dpi=90)


def explorer() -> None:
    """The explorer with the gains of a sampled PV loop, in a browser."""
    chromium = shutil.which("chromium")
    if chromium is None:
        print("explorer: there is no chromium on this machine")
        return
    from playwright.sync_api import sync_playwright

    loop = dtm.ControlLoop(
        dtm.Integrator(0.9), dtm.PV(1.5, 0.1), delay=0.36, sample_time=0.065, limit=1.0
    )
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as run:
        page = loop.explore({"Kp": (0, 6), "Kv": (-0.9, 0.9)}).save(Path(folder) / "loop.html")
        browser = run.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        tab = browser.new_page(viewport={"width": 1440, "height": 900})
        tab.goto(page.as_uri())
        tab.wait_for_selector("body[data-ready=yes]")
        tab.screenshot(path=IMAGES / "explorer.png")
        browser.close()


if __name__ == "__main__":
    explorer()
    latency()
    rows_of_logs()
    flying()
    thrust()
    designing()
    estimating()
    fixed_steps()
    mackey_glass()
    reproduction()
    planned_step()
    hold()
    internet_loop()
