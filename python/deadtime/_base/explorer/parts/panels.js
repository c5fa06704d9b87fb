// What is known of the chosen loop: roots, step responses, margins.

const ROOTS = 16;

// A plot by its width: both plots and the margins stand beside the map.
const heightOf = (width) => Math.max(200, Math.round(0.42 * width));

// Times of a response, the middle one among them.
const TIMES = 501;

// Roots by which the picture is scaled: the rightmost two pairs, if they turn by less than this angle
// in a delay, as the roots of a chain do not.
const NEAR = 4;
const CHAIN = 1.5 * Math.PI;

// Responses are shown for so many of the loop's own times at most.
const LONGEST = 60;

class Panels {
  constructor(elements, kernels) {
    Object.assign(this, elements);
    this.kernels = kernels;
  }

  draw(state) {
    const rightmost = this.kernels.rightmost(state, ROOTS);
    const ideal = continuous(state);
    const smooth = state.sample_time > 0 ? this.kernels.rightmost(ideal, ROOTS) : rightmost;
    this.drawRoots(rightmost, smooth, state);
    const span = this.span(state, rightmost.abscissa);
    this.drawSteps(state, ideal, span);
    this.tabulate(state, ideal, rightmost, smooth);
  }

  drawRoots({ roots, chains }, smooth, state) {
    const sampled = state.sample_time > 0;
    // The rightmost ones decide; the chains of a delay lie outside.
    const isNear = ({ im }) => !(Math.abs(im) * state.delay > CHAIN);
    const first = (list) => list.slice(0, 1).concat(list.slice(1, NEAR).filter(isNear));
    const near = [...first(roots), ...(sampled ? first(smooth.roots) : [])];
    const reals = near.map((root) => root.re).filter(isFinite);
    const low = Math.min(0, ...reals);
    const high = Math.max(0, ...reals);
    const margin = 0.12 * (high - low || 1);
    const top = Math.max(0.5 * (high - low), ...near.map((root) => Math.abs(root.im)).filter(isFinite)) || 1;
    const width = Math.max(260, this.roots.clientWidth || 320);
    const frame = new Frame(this.roots, {
      width,
      height: heightOf(width),
      x: [low - margin, high + margin],
      y: [-1.15 * top, 1.15 * top],
      label: ["Re s, 1/s", "Im s, 1/s"],
    });
    frame.axes();
    const group = frame.clipped("roots");
    const { y, height } = frame.box;
    const vertical = (at, name) =>
      group.append(svg("line", { x1: frame.px(at), x2: frame.px(at), y1: y, y2: y + height, class: name }));
    vertical(0, "axis");
    if (isFinite(chains)) vertical(chains, "chain");
    const put = (root, name) => {
      const [cx, cy] = [frame.px(root.re), frame.py(root.im)];
      const title = `${shown(root.re)} ${root.im < 0 ? "−" : "+"} ${shown(Math.abs(root.im))} j`;
      const mark =
        name === "smooth"
          ? svg("circle", { cx, cy, r: 4, class: name })
          : svg("path", { d: `M${cx - 4} ${cy - 4}l8 8m0 -8l-8 8`, class: name });
      mark.append(svg("title", {}, title));
      group.append(mark);
    };
    if (sampled) smooth.roots.forEach((root) => put(root, "smooth"));
    roots.forEach((root) => put(root, root.re < 0 ? "stable" : "unstable"));
  }

  // How long a response is shown, s: in the loop's own times, rounded.
  span(state, abscissa) {
    const own = state.delay + state.lag + state.sample_time || 1;
    // At its limit an integrator takes a time of its own for the step.
    const atLimit = state.limit > 0 && state.den.at(-1) === 0 ? state.height / (state.limit * Math.abs(state.gain)) : 0;
    const slow = (abscissa < 0 ? -5 / abscissa : 0) + atLimit;
    const span = Math.min(Math.max(4 * own, slow), LONGEST * own);
    const round = 10 ** Math.floor(Math.log10(span));
    return round * ([1, 2, 5, 10].find((one) => one * round >= span) ?? 10);
  }

  // A step of the reference, and after it one of the load.
  drawSteps(state, ideal, late) {
    const span = state.load === 0 ? late : 2 * late;
    const time = linspace(0, span, TIMES);
    const real = this.kernels.step(state, time, late);
    const differs = state.sample_time > 0 || state.limit > 0;
    const other = differs ? this.kernels.step(ideal, time, late) : null;
    const { height } = state;
    const values = [...real.outputs, ...(other?.outputs ?? [])].filter((value) => Math.abs(value) < 4 * height);
    const low = Math.min(0, ...values);
    const high = Math.max(1.1 * height, ...values);
    const width = Math.max(260, this.steps.clientWidth || 320);
    const frame = new Frame(this.steps, {
      width,
      height: heightOf(width),
      x: [0, span],
      y: [low - 0.04 * (high - low), high + 0.04 * (high - low)],
      label: ["Time, s", "Output"],
    });
    frame.axes();
    const group = frame.clipped("steps");
    group.append(svg("path", { d: frame.path([0, span], [height, height]), class: "aim" }));
    if (other) group.append(svg("path", { d: frame.path(time, other.outputs), class: "ideal" }));
    group.append(svg("path", { d: frame.path(time, real.outputs), class: "real" }));
    this.response = { time, outputs: [...real.outputs], commands: [...real.commands] };
    const before = time.findIndex((t) => t >= late);
    const peak = Math.max(...real.outputs.slice(0, before).filter(isFinite));
    const said = [`Overshoot ${(100 * Math.max(0, peak / height - 1)).toFixed(1)} %`];
    if (state.load !== 0) {
      const off = real.outputs.slice(before).map((value) => Math.abs(value - real.outputs[before]));
      const most = Math.max(...off.filter(isFinite));
      said.push(`a load of ${shown(state.load)} at ${shown(late)} s moves the output by up to ${shown(most, 3)}`);
    }
    if (other) said.push("dashed: without hold and limits");
    this.caption.textContent = said.join("; ");
  }

  tabulate(state, ideal, rightmost, smooth) {
    const real = this.margins(state);
    const other = state.sample_time > 0 ? this.margins(ideal) : real;
    const degrees = (angle) => `${shown(angle, 3)}°`;
    const rows = [
      ["Spectral abscissa", "1/s", smooth.abscissa, rightmost.abscissa, shown],
      ["Gain margin", "", other?.gain, real?.gain, shown],
      ["Largest stable Kp", "", other && other.gain * state.Kp, real && real.gain * state.Kp, shown],
      ["Phase margin", "", other?.phase, real?.phase, degrees],
      ["Delay margin", "s", other?.delay, real?.delay, shown],
    ];
    const sampled = state.sample_time > 0;
    const cell = (value, format) => (value === undefined || value === null ? "–" : format(value));
    const lines = rows.map(([name, unit, one, two, format]) => {
      const row = document.createElement("tr");
      const head = document.createElement("th");
      head.scope = "row";
      head.textContent = unit ? `${name}, ${unit}` : name;
      row.append(head);
      // Of a gain alone that scales the whole loop: other gains stay in proportion.
      for (const value of sampled ? [one, two] : [one]) {
        const data = document.createElement("td");
        data.textContent = cell(value, format);
        row.append(data);
      }
      return row;
    });
    this.table.tBodies[0].replaceChildren(...lines);
    this.table.classList.toggle("sampled", sampled);
    const stable = rightmost.abscissa < 0;
    this.verdict.textContent = stable ? "Stable" : "Unstable";
    this.verdict.className = stable ? "stable" : "unstable";
    this.numbers = { abscissa: rightmost.abscissa, margins: real };
  }

  // Margins, or nothing where the loop has none.
  margins(loop) {
    try {
      const found = this.kernels.margins(loop);
      return found.stable ? found : null;
    } catch {
      return null;
    }
  }
}
