// Sliders with a number beside each, and lists to choose from.

class Controls {
  constructor(place, change) {
    this.place = place;
    this.change = change;
    this.fields = new Map();
  }

  // Make the sliders of this loop again where it has other ones.
  show(state) {
    const names = sliderNames(state);
    if (names.join() !== [...this.fields.keys()].join()) this.build(names);
    for (const [name, field] of this.fields) {
      const value = state[name];
      const { zero } = SLIDERS[name];
      const [low, high] = endsOf(name, state);
      field.range.min = Math.min(low, value);
      field.range.max = Math.max(high, value);
      if (document.activeElement !== field.range) field.range.value = value;
      if (document.activeElement !== field.number) field.number.value = Number(value.toPrecision(6));
      field.note.textContent = value === 0 && zero ? zero : "";
      field.range.setAttribute("aria-valuetext", `${shown(value)} ${SLIDERS[name].unit}`);
    }
  }

  build(names) {
    this.fields.clear();
    this.place.replaceChildren();
    for (const name of names) {
      const { label, unit } = SLIDERS[name];
      const row = document.createElement("div");
      row.className = "slider";
      const title = document.createElement("label");
      title.htmlFor = `range-${name}`;
      title.textContent = unit ? `${label}, ${unit}` : label;
      const note = document.createElement("span");
      note.className = "note";
      title.append(" ", note);
      const range = document.createElement("input");
      Object.assign(range, { type: "range", id: `range-${name}`, step: "any" });
      const number = document.createElement("input");
      Object.assign(number, { type: "number", id: `number-${name}`, step: "any" });
      number.setAttribute("aria-label", `${label} as a number`);
      const send = (text) => {
        const value = Number(text);
        if (text !== "" && isFinite(value)) this.change({ [name]: allowed(name, value) });
      };
      range.addEventListener("input", () => send(range.value));
      range.addEventListener("keydown", (event) => this.byKey(event, name, range));
      number.addEventListener("change", () => send(number.value));
      row.append(title, range, number);
      this.place.append(row);
      this.fields.set(name, { range, number, note });
    }
  }

  // A slider without steps moves by a hundredth of its range for a key.
  byKey(event, name, range) {
    const signs = { ArrowLeft: -1, ArrowDown: -1, ArrowRight: 1, ArrowUp: 1 };
    const sign = signs[event.key];
    if (!sign) return;
    event.preventDefault();
    const step = ((range.max - range.min) / 100) * (event.shiftKey ? 10 : 1);
    const value = Number(range.value) + sign * step;
    const bounded = Math.min(Number(range.max), Math.max(Number(range.min), value));
    range.value = bounded;
    this.change({ [name]: allowed(name, bounded) });
  }
}

// A number where the loop has a meaning.
function allowed(name, value) {
  if (name === "gain") return value === 0 ? 0.01 : value;
  if (["delay", "sample_time", "lag", "limit", "damping"].includes(name)) return Math.max(0, value);
  if (["omega", "tracking_time", "height"].includes(name)) return Math.max(1e-3, value);
  return value;
}
