// What is known of the chosen loop: roots, step responses, margins.

const ROOTS = 16;
const TIMES = 400;

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
    const all = sampled ? [...roots, ...smooth.roots] : roots;
    const reals = all.map((root) => root.re).filter((re) => isFinite(re) && re > -60);
    const imaginary = all.map((root) => Math.abs(root.im)).filter(isFinite);
    const low = Math.min(-1, ...reals);
    const high = Math.max(0.5, ...reals);
    const top = Math.max(1, ...imaginary);
    const margin = 0.06 * (high - low);
    const width = Math.max(260, this.roots.clientWidth || 320);
    const frame = new Frame(this.roots, {
      width,
      height: Math.round(0.72 * width),
      x: [low - margin, high + margin],
      y: [-1.06 * top, 1.06 * top],
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

  // How long responses are shown, s.
  span(state, abscissa) {
    const slow = abscissa < 0 ? -5 / abscissa : 0;
    const least = 8 * (state.delay + state.lag + state.sample_time);
    const span = Math.max(least, slow, 1);
    const round = 10 ** Math.floor(Math.log10(span));
    return Math.min(round * ([1, 2, 5, 10].find((one) => one * round >= span) ?? 10), 200);
  }

  drawSteps(state, ideal, span) {
    const time = linspace(0, span, TIMES);
    const options = { height: state.height, load: state.load };
    const real = this.kernels.step(state, time, options);
    const differs = state.sample_time > 0 || state.limit > 0;
    const other = differs ? this.kernels.step(ideal, time, options) : null;
    const bound = 4 * Math.max(Math.abs(state.height), 1e-9);
    const values = [...real.outputs, ...(other?.outputs ?? [])].filter(
      (value) => Math.abs(value) < bound,
    );
    const low = Math.min(0, ...values);
    const high = Math.max(state.load ? 0 : 1.1 * state.height, ...values, 1e-9);
    const width = Math.max(260, this.steps.clientWidth || 320);
    const frame = new Frame(this.steps, {
      width,
      height: Math.round(0.72 * width),
      x: [0, span],
      y: [low - 0.04 * (high - low), high + 0.04 * (high - low)],
      label: ["Time, s", state.load ? "Output after a load" : "Output"],
    });
    frame.axes();
    const group = frame.clipped("steps");
    const aim = state.load ? 0 : state.height;
    group.append(svg("path", { d: frame.path([0, span], [aim, aim]), class: "aim" }));
    if (other) group.append(svg("path", { d: frame.path(time, other.outputs), class: "ideal" }));
    group.append(svg("path", { d: frame.path(time, real.outputs), class: "real" }));
    this.response = { time, outputs: [...real.outputs], commands: [...real.commands] };
    const peak = Math.max(...real.outputs.filter(isFinite));
    const over = state.load ? null : Math.max(0, peak / state.height - 1);
    const text = state.load
      ? `Largest deviation after a load of ${shown(state.height)}: ${shown(peak)}`
      : `Overshoot ${(100 * over).toFixed(1)} %`;
    this.caption.textContent = text + (other ? "; dashed: without hold and limit" : "");
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
