// The map over two numbers: cells on a canvas, curves and the chosen point over it.

const CELLS = { continuous: 300, sampled: 150 };

// The same where several delays are judged.
const COARSE = { continuous: 150, sampled: 80 };

// Delays of an interval at which boundaries are drawn and all cells are judged.
const DELAYS = 5;

class MapView {
  constructor(elements, kernels, choose) {
    Object.assign(this, elements);
    this.kernels = kernels;
    this.choose = choose;
    this.listen();
  }

  axes(state, cells) {
    return ["x", "y"].map((one) => ({
      name: state[one],
      points: linspace(...state[`${one}_range`], cells),
    }));
  }

  // The loops that are judged: that of the state, or one for each delay of the interval.
  loops(state) {
    const axes = [state.x, state.y];
    if (!state.interval || axes.includes("delay")) return [state];
    return linspace(...state.interval, DELAYS).map((delay) => ({ ...state, delay }));
  }

  draw(state) {
    const sampled = state.sample_time > 0;
    const loops = this.loops(state);
    const cells = (loops.length > 1 ? COARSE : CELLS)[sampled ? "sampled" : "continuous"];
    const axes = this.axes(state, cells);
    const maps = loops.map((loop) => this.kernels.map(loop, axes));
    // Points of curves are exact and need no more than every other row.
    const rows = sampled ? this.axes(state, Math.ceil(cells / 2)) : axes;
    this.curves = loops.map((loop) => this.kernels.boundaries(loop, rows));
    this.stable = this.paint(maps, cells);
    this.frame(state, sampled);
    this.mark(state);
  }

  // Cells as pixels: x to the right, y up. Returns the share that is stable in all maps.
  paint(maps, cells) {
    const image = this.cells;
    if (image.width !== cells || image.height !== cells) {
      [image.width, image.height] = [cells, cells];
    }
    const context = image.getContext("2d");
    const pixels = context.createImageData(cells, cells);
    const words = new Uint32Array(pixels.data.buffer);
    const palette = this.palette();
    let stable = 0;
    for (let i = 0; i < cells; i++) {
      for (let j = 0; j < cells; j++) {
        let worst = 0;
        let unknown = false;
        for (const counts of maps) {
          const count = counts[i * cells + j];
          if (count === -4) worst = Infinity;
          else if (count < 0) unknown = true;
          else if (count > worst) worst = count;
        }
        if (worst === 0 && !unknown) stable++;
        const colour = worst > 0 || !unknown ? palette.counts[Math.min(worst, 5)] : palette.unknown;
        words[(cells - 1 - j) * cells + i] = colour;
      }
    }
    context.putImageData(pixels, 0, 0);
    return stable / (cells * cells);
  }

  palette() {
    const style = getComputedStyle(document.documentElement);
    const colour = (name) => {
      const [r, g, b] = style.getPropertyValue(name).trim().split(" ").map(Number);
      return ((255 << 24) | (b << 16) | (g << 8) | r) >>> 0;
    };
    const counts = [0, 1, 2, 3, 4, 5].map((count) => colour(`--count-${count}`));
    return { counts, unknown: colour("--count-unknown") };
  }

  frame(state, sampled) {
    const width = Math.max(280, Math.round(this.plot.clientWidth) || 640);
    const height = Math.round(Math.min(0.8 * width, 560));
    const unit = (name) => SLIDERS[name].label + (SLIDERS[name].unit && `, ${SLIDERS[name].unit}`);
    const frame = new Frame(this.plot, {
      width,
      height,
      x: state.x_range,
      y: state.y_range,
      label: [unit(state.x), unit(state.y)],
    });
    const { x, y, width: across, height: high } = frame.box;
    Object.assign(this.cells.style, {
      left: `${(100 * x) / width}%`,
      top: `${(100 * y) / height}%`,
      width: `${(100 * across) / width}%`,
      height: `${(100 * high) / height}%`,
    });
    const lines = frame.clipped("curves");
    this.curves.forEach((curves, index) => {
      const of = this.curves.length;
      const middle = of === 1 || index === (of - 1) / 2;
      for (const curve of curves) {
        const xs = curve.map((vertex) => vertex[0]);
        const ys = curve.map((vertex) => vertex[1]);
        const path = svg("path", { d: frame.path(xs, ys), class: middle ? "middle" : "other" });
        lines.append(path);
        if (middle) this.frequencies(lines, frame, curve);
      }
    });
    this.band(lines, frame, state);
    frame.axes();
    this.drawn = frame;
  }

  // The ends of the interval where the delay itself is an axis.
  band(lines, frame, state) {
    const { x, y, width, height } = frame.box;
    for (const end of state.interval ?? []) {
      const [px, py] = [frame.px(end), frame.py(end)];
      const place = { x: { x1: px, x2: px, y1: y, y2: y + height }, y: { x1: x, x2: x + width, y1: py, y2: py } };
      for (const one of ["x", "y"]) {
        if (state[one] === "delay") lines.append(svg("line", { ...place[one], class: "end" }));
      }
    }
  }

  // Frequencies along a curve, where there is room.
  frequencies(lines, frame, curve) {
    const { box } = frame;
    let last = null;
    for (const [x, y, omega] of curve) {
      const at = [frame.px(x), frame.py(y)];
      const inside =
        at[0] > box.x + 30 &&
        at[0] < box.x + box.width - 10 &&
        at[1] > box.y + 20 &&
        at[1] < box.y + box.height - 20;
      if (!inside || (last && Math.hypot(at[0] - last[0], at[1] - last[1]) < 110)) continue;
      last = at;
      lines.append(svg("circle", { cx: at[0], cy: at[1], r: 2.5, class: "frequency" }));
      const isRight = at[0] > box.x + box.width - 80;
      const place = { x: at[0] + (isRight ? -6 : 6), y: at[1] - 5, class: "frequency" };
      place["text-anchor"] = isRight ? "end" : "start";
      lines.append(svg("text", place, `${shown(Math.abs(omega), 3)} rad/s`));
    }
  }

  mark(state) {
    this.marker?.remove();
    const { drawn } = this;
    this.marker = drawn.clipped("point");
    const [x, y] = [drawn.px(state[state.x]), drawn.py(state[state.y])];
    this.marker.append(
      svg("circle", { cx: x, cy: y, r: 8, class: "halo" }),
      svg("circle", { cx: x, cy: y, r: 5, class: "dot" }),
    );
    const where = `${state.x} ${shown(state[state.x])}, ${state.y} ${shown(state[state.y])}`;
    this.plot.setAttribute("aria-label", `Stability map. ${where}. Arrow keys move the point.`);
  }

  listen() {
    const { plot } = this;
    const choose = (event) => {
      const box = plot.getBoundingClientRect();
      const scale = this.drawn.width / box.width;
      const at = this.drawn.at(
        (event.clientX - box.left) * scale,
        (event.clientY - box.top) * scale,
      );
      this.choose(at);
    };
    plot.addEventListener("pointerdown", (event) => {
      plot.setPointerCapture(event.pointerId);
      choose(event);
    });
    plot.addEventListener("pointermove", (event) => {
      if (plot.hasPointerCapture(event.pointerId)) choose(event);
    });
    const steps = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
    plot.addEventListener("keydown", (event) => {
      const step = steps[event.key];
      if (!step) return;
      event.preventDefault();
      this.choose(step, event.shiftKey ? 0.05 : 0.01);
    });
  }
}
