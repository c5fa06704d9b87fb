// Drawings in SVG: axes with ticks, lines and markers.

const SVG = "http://www.w3.org/2000/svg";

function svg(tag, attributes = {}, ...children) {
  const element = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  element.append(...children);
  return element;
}

// Round numbers in a range, some `wanted` of them.
function ticks(low, high, wanted = 5) {
  const raw = (high - low) / wanted;
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = power * ([1, 2, 5, 10].find((one) => one * power >= raw) ?? 10);
  const found = [];
  for (let i = Math.ceil(low / step - 1e-9); i * step <= high + 1e-9 * step; i++) {
    found.push(Number((i * step).toPrecision(12)));
  }
  return found;
}

function shown(value, digits = 4) {
  if (!isFinite(value)) return value > 0 ? "∞" : value < 0 ? "−∞" : "–";
  return String(Number(value.toPrecision(digits))).replace("-", "−");
}

// A frame with two linear axes inside of an svg element of this size.
class Frame {
  constructor(root, { width, height, x, y, label }) {
    Object.assign(this, { root, width, height, x, y });
    this.left = 52;
    this.right = 18;
    this.top = 10;
    this.bottom = 40;
    root.replaceChildren();
    root.setAttribute("viewBox", `0 0 ${width} ${height}`);
    const inner = svg("clipPath", { id: `${root.id}-clip` });
    inner.append(svg("rect", this.box));
    root.append(svg("defs", {}, inner));
    this.label = label;
  }

  get box() {
    return {
      x: this.left,
      y: this.top,
      width: this.width - this.left - this.right,
      height: this.height - this.top - this.bottom,
    };
  }

  px(value) {
    const { x, width } = this.box;
    return x + ((value - this.x[0]) / (this.x[1] - this.x[0])) * width;
  }

  py(value) {
    const { y, height } = this.box;
    return y + (1 - (value - this.y[0]) / (this.y[1] - this.y[0])) * height;
  }

  // The values at a place of the drawing, in its own units.
  at(px, py) {
    const { x, y, width, height } = this.box;
    return [
      this.x[0] + ((px - x) / width) * (this.x[1] - this.x[0]),
      this.y[1] - ((py - y) / height) * (this.y[1] - this.y[0]),
    ];
  }

  axes() {
    const { x, y, width, height } = this.box;
    const group = svg("g", { class: "axes" });
    for (const value of ticks(...this.x, this.width < 360 ? 4 : 6)) {
      const at = this.px(value);
      group.append(svg("line", { x1: at, x2: at, y1: y, y2: y + height, class: "grid" }));
      const text = { x: at, y: y + height + 15, "text-anchor": "middle" };
      group.append(svg("text", text, shown(value)));
    }
    for (const value of ticks(...this.y)) {
      const at = this.py(value);
      group.append(svg("line", { x1: x, x2: x + width, y1: at, y2: at, class: "grid" }));
      group.append(svg("text", { x: x - 6, y: at + 4, "text-anchor": "end" }, shown(value)));
    }
    group.append(svg("rect", { ...this.box, class: "frame" }));
    const middle = { x: x + width / 2, y: this.height - 6, "text-anchor": "middle" };
    group.append(svg("text", middle, this.label[0]));
    const side = `translate(13 ${y + height / 2}) rotate(-90)`;
    group.append(svg("text", { transform: side, "text-anchor": "middle" }, this.label[1]));
    this.root.append(group);
  }

  // A group whose parts end at the frame.
  clipped(name = "") {
    const group = svg("g", { "clip-path": `url(#${this.root.id}-clip)`, class: name });
    this.root.append(group);
    return group;
  }

  path(xs, ys) {
    let text = "";
    let pen = "M";
    for (let i = 0; i < xs.length; i++) {
      if (!Number.isFinite(ys[i])) {
        pen = "M";
        continue;
      }
      const bounded = Math.max(-1e4, Math.min(1e4, this.py(ys[i])));
      text += `${pen}${this.px(xs[i]).toFixed(1)} ${bounded.toFixed(1)}`;
      pen = "L";
    }
    return text;
  }
}
