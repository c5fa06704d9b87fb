// A recording that is dropped on the page: its columns, the fit of the loop to it, the delay.

// A fit takes some 5 ms for a row.
const MOST_ROWS = 20_000;

// Rows that are drawn.
const MOST_DRAWN = 2000;

const SIGNALS = ["time", "reference", "output", "command"];

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
    cells.forEach((cell, i) => columns[i].push(numberIn(cell.trim().replace(/^"|"$/g, ""))));
  });
  return { names, columns };
}

// A number with a point or a comma, or an ISO time stamp in seconds; NaN for others.
function numberIn(cell) {
  const stamp = /^(\d{4}-\d\d-\d\d)[T ](\d\d:\d\d(?::\d\d)?)([.,]\d+)?(Z|[+-]\d\d:?\d\d)?$/.exec(cell);
  if (!stamp) return cell === "" ? NaN : Number(cell.replace(",", "."));
  const [, date, time, fraction, zone] = stamp;
  const whole = Date.parse(`${date}T${time}${(zone ?? "Z").replace(/(\d\d)(\d\d)$/, "$1:$2")}`) / 1000;
  return whole + (fraction ? Number(`0.${fraction.slice(1)}`) : 0);
}

// A name in small letters without its unit, and the unit.
function plainName(name, units) {
  const brackets = /\s*[([]\s*([^)\]]*?)\s*[)\]]\s*$/.exec(name);
  const short = (brackets ? name.slice(0, brackets.index) : name).trim().toLowerCase().replace(/[\s.-]+/g, "_");
  const parts = /^(.+)_([^_]*)$/.exec(short);
  if (!brackets && parts && units.includes(parts[2])) return [parts[1], parts[2]];
  return [short, brackets ? brackets[1].toLowerCase() : ""];
}

// Which column is what by its usual names, those of deadtime.read_recording; "" where none is.
function guessed(names, { names: usual, units, seconds }) {
  const found = {};
  const choose = (what, free) => {
    const plain = free.map((name) => [name, ...plainName(name, units)]);
    const fits = what === "time" ? plain.filter(([, , unit]) => seconds.includes(unit)) : plain;
    for (const one of usual[what]) {
      // As it is written, before other capitals: t is a time beside a temperature T.
      const [same] = fits.find(([name]) => name === one) ?? fits.find(([, short]) => short === one) ?? [];
      if (same !== undefined) return same;
    }
    return "";
  };
  for (const what of SIGNALS) {
    found[what] = choose(what, names.filter((name) => !Object.values(found).includes(name)));
  }
  return found;
}

// Rows of finite numbers at increasing times.
function rowsOf({ names, columns }, chosen) {
  const pick = (name) => columns[names.indexOf(name)];
  const parts = SIGNALS.map((what) => pick(chosen[what]));
  if (!parts[0] || !parts[1] || !parts[2]) throw new Error("choose the columns of time, reference and output");
  const rows = { time: [], reference: [], output: [], command: parts[3] ? [] : null };
  // Dates count from the first one, so that seconds keep their digits.
  const begin = parts[0].find(Number.isFinite);
  const first = begin > 1e8 ? begin : 0;
  parts[0].forEach((stamp, i) => {
    const time = stamp - first;
    const values = parts.map((part) => (part ? part[i] : 0));
    if (!values.every(Number.isFinite)) return;
    if (rows.time.length && time <= rows.time.at(-1)) {
      throw new Error(`time ${time} follows ${rows.time.at(-1)}: times must increase`);
    }
    rows.time.push(time);
    rows.reference.push(values[1]);
    rows.output.push(values[2]);
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
  constructor(elements, { kernels, jobs, usual, state, take }) {
    Object.assign(this, elements, { kernels, jobs, usual, state, take });
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
      const found = guessed(this.table.names, this.usual);
      for (const [what, list] of Object.entries(this.lists)) {
        const none = new Option(what === "command" ? "none" : "choose", "");
        list.replaceChildren(none, ...this.table.names.map((name) => new Option(name, name)));
        list.value = found[what];
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

  async estimate() {
    const chosen = Object.fromEntries(Object.entries(this.lists).map(([what, list]) => [what, list.value]));
    try {
      const rows = rowsOf(this.table, chosen);
      const loop = this.state();
      const commands = commandsOf(rows, loop);
      const found = await this.jobs.run(`Fitting ${this.name}`, "estimate", loop, rows, commands, this.lag.checked);
      this.show(rows, found);
      // A fit that does not explain the recording leaves the loop of the page as it was.
      if (found.reliable) this.take(loopOf(this.state(), found, rows, commands, this.kernels));
    } catch (error) {
      this.say(error.message);
    }
  }

  show(rows, found) {
    // Enough digits for the ends to differ.
    const digits = (low, high) => Math.min(9, Math.max(3, 1 + Math.ceil(Math.log10(Math.abs(high) / (high - low)))));
    const said = ({ value, low, high }, unit) =>
      found.reliable
        ? `${shown(value, digits(low, high))}${unit}, between ${shown(low, digits(low, high))} and ` +
          `${shown(high, digits(low, high))}${unit}`
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
    const stride = Math.ceil(rows.time.length / MOST_DRAWN);
    rows.output.forEach((value, i) => {
      if (i % stride) return;
      const place = { cx: frame.px(rows.time[i]), cy: frame.py(value), r: 1.6, class: "row" };
      group.append(svg("circle", place));
    });
    put(found.fitted, "real");
  }
}
