// The kernels: one loop in, its map, roots, margins and responses out. See rust/web. The page runs this
// file, and so does the worker that fits and designs.

const NUMBERS = ["Kp", "Ki", "Kd", "gain", "lag", "delay", "sample_time"];

// Largest Ms of a design, and the part of the best response to a load that an earlier end of a step may
// cost: those of deadtime.design.
const [MOST_SENSITIVITY, SLACK] = [1.6, 0.1];

const CONTROLLERS = {
  P: { integrates: 0, differentiates: 0, of_error: 0, gains: ["Kp"] },
  PI: { integrates: 1, differentiates: 0, of_error: 0, gains: ["Kp", "Ki"] },
  PD: { integrates: 0, differentiates: 1, of_error: 1, gains: ["Kp", "Kd"] },
  PV: { integrates: 0, differentiates: 1, of_error: 0, gains: ["Kp", "Kv"] },
  PID: { integrates: 1, differentiates: 1, of_error: 1, gains: ["Kp", "Ki", "Kd"] },
};

const CELL_STATES = ["proved", "boundary", "chain", "infinitely many", "undecided"];

async function unpacked(base64) {
  const packed = Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Response(stream).arrayBuffer();
}

async function compiled(base64) {
  return WebAssembly.compile(await unpacked(base64));
}

async function kernelsOf(module) {
  const native = (await WebAssembly.instantiate(module, {})).exports;

  // Send a request; throws an Error with the reason of the kernel.
  function call(name, request) {
    const place = native.reserve(request.length);
    new Float64Array(native.memory.buffer, place, request.length).set(request);
    if (!native[name]()) {
      const text = new Uint8Array(native.memory.buffer, native.message(), native.message_count());
      throw new Error(new TextDecoder().decode(text));
    }
    return new Float64Array(native.memory.buffer, native.answer(), native.answer_count()).slice();
  }

  const axis = ({ name, points }) => [NUMBERS.indexOf(kernelName(name)), points.length, ...points];

  return {
    // Counts of unstable roots, negative where not proved.
    map(loop, axes) {
      return call("map", [...encoded(linear(loop)), ...axes.flatMap(axis)]);
    },
    // Curves of [x, y, rad/s].
    boundaries(loop, axes) {
      const answer = call("boundaries", [...encoded(linear(loop)), ...axes.flatMap(axis)]);
      const curves = [];
      for (let i = 0; i < answer.length; ) {
        const count = answer[i++];
        curves.push(Array.from({ length: count }, (_, j) => answer.slice(i + 3 * j, i + 3 * j + 3)));
        i += 3 * count;
      }
      return curves;
    },
    rightmost(loop, many) {
      const answer = call("rightmost", [...encoded(linear(loop)), many]);
      const roots = [];
      for (let i = 2; i < answer.length; i += 2) roots.push({ re: answer[i], im: answer[i + 1] });
      return { abscissa: answer[0], chains: answer[1], roots };
    },
    margins(loop) {
      const [stable, gain, reduction, phase, delay, omega] = call("margins", encoded(linear(loop)));
      return { stable: stable === 1, gain, reduction, phase, delay, omega };
    },
    // The gains with the best response to a load, at the worst of the interval of the delay, and the
    // weight of the reference where it is chosen.
    design(loop) {
      const { gains: names, integrates } = CONTROLLERS[loop.controller];
      const delays = [loop.delay, ...(loop.interval ?? [])];
      const wanted = [delays.length, ...delays, MOST_SENSITIVITY, integrates ? SLACK : 0];
      const request = [...encoded(linear(loop)), ...wanted];
      const [sensitivity, load, weight, ...gains] = call("design", request);
      const found = Object.fromEntries(names.map((name, i) => [name, gains[i]]));
      if (Number.isFinite(weight)) found.weight = weight;
      return { gains: found, sensitivity, load };
    },
    // Delay, lag, their sum and gain of a recording under these commands, each with its interval.
    estimate(loop, rows, commands, hasLag) {
      const list = (numbers) => [numbers.length, ...numbers];
      const lag = hasLag || loop.plant === "first_order" ? 1 : 0;
      const request = [...list(loop.num), ...list(loop.den), lag];
      for (const numbers of [rows.time, rows.output, rows.time, commands]) request.push(...list(numbers));
      const answer = call("estimate", request);
      const part = (i) => ({ value: answer[3 * i], low: answer[3 * i + 1], high: answer[3 * i + 2] });
      const [noise, air, trim, white, further, reliable] = answer.subarray(12, 18);
      return {
        delay: part(0),
        lag: part(1),
        sum: part(2),
        gain: part(3),
        noise,
        air: air === 1,
        trim: trim === 1,
        white,
        further,
        reliable: reliable === 1,
        fitted: answer.subarray(18),
      };
    },
    // The response to a step of the reference at zero, and to one of the load at a later time.
    step(loop, time, late) {
      const measured = loop.delay_path === "measurement" ? 1 : 0;
      const steps = [loop.height, loop.load, late];
      const answer = call("step", [...encoded(loop), ...steps, measured, time.length, ...time]);
      return { outputs: answer.subarray(0, time.length), commands: answer.subarray(time.length) };
    },
  };
}

// The kernels know one gain of the derivative, whatever its name.
function kernelName(name) {
  return name === "Kv" ? "Kd" : name;
}

function encoded(loop) {
  const kind = CONTROLLERS[loop.controller];
  const filtered = kind.differentiates && loop.filter;
  const gain = (name) => (kind.gains.includes(name) ? loop[name] : 0);
  return [
    kind.integrates,
    kind.differentiates,
    kind.of_error,
    filtered ? loop.omega : 0,
    filtered ? loop.damping : 1,
    loop.Kp,
    gain("Ki"),
    kind.gains.includes("Kv") ? loop.Kv : gain("Kd"),
    loop.gain,
    loop.lag,
    loop.delay,
    loop.sample_time,
    kind.integrates ? loop.weight : 1,
    loop.limit > 0 ? loop.limit : Infinity,
    loop.limit > 0 ? (loop.low ?? -loop.limit) : -Infinity,
    { none: 0, stops: Infinity, tracking: loop.tracking_time }[loop.guard],
    loop.num.length,
    ...loop.num,
    loop.den.length,
    ...loop.den,
  ];
}

// The same loop without limits and what belongs to them, and without weight.
function linear(loop) {
  return { ...loop, limit: 0, guard: "none", weight: 1 };
}

// The same loop without hold and limits.
function continuous(loop) {
  return { ...loop, sample_time: 0, limit: 0, guard: "none" };
}

function linspace(low, high, count) {
  const step = (high - low) / (count - 1);
  return Array.from({ length: count }, (_, i) => (i === count - 1 ? high : low + step * i));
}

// In a worker: the first message brings the module, each one what is to be called.
if (typeof document === "undefined") {
  let kernels = null;
  onmessage = async ({ data: { module, name, given } }) => {
    try {
      kernels ??= await kernelsOf(module);
      postMessage({ found: kernels[name](...given) });
    } catch (error) {
      postMessage({ reason: error.message });
    }
  };
}
