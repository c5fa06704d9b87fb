// What the page shows: numbers of the loop, axes of the map, the interval of the delay.

// Numbers with a slider: label, unit, ends of the slider, and what the value 0 says.
const SLIDERS = {
  delay: { label: "Delay", unit: "s", low: 0, high: 1 },
  sample_time: { label: "Sample time", unit: "s", low: 0, high: 0.2, zero: "continuous" },
  gain: { label: "Gain of the plant", unit: "", low: 0.1, high: 3 },
  lag: { label: "Lag", unit: "s", low: 0, high: 1 },
  limit: { label: "Limit of the command", unit: "", low: 0, high: 5, zero: "none" },
  low: { label: "Least command", unit: "", low: -5, high: 5 },
  Kp: { label: "Kp", unit: "", low: 0, high: 6 },
  Ki: { label: "Ki", unit: "", low: 0, high: 3 },
  Kd: { label: "Kd", unit: "", low: -1, high: 1 },
  Kv: { label: "Kv", unit: "", low: -1, high: 1 },
  omega: { label: "Filter corner", unit: "rad/s", low: 1, high: 100 },
  damping: { label: "Filter damping", unit: "", low: 0.2, high: 2 },
  weight: { label: "Weight of the reference", unit: "", low: 0, high: 1 },
  tracking_time: { label: "Tracking time", unit: "s", low: 0.05, high: 5 },
  height: { label: "Step of the reference", unit: "", low: 0, high: 5 },
  load: { label: "Load at the plant's input", unit: "", low: -1, high: 1, zero: "none" },
};

// What keeps the integral from winding up at a limit.
const GUARDS = { none: "none", stops: "the integral stops", tracking: "back-calculation" };

const PLANTS = {
  integrator: { label: "Integrator with a lag", num: [1], den: [1, 0] },
  first_order: { label: "First order", num: [1], den: [1] },
  rational: { label: "Polynomials num/den", num: [1], den: [1, 0] },
};

const DEFAULTS = {
  plant: "integrator",
  controller: "PV",
  num: [1],
  den: [1, 0],
  delay: 0.36,
  sample_time: 0,
  gain: 1,
  lag: 0,
  limit: 1,
  low: null,
  Kp: 1.5,
  Ki: 0.3,
  Kd: 0.1,
  Kv: 0.13,
  filter: false,
  omega: 20,
  damping: 1,
  weight: 1,
  guard: "none",
  tracking_time: 1,
  delay_path: "command",
  height: 1,
  load: 0.2,
  x: "Kp",
  y: "Kv",
  x_range: [0, 6],
  y_range: [-1, 1],
  interval: null,
  ranges: {},
};

// Numbers of this loop that may be an axis of the map, gains of the controller first.
function axisNames(state) {
  return [...CONTROLLERS[state.controller].gains, "delay", "gain", "lag"].filter(
    (name) => name !== "lag" || hasLag(state),
  );
}

function hasLag(state) {
  return state.plant !== "rational";
}

// Is there an integral that may wind up at a limit?
function isGuarded(state) {
  return CONTROLLERS[state.controller].integrates === 1 && state.limit > 0;
}

// The plant of a state as polynomials, its lag in the denominator.
function asPolynomials({ num, den, lag }) {
  const parts = den.map((c, i) => lag * c + (den[i - 1] ?? 0));
  return { plant: "rational", num, den: lag > 0 ? [...parts, den.at(-1)] : den };
}

// Numbers with a slider for this loop.
function sliderNames(state) {
  const kind = CONTROLLERS[state.controller];
  const names = ["delay", "sample_time", "gain"];
  if (hasLag(state)) names.push("lag");
  names.push(...kind.gains);
  if (kind.differentiates && state.filter) names.push("omega", "damping");
  if (kind.integrates) names.push("weight");
  names.push("limit");
  if (state.limit > 0 && state.low !== null) names.push("low");
  if (isGuarded(state) && state.guard === "tracking") names.push("tracking_time");
  return [...names, "height", "load"];
}

function completed(given) {
  const state = { ...DEFAULTS, ...given };
  if (!(state.controller in CONTROLLERS)) state.controller = DEFAULTS.controller;
  if (!(state.plant in PLANTS)) state.plant = DEFAULTS.plant;
  if (!(state.guard in GUARDS)) state.guard = DEFAULTS.guard;
  if (state.plant !== "rational") {
    state.num = PLANTS[state.plant].num;
    state.den = PLANTS[state.plant].den;
  }
  if (state.plant === "rational") state.lag = 0;
  if (state.plant === "first_order" && !(state.lag > 0)) state.lag = 0.5;
  const names = axisNames(state);
  if (!names.includes(state.x)) [state.x, state.x_range] = [names[0], null];
  if (!names.includes(state.y) || state.y === state.x) {
    state.y = names.find((name) => name !== state.x);
    state.y_range = null;
  }
  // Along the rows of a sampled map a gain varies.
  if (state.sample_time > 0 && !isGain(state.x) && !isGain(state.y)) {
    [state.x, state.x_range] = [names[0], null];
  }
  state.x_range ??= rangeOf(state.x, state);
  state.y_range ??= rangeOf(state.y, state);
  return state;
}

function isGain(name) {
  return ["Kp", "Ki", "Kd", "Kv", "gain"].includes(name);
}

// The ends of a slider: those of the plant of a file, or the usual ones.
function endsOf(name, state) {
  const { low, high } = SLIDERS[name];
  return state.ranges[name] ?? [low, high];
}

// The ends of an axis of the map. A plant has a gain and a lag.
function rangeOf(name, state) {
  const [low, high] = endsOf(name, state);
  return [name === "lag" || (name === "gain" && high > 0) ? Math.max(low, 0.01 * high) : low, high];
}

// The state in the fragment of the address: only what differs from the state the page came with.
function toFragment(state, first) {
  const parts = [];
  for (const [name, value] of Object.entries(state)) {
    if (JSON.stringify(value) !== JSON.stringify(first[name])) {
      parts.push(`${name}=${encodeURIComponent(JSON.stringify(value))}`);
    }
  }
  return parts.join("&");
}

function fromFragment(fragment) {
  const state = {};
  for (const part of fragment.replace(/^#/, "").split("&")) {
    const [name, text] = part.split("=");
    if (!(name in DEFAULTS) || text === undefined) continue;
    try {
      const value = JSON.parse(decodeURIComponent(text));
      if (isLike(value, name)) state[name] = value;
    } catch {
      // A broken part of an address is left out.
    }
  }
  return state;
}

function isLike(value, name) {
  const numbers = (list) => Array.isArray(list) && list.every(Number.isFinite);
  if (name === "low") return value === null || Number.isFinite(value);
  if (name === "ranges") {
    return Object.entries(value ?? {}).every(([of, ends]) => of in SLIDERS && isLike(ends, "x_range"));
  }
  if (name === "interval") return value === null || (numbers(value) && value.length === 2);
  if (name.endsWith("_range")) return numbers(value) && value.length === 2 && value[0] < value[1];
  if (name === "num" || name === "den") return numbers(value) && value.length > 0;
  return typeof value === typeof DEFAULTS[name] && (typeof value !== "number" || isFinite(value));
}
