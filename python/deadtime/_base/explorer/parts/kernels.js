// The kernels: one loop in, its map, roots, margins and responses out. See rust/web.

const NUMBERS = ["Kp", "Ki", "Kd", "gain", "lag", "delay", "sample_time"];

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

async function loadKernels(base64) {
  const { instance } = await WebAssembly.instantiate(await unpacked(base64), {});
  const native = instance.exports;

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
    // Counts of unstable roots, negative where not proved, and abscissas where asked for.
    map(loop, axes, { decay = 0, abscissa = false } = {}) {
      const request = [...encoded(loop), ...axes.flatMap(axis), decay, abscissa ? 1 : 0];
      const answer = call("map", request);
      const cells = axes[0].points.length * axes[1].points.length;
      return { counts: answer.subarray(0, cells), abscissa: answer.subarray(cells) };
    },
    // Curves of [x, y, rad/s].
    boundaries(loop, axes, decay = 0) {
      const answer = call("boundaries", [...encoded(loop), ...axes.flatMap(axis), decay]);
      const curves = [];
      for (let i = 0; i < answer.length; ) {
        const count = answer[i++];
        curves.push(Array.from({ length: count }, (_, j) => answer.slice(i + 3 * j, i + 3 * j + 3)));
        i += 3 * count;
      }
      return curves;
    },
    rightmost(loop, many) {
      const answer = call("rightmost", [...encoded(loop), many]);
      const roots = [];
      for (let i = 2; i < answer.length; i += 4) {
        roots.push({ re: answer[i], im: answer[i + 1], multiplicity: answer[i + 2] });
      }
      return { abscissa: answer[0], chains: answer[1], roots };
    },
    margins(loop) {
      const [stable, gain, reduction, phase, delay] = call("margins", encoded(loop));
      return { stable: stable === 1, gain, reduction, phase, delay };
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
    step(loop, time, { height = 1, load = false } = {}) {
      const measured = loop.delay_path === "measurement" ? 1 : 0;
      const request = [...encoded(loop), load ? 1 : 0, height, measured, time.length, ...time];
      const answer = call("step", request);
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
    loop.limit > 0 ? loop.limit : Infinity,
    loop.num.length,
    ...loop.num,
    loop.den.length,
    ...loop.den,
  ];
}

// The same loop without hold and limit.
function continuous(loop) {
  return { ...loop, sample_time: 0, limit: 0 };
}

function linspace(low, high, count) {
  const step = (high - low) / (count - 1);
  return Array.from({ length: count }, (_, i) => (i === count - 1 ? high : low + step * i));
}
