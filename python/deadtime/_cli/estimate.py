"""``deadtime estimate``: the plant of a recording, or the delay of a loop in one or several."""

from __future__ import annotations

from deadtime._cli import estimate_options as own, options as opt
from deadtime._cli.estimate_loop import NamedLoop, estimate_loop
from deadtime._cli.estimate_plant import Asked, estimate_plant, is_answered
from deadtime._cli.windows import files_and_windows


def command(
    files: own.Files,
    kp: own.Kp = None,
    kv: own.Kv = None,
    ki: own.Ki = None,
    kd: own.Kd = None,
    filter: opt.Filter = None,  # noqa: A002
    time: opt.Time = None,
    reference: opt.Reference = None,
    output: opt.Output = None,
    command: opt.Command = None,
    sample_time: opt.Sample_time = None,
    limit: opt.Limit = None,
    plant: own.Plant = None,
    gain: opt.Gain = 1.0,
    window: opt.Window = None,
    method: own.Method = None,
    free: own.Free = None,
    map: own.Map = None,  # noqa: A002
    noise: own.Noise_path = None,
    initial_output: own.Initial_output = None,
    at_rest: own.At_rest = None,
    closed_loop: own.Closed_loop = None,
    largest_delay: own.Largest_delay = None,
    check: own.Check = False,
    plot: opt.Plot = None,
    as_json: opt.As_json = False,
) -> None:
    """Find the plant from a recording, or the delay of a known loop, with a verdict.

    Exit codes: 0 for an estimate, reliable or an indication; 3 for no estimate; 1 for an error.
    """
    files, windows = files_and_windows(files, window)
    columns = {"time": time, "reference": reference, "output": output, "command": command}
    gains = {"kp": kp, "kv": kv, "ki": ki, "kd": kd}
    options = {"map": map, "noise": noise, "initial_output": initial_output}
    loop = NamedLoop(
        files, windows, columns, gains, filter, sample_time, limit, plant, gain, method, free,
        {name: value for name, value in options.items() if value is not None}, check, plot,
    )  # fmt: skip
    known = {"at_rest": at_rest, "closed_loop": closed_loop, "largest_delay": largest_delay}
    if is_answered(loop):
        asked = Asked(files, columns, windows, {**known, "plant": plant}, plot, loop)
        estimate_plant(asked, as_json)
        return
    for name, value in known.items():
        if value is not None:
            option = name.replace("_", "-")
            raise ValueError(
                f"--{option} applies only if the plant is chosen from the recording: leave out "
                f"--{option}, or leave out {', '.join(loop.named)}"
            )
    estimate_loop(loop, as_json)
