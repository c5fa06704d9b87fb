// The loop of a recording: what the page takes from its rows and from the plant that was fitted to them.

// Decades of gains in which the largest stable one is sought.
const DECADES = 9;

// Rows of the commands at one end after which that end is a limit.
const AT_LIMIT = 3;

function middleOf(numbers) {
  return [...numbers].sort((one, two) => one - two)[numbers.length >> 1];
}

// The time between rows where the clock is even; 0 for another one.
function periodOf({ time }) {
  const steps = time.slice(1).map((t, i) => t - time[i]);
  const period = middleOf(steps);
  const even = steps.filter((step) => Math.abs(step - period) < 0.2 * period).length;
  return even > 0.9 * steps.length ? Number(period.toPrecision(6)) : 0;
}

// The gain and the limits of a P controller, where the commands are those of one.
function proportional(rows, commands) {
  const errors = rows.reference.map((reference, i) => reference - rows.output[i]);
  const [least, most] = [Math.min(...commands), Math.max(...commands)];
  const at = (end) => commands.filter((u) => Math.abs(u - end) <= 1e-6 * (most - least)).length;
  const within = commands.map((u, i) => [u, errors[i]]).filter(([u]) => u > least && u < most);
  const sum = (of) => within.reduce((total, [u, e]) => total + of(u, e), 0);
  const Kp = sum((u, e) => u * e) / sum((u, e) => e * e);
  const off = sum((u, e) => (u - Kp * e) ** 2) / sum((u) => u * u);
  if (!(within.length > 10 && off < 1e-4)) return null;
  const [isLow, isHigh] = [at(least) >= AT_LIMIT && least < 0, at(most) >= AT_LIMIT && most > 0];
  const limit = isHigh ? most : isLow ? -least : 0;
  const low = isLow && isHigh && Math.abs(least + most) > 1e-6 * most ? least : null;
  return { controller: "P", Kp: Number(Kp.toPrecision(6)), limit, low };
}

// The largest stable gain of this plant under P control without hold, and its frequency in rad/s.
function ultimate(loop, kernels) {
  for (let decade = DECADES - 4; decade > -5; decade--) {
    const Kp = 10 ** decade / loop.gain;
    try {
      const found = kernels.margins({ ...loop, controller: "P", Kp, sample_time: 0 });
      if (!found.stable) continue;
      return isFinite(found.gain) ? { Kp: Kp * found.gain, omega: found.omega } : null;
    } catch {
      // The margins of this gain are not known: those of a smaller one may be.
    }
  }
  return null;
}

// The ends of the sliders for this loop, whose commands are up to `most`.
function rangesOf(loop, most, edge) {
  const time = ownTime(loop);
  const ends = (number, low, high) => (number > 0 ? [low * number, high * number] : [high * number, low * number]);
  const ranges = {
    delay: [0, 3 * loop.delay || time],
    sample_time: [0, Math.max(4 * loop.sample_time, loop.delay)],
    gain: ends(loop.gain, 0.1, 3),
    lag: [0, 3 * time],
    limit: [0, 2 * Math.max(most, loop.limit)],
    low: [-2 * most, 2 * most],
    tracking_time: [0.1 * time, 10 * time],
    height: [0, 2 * loop.height],
    load: [-most, most],
  };
  if (edge) {
    const { Kp, omega } = edge;
    Object.assign(ranges, {
      Kp: ends(Kp, 0, 1.2),
      Ki: ends(Kp * omega, 0, 0.3),
      Kd: ends(Kp / omega, -0.5, 1),
      Kv: ends(Kp / omega, -0.5, 1),
      omega: [omega, 50 * omega],
    });
  }
  for (const ends of Object.values(ranges)) ends.forEach((end, i) => (ends[i] = Number(end.toPrecision(3))));
  return ranges;
}

function ownTime({ delay, lag, sample_time }) {
  return delay + lag || sample_time || 1;
}

// The ranges of a loop that the page is opened with.
function usualRanges(loop, kernels) {
  const most = loop.limit || Math.abs(loop.Kp) * loop.height || 1;
  return rangesOf(loop, most, ultimate(loop, kernels));
}

// Numbers of the page for a plant that was fitted: itself, ranges around it, and gains to begin with.
function loopOf(loop, found, rows, commands, kernels) {
  const { delay, gain, lag } = found;
  const size = Math.max(...rows.reference) - Math.min(...rows.reference);
  const most = Math.max(...commands.map(Math.abs));
  const made = {
    ...loop,
    delay: delay.value,
    gain: gain.value,
    lag: lag.value,
    sample_time: periodOf(rows),
    limit: loop.limit >= most ? loop.limit : 0,
    interval: [delay.low, delay.high],
    height: size || loop.height,
    load: Number((0.2 * most).toPrecision(2)),
  };
  const edge = ultimate(made, kernels);
  if (edge && rows.command) {
    // Those of Skogestad's rules for an integrator, where the file does not show its own.
    const { Kp, omega } = edge;
    const begun = { Kp: Kp / 3, Ki: (Kp * omega) / 36, omega: 10 * omega, tracking_time: ownTime(made) };
    for (const [name, value] of Object.entries(begun)) made[name] = Number(value.toPrecision(3));
    Object.assign(made, { Kd: 0, Kv: 0 }, proportional(rows, commands));
  }
  return { ...made, ranges: rangesOf(made, most, edge), x_range: null, y_range: null };
}
