// Put the page together: one state, drawn again once a frame after it changed.

const $ = (id) => document.getElementById(id);

async function main() {
  const given = JSON.parse($("given").textContent);
  const module = await compiled($("kernels").textContent.trim());
  const kernels = await kernelsOf(module);
  const first = completed({ ranges: usualRanges(completed(given), kernels), ...given });
  const working = { place: $("working"), text: $("working-text"), cancel: $("cancel") };
  const jobs = new Jobs(working, module, $("shared").textContent);
  let state = completed({ ...first, ...fromFragment(location.hash) });
  let isDue = false;
  let written = 0;

  const map = new MapView({ plot: $("map"), cells: $("cells") }, kernels, choose);
  const panels = new Panels(
    {
      roots: $("roots"),
      steps: $("steps"),
      caption: $("steps-caption"),
      table: $("margins"),
      verdict: $("verdict"),
    },
    kernels,
  );
  const list = (what) => [what, $(`column-${what}`)];
  new RecordingView(
    {
      file: $("file"),
      columns: $("columns"),
      lists: Object.fromEntries(SIGNALS.map(list)),
      lag: $("fit-lag"),
      fit: $("fit"),
      plot: $("recorded"),
      result: $("estimate"),
    },
    { kernels, jobs, usual: JSON.parse($("usual").textContent), state: () => state, take: change },
  );
  const controls = new Controls($("sliders"), change);

  function change(numbers) {
    state = completed({ ...state, ...numbers });
    // What was said of other numbers does not hold.
    if (Object.keys(numbers).length) $("suggestion").textContent = "";
    if (isDue) return;
    isDue = true;
    requestAnimationFrame(draw);
  }

  // A point of the map, or with `share` a step of so much of the ranges.
  function choose([x, y], share) {
    const moved = (one, value) => {
      const [low, high] = state[`${one}_range`];
      const at = share ? state[state[one]] + value * share * (high - low) : value;
      return allowed(state[one], Math.min(high, Math.max(low, at)));
    };
    change({ [state.x]: moved("x", x), [state.y]: moved("y", y) });
  }

  // The gains with the best response to a load; the map goes on to show them.
  async function suggest() {
    const said = $("suggestion");
    try {
      const found = await jobs.run("Looking for gains", "design", state);
      const ranges = { ...state.ranges };
      for (const [name, value] of Object.entries(found.gains)) {
        const [low, high] = endsOf(name, state);
        if (value < low || value > high) ranges[name] = [Math.min(low, 1.5 * value), Math.max(high, 1.5 * value)];
      }
      const axes = ["x", "y"].filter((one) => ranges[state[one]] !== state.ranges[state[one]]);
      const moved = Object.fromEntries(axes.map((one) => [`${one}_range`, null]));
      change({ ...found.gains, ranges, ...moved });
      const { gain, phase, delay } = kernels.margins(state);
      const left = CONTROLLERS[state.controller].integrates ? "the IAE of a unit load is" : "a unit load leaves";
      const where = state.interval ? " over the interval of the delay" : "";
      said.textContent =
        `Ms ${shown(found.sensitivity, 3)}${where}, gain margin ${shown(gain, 3)}, phase margin ${shown(phase, 3)}°, ` +
        `delay margin ${shown(delay, 3)} s; ${left} ${shown(found.load, 3)}`;
    } catch (error) {
      said.textContent = error.message;
    }
  }

  function draw() {
    isDue = false;
    const begin = performance.now();
    controls.show(state);
    showChoices();
    try {
      map.draw(state);
      panels.draw(state);
      $("problem").textContent = "";
    } catch (error) {
      $("problem").textContent = error.message;
    }
    const took = performance.now() - begin;
    window.drawn = { took, state, stable: map.stable, numbers: panels.numbers };
    $("timing").textContent = `${map.curves.length > 1 ? `${DELAYS} maps` : "map"} proved and drawn in ${took.toFixed(0)} ms`;
    clearTimeout(written);
    written = setTimeout(writeAddress, 250);
  }

  // A browser takes few changes of the address a second.
  function writeAddress() {
    // A frame inside of another page has no address of its own.
    if (location.protocol === "about:") return;
    const fragment = toFragment(state, first);
    const path = location.pathname + location.search;
    history.replaceState(null, "", fragment ? `#${fragment}` : path);
  }

  function showChoices() {
    const names = axisNames(state);
    for (const one of ["x", "y"]) fill($(`axis-${one}`), names.map((n) => [n, SLIDERS[n].label]), state[one]);
    $("plant").value = state.plant;
    $("controller").value = state.controller;
    $("filter").checked = state.filter;
    $("filter").disabled = !CONTROLLERS[state.controller].differentiates;
    $("unequal").checked = state.low !== null;
    $("unequal").disabled = !(state.limit > 0);
    $("guard").value = state.guard;
    $("guards").hidden = !isGuarded(state);
    $("polynomials").hidden = state.plant !== "rational";
    for (const one of ["num", "den"]) {
      if (document.activeElement !== $(one)) $(one).value = state[one].join(" ");
    }
    for (const one of ["x", "y"]) {
      state[`${one}_range`].forEach((value, i) => {
        const field = $(`${one}-${i ? "high" : "low"}`);
        if (document.activeElement !== field) field.value = Number(value.toPrecision(6));
      });
    }
    $("interval-note").textContent = state.interval
      ? `Delay between ${shown(state.interval[0])} and ${shown(state.interval[1])} s` +
        (map.loops(state).length > 1 ? `: cells are stable at ${DELAYS} delays of it` : "")
      : "";
    $("drop-interval").hidden = !state.interval;
  }

  function fill(list, options, chosen) {
    const made = options.map(([value, label]) => new Option(label, value, false, value === chosen));
    if ([...list.options].map((o) => o.value).join() !== options.map((o) => o[0]).join()) {
      list.replaceChildren(...made);
    }
    list.value = chosen;
  }

  fill($("plant"), Object.entries(PLANTS).map(([key, { label }]) => [key, label]), state.plant);
  fill($("controller"), Object.keys(CONTROLLERS).map((key) => [key, key]), state.controller);
  $("plant").addEventListener("change", (event) => {
    const plant = event.target.value;
    change(plant === "rational" ? asPolynomials(state) : { plant });
  });
  $("controller").addEventListener("change", (event) => change({ controller: event.target.value }));
  $("filter").addEventListener("change", (event) => change({ filter: event.target.checked }));
  fill($("guard"), Object.entries(GUARDS), state.guard);
  $("guard").addEventListener("change", (event) => change({ guard: event.target.value }));
  $("unequal").addEventListener("change", (event) => change({ low: event.target.checked ? -state.limit : null }));
  $("suggest").addEventListener("click", suggest);
  for (const one of ["x", "y"]) {
    $(`axis-${one}`).addEventListener("change", (event) => {
      const name = event.target.value;
      const other = one === "x" ? "y" : "x";
      const swapped = state[other] === name ? { [other]: state[one], [`${other}_range`]: state[`${one}_range`] } : {};
      change({ ...swapped, [one]: name, [`${one}_range`]: rangeOf(name, state) });
    });
    for (const end of ["low", "high"]) {
      $(`${one}-${end}`).addEventListener("change", () => {
        const ends = ["low", "high"].map((which) => Number($(`${one}-${which}`).value));
        if (ends.every(isFinite) && ends[0] < ends[1]) change({ [`${one}_range`]: ends });
      });
    }
  }
  for (const one of ["num", "den"]) {
    $(one).addEventListener("change", (event) => {
      const list = event.target.value.trim().split(/[\s,]+/).map(Number);
      if (list.length && list.every(isFinite) && list[0] !== 0) change({ [one]: list });
    });
  }
  $("drop-interval").addEventListener("click", () => change({ interval: null }));
  $("reset").addEventListener("click", () => change(first));
  $("svg").addEventListener("click", () => downloadSvg($("map"), $("cells"), "stability-map"));
  $("png").addEventListener("click", () => downloadPng($("map"), $("cells"), "stability-map"));
  $("json").addEventListener("click", () => {
    const curves = map.curves.map((one) => one.map((curve) => curve.map((vertex) => [...vertex])));
    downloadJson({ schema: "deadtime.explorer/1", state, ...panels.numbers, curves, response: panels.response }, "stability-map");
  });
  window.addEventListener("hashchange", () => change({ ...first, ...fromFragment(location.hash) }));
  window.addEventListener("resize", () => change({}));
  // A frame inside of another page is as high as the explorer; of another origin there is none.
  new ResizeObserver(() => {
    const frame = window.frameElement;
    if (frame) frame.style.height = `${document.documentElement.offsetHeight}px`;
  }).observe(document.body);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => change({}));
  draw();
  document.body.dataset.ready = "yes";
}

main().catch((error) => {
  document.getElementById("problem").textContent = `The page cannot run here: ${error.message}`;
});
