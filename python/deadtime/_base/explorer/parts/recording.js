// A recording that is dropped on the page: its columns, the fit of the loop to it, the delay.

const MOST_ROWS = 3000;

// What a column may be called, in the order in which it is looked for.
const COLUMNS = {
  time: /^(t|time)\b|time|seconds/i,
  reference: /ref|setpoint|target|desired/i,
  output: /out|height|alt|meas|pos|actual|^y$/i,
  command: /command|cmd|actuator|^u$/i,
};

// Names and columns of a table in text: separators and decimal commas as found.
function tableOf(text) {
  const lines = text.split(/\r?\n/).filter((line) => line.trim() && !line.startsWith("#"));
  if (lines.length < 3) throw new Error("this file has no rows: give a table with a header line");
  const [separator] = [";", "\t", ","].filter((one) => lines[0].includes(one));
  if (separator === undefined) throw new Error("this file has one column: time, reference and output are needed");
  const names = lines[0].split(separator).map((name) => name.trim().replace(/^"|"$/g, ""));
  const columns = names.map(() => []);
  lines.slice(1).forEach((line, row) => {
    const cells = line.split(separator);
    if (cells.length !== names.length) {
      throw new Error(`row ${row + 1} has ${cells.length} cells and the header ${names.length}`);
    }
    cells.forEach((cell, i) => {
      const number = separator === "," ? cell : cell.replace(",", ".");
      columns[i].push(number.trim() === "" ? NaN : Number(number));
    });
  });
  return { names, columns };
}

// Which column is probably what; none for a command that is not there.
function guessed(names) {
  const found = {};
  for (const [what, pattern] of Object.entries(COLUMNS)) {
    const taken = Object.values(found);
    found[what] = names.find((name) => pattern.test(name) && !taken.includes(name)) ?? "";
  }
  return found;
}

// Rows of finite numbers at increasing times.
function rowsOf({ names, columns }, chosen) {
  const pick = (name) => columns[names.indexOf(name)];
  const parts = ["time", "reference", "output", "command"].map((what) => pick(chosen[what]));
  if (!parts[0] || !parts[1] || !parts[2]) throw new Error("choose the columns of time, reference and output");
  const rows = { time: [], reference: [], output: [], command: parts[3] ? [] : null };
  parts[0].forEach((time, i) => {
    const values = parts.map((part) => (part ? part[i] : 0));
    if (!values.every(Number.isFinite)) return;
    if (rows.time.length && time <= rows.time.at(-1)) {
      throw new Error(`time ${time} follows ${rows.time.at(-1)}: times must increase`);
    }
    ["time", "reference", "output"].forEach((what, j) => rows[what].push(values[j]));
    rows.command?.push(values[3]);
  });
  if (rows.time.length > MOST_ROWS) {
    throw new Error(
      `${rows.time.length} rows are too many for this page, which takes ${MOST_ROWS}: ` +
        "give a part of them, or use deadtime estimate",
    );
  }
  if (rows.time.length < 10) throw new Error(`${rows.time.length} rows: give ten or more`);
  return rows;
}

// The commands: as recorded, or those of a proportional controller that saw these outputs.
function commandsOf(rows, loop) {
  if (rows.command) return rows.command;
  if (loop.controller !== "P") {
    throw new Error(
      `choose the column of the command: it follows from the other columns under a P controller, ` +
        `not under ${loop.controller}. Was the loop flown with P? Then choose P and its gain`,
    );
  }
  const limit = loop.limit > 0 ? loop.limit : Infinity;
  return rows.output.map((output, i) => {
    const command = loop.Kp * (rows.reference[i] - output);
    return Math.min(limit, Math.max(-limit, command));
  });
}

// Why a fit does not explain its recording.
function whyNot(found) {
  if (found.white < 0.01) return "what is left is not white noise";
  if (found.further < 0.05) return "the plant lacks a lag";
  return "the noise or the delay is not what the model takes it for";
}

class RecordingView {
  constructor(elements, kernels, state, take) {
    Object.assign(this, elements);
    this.kernels = kernels;
    this.state = state;
    this.take = take;
    this.file.addEventListener("change", () => this.file.files[0] && this.read(this.file.files[0]));
    this.fit.addEventListener("click", () => this.estimate());
    document.addEventListener("dragover", (event) => event.preventDefault());
    document.addEventListener("drop", (event) => {
      event.preventDefault();
      const [file] = event.dataTransfer.files;
      if (file) this.read(file);
    });
  }

  async read(file) {
    this.name = file.name;
    try {
      this.table = tableOf(await file.text());
      const found = guessed(this.table.names);
      for (const [what, list] of Object.entries(this.lists)) {
        const names = what === "command" ? ["", ...this.table.names] : this.table.names;
        list.replaceChildren(...names.map((name) => new Option(name || "none", name)));
        list.value = found[what] || names[0];
      }
      this.columns.hidden = false;
      this.estimate();
    } catch (error) {
      this.say(error.message);
    }
  }

  say(text) {
    this.result.textContent = text;
    this.plot.toggleAttribute("hidden", true);
  }

  estimate() {
    const chosen = Object.fromEntries(Object.entries(this.lists).map(([what, list]) => [what, list.value]));
    try {
      const rows = rowsOf(this.table, chosen);
      const loop = this.state();
      const found = this.kernels.estimate(loop, rows, commandsOf(rows, loop), this.lag.checked);
      this.show(rows, found);
      this.found = found;
      // A fit that does not explain the recording leaves the loop of the page as it was.
      if (!found.reliable || !(found.gain.value > 0)) return;
      const { delay, gain, lag } = found;
      const interval = [delay.low, delay.high];
      this.take({ delay: delay.value, gain: gain.value, lag: lag.value, interval });
    } catch (error) {
      this.say(error.message);
    }
  }

  show(rows, found) {
    const said = ({ value, low, high }, unit) =>
      found.reliable
        ? `${shown(value, 3)}${unit}, between ${shown(low, 3)} and ${shown(high, 3)}${unit}`
        : `about ${shown(value, 2)}${unit}, not claimed to hold`;
    const lines = [found.reliable ? "Reliable, with 95 % confidence:" : "Indication:"];
    lines.push(`${this.name}, ${rows.time.length} rows`, `delay ${said(found.delay, " s")}`);
    if (found.lag.value > 0) {
      lines.push(`lag ${said(found.lag, " s")}`, `delay and lag together ${said(found.sum, " s")}`);
    }
    lines.push(`gain ${said(found.gain, "")}`);
    const beside = [found.air && "moving air", found.trim && "a constant input"].filter(Boolean);
    lines.push(`noise ${shown(found.noise, 2)}${beside.length ? `, beside ${beside.join(" and ")}` : ""}`);
    lines.push(
      found.reliable
        ? "The model explains the recording."
        : "The model does not explain the recording: " +
            whyNot(found) +
            ". The loop of this page stays as it was.",
    );
    this.result.replaceChildren(
      ...lines.map((line) => Object.assign(document.createElement("span"), { textContent: line })),
    );
    this.plot.toggleAttribute("hidden", false);
    const width = Math.max(260, this.plot.clientWidth || 320);
    const all = [...rows.output, ...rows.reference];
    const [low, high] = [Math.min(...all), Math.max(...all)];
    const margin = 0.05 * (high - low || 1);
    const frame = new Frame(this.plot, {
      width,
      height: Math.round(0.62 * width),
      x: [rows.time[0], rows.time.at(-1)],
      y: [low - margin, high + margin],
      label: ["Time, s", "Output"],
    });
    frame.axes();
    const group = frame.clipped("steps");
    const put = (values, name) =>
      group.append(svg("path", { d: frame.path(rows.time, values), class: name }));
    put(rows.reference, "aim");
    rows.output.forEach((value, i) => {
      const place = { cx: frame.px(rows.time[i]), cy: frame.py(value), r: 1.6, class: "row" };
      group.append(svg("circle", place));
    });
    put(found.fitted, "real");
  }
}
