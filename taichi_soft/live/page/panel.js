// The controls: plain HTML, so that keyboards and screen readers know them.
const at = id => document.getElementById(id);
const PREFIXES = [[1e9, "G"], [1e6, "M"], [1e3, "k"], [1, ""]];

export function spelled(value, unit) {
  if (value === null || value === undefined) return "various";
  if (unit === "Pa") {
    const [factor, prefix] = PREFIXES.find(([f]) => value >= f) ?? [1, ""];
    return `${Number((value / factor).toPrecision(3))} ${prefix}Pa`;
  }
  return `${Number(value.toPrecision(3))}${unit ? ` ${unit}` : ""}`;
}

class Slider {
  constructor(about, wish) {
    this.about = about;
    const box = document.createElement("div");
    box.className = "slider";
    const id = `slider-${about.name}`;
    box.innerHTML = `<div class="top"><label for="${id}"></label><output for="${id}"></output></div>
      <input type="range" id="${id}" min="0" max="1000" step="1" aria-describedby="${id}-told"><p class="told" id="${id}-told"></p>`;
    box.querySelector("label").textContent = about.label;
    this.input = box.querySelector("input");
    this.output = box.querySelector("output");
    this.told = box.querySelector(".told");
    this.told.textContent = about.told;
    this.touched = 0;
    this.input.addEventListener("input", () => {
      this.touched = performance.now();
      const value = this.value();
      this.write(value);
      wish({ do: "set", name: about.name, value });
    });
    at("sliders").append(box);
  }

  value() {
    const { low, high, is_log, is_whole } = this.about, share = this.input.valueAsNumber / 1000;
    const value = is_log ? low * (high / low) ** share : low + share * (high - low);
    const exact = Math.min(high, Math.max(low, Number(value.toPrecision(4))));
    return is_whole ? Math.round(exact) : exact;
  }

  write(value) {
    const words = spelled(value, this.about.unit);
    this.output.textContent = words;
    this.input.setAttribute("aria-valuetext", words);
  }

  // What the world has, unless a hand is on it.
  show(value) {
    const patience = document.activeElement === this.input ? 5000 : 600;
    if (performance.now() - this.touched < patience) return;
    const { low, high, is_log } = this.about;
    if (value !== null) {
      const share = is_log ? Math.log(value / low) / Math.log(high / low) : (value - low) / (high - low);
      this.input.value = Math.round(1000 * Math.min(1, Math.max(0, share)));
    }
    this.write(value);
  }
}

const waves = nu => (1 - nu) / ((1 + nu) * (1 - 2 * nu));

export class Panel {
  constructor(hello, wish, picture) {
    this.wish = wish;
    at("sliders").querySelectorAll(".slider").forEach(each => each.remove());
    this.sliders = new Map(hello.sliders.map(about => [about.name, new Slider(about, wish)]));
    for (const name of ["young", "poisson", "substeps"]) {
      this.sliders.get(name).input.addEventListener("input", () => this.warn());
    }
    fill(at("law"), hello.laws.map(law => [law.name, `${law.name}: ${law.about}`]));
    fill(at("preset"), Object.keys(hello.presets).map(name => [name, name.replaceAll("_", " ")]));
    at("preset").onchange = () => {
      for (const [name, value] of Object.entries(hello.presets[at("preset").value] ?? {})) wish({ do: "set", name, value });
    };
    fill(at("tint"), hello.quantities.map(name => [name, name]));
    const chosen = () => Object.fromEntries(["law", "strain", "flips"].map(id => [id, at(id).value || null]));
    const on = (id, name, call) => { at(id)[`on${name}`] = call; };
    on("pause", "click", () => wish({ do: "pause", is_paused: at("pause").getAttribute("aria-pressed") !== "true" }));
    on("step", "click", () => wish({ do: "step" }));
    on("reset", "click", () => wish({ do: "reset" }));
    on("choose", "click", () => wish({ do: "choose", ...chosen() }));
    on("compare", "click", () => wish({ do: "compare", ...chosen() }));
    on("alone", "click", () => wish({ do: "alone" }));
    on("tint", "change", () => wish({ do: "tint", quantity: at("tint").value || null }));
    on("despawn", "click", () => wish({ do: "despawn" }));
    on("film", "click", () => wish({ do: "save", what: "film" }));
    on("script", "click", () => wish({ do: "save", what: "script" }));
    on("shot", "click", () => picture.shot());
    on("upload", "change", () => this.upload(hello.limit));
    on("fold", "click", () => {
      const isOpen = !document.body.classList.toggle("folded");
      at("fold").setAttribute("aria-expanded", isOpen);
      at("fold").textContent = isOpen ? "hide controls" : "show controls";
    });
    const energies = [["kinetic", "#b45309"], ["elastic", "#0b6b74"], ["potential", "#5b61a8"]];
    this.plots = [new Plot(at("plot"), energies, "J"), new Plot(at("momentum"), [["momentum", "#7c3a68"]], "N s")];
    if (hello.is_view) document.body.classList.add("view");
  }

  async upload(limit) {
    const file = at("upload").files[0];
    if (!file) return;
    if (file.size > limit) this.refuse(`${file.name} has ${file.size.toLocaleString()} bytes: ${limit.toLocaleString()} are taken`);
    else { this.wish({ do: "upload", name: file.name, up: at("up").value || null }); this.wish(await file.arrayBuffer()); }
    at("upload").value = "";
  }

  // A change of stiffness that needs more substeps than there are is said before it is felt.
  warn() {
    const state = this.state, sliders = this.sliders;
    if (!state) return;
    const young = sliders.get("young").value(), nu = sliders.get("poisson").value(), has = state.values;
    let needed = state.stable;
    if (has.young !== null && has.poisson !== null) {
      needed = Math.ceil(state.stable * Math.sqrt((young * waves(nu)) / (has.young * waves(has.poisson))) - 1e-9);
    }
    const isTouched = performance.now() - sliders.get("substeps").touched < 600;
    const given = isTouched ? sliders.get("substeps").value() : state.given ?? Math.max(needed, state.values.substeps);
    const told = sliders.get("substeps").told;
    const isShort = given < needed;
    told.classList.toggle("unstable", isShort);
    told.textContent = isShort ? `unstable: this material needs ${needed}` : `this material needs ${needed}; a step takes about ${cost(state, given)} ms`;
  }

  show(state, pane) {
    if (pane !== 0) return;
    this.state = state;
    for (const [name, slider] of this.sliders) slider.show(state.values[name]);
    this.warn();
    at("pause").setAttribute("aria-pressed", state.is_paused);
    at("pause").textContent = state.is_paused ? "play" : "pause";
    at("step-ms").textContent = `${state.step_ms[0].toFixed(1)} ms`;
    at("step-ms").title = `99th percentile ${state.step_ms[1].toFixed(1)} ms`;
    at("factor").textContent = `${state.factor.toFixed(2)} x`;
    at("time").textContent = `${state.time.toFixed(2)} s`;
    const share = (state.step_ms[0] / 1e3 / state.dt);
    at("budget").style.width = `${Math.min(100, 100 * share)}%`;
    at("budget").classList.toggle("over", share > 1);
    this.showPalette(state.palette);
    for (const plot of this.plots) plot.put(state.time, state.energies);
    const e = state.energies;
    if (e.kinetic !== undefined) {
      at("energies").textContent = `kinetic ${joules(e.kinetic)}, elastic ${joules(e.elastic)}, momentum ${Number(e.momentum.toPrecision(3))} N s`;
    }
    at("scale").hidden = !state.scale;
    if (state.scale) {
      at("scale-name").textContent = state.scale.quantity;
      at("scale-high").textContent = spelled(state.scale.high, state.scale.unit);
    }
  }

  showPalette(names) {
    if (at("palette").dataset.names === names.join()) return;
    at("palette").dataset.names = names.join();
    at("palette").replaceChildren(...names.map(name => {
      const button = document.createElement("button");
      button.type = "button";
      button.textContent = name;
      button.setAttribute("aria-label", `add a ${name}`);
      button.onclick = () => this.wish({ do: "spawn", name });
      return button;
    }));
  }

  chosen(choice, tint) {
    for (const id of ["law", "strain", "flips"]) {
      if (document.activeElement !== at(id) && this.last?.[id] !== choice[id]) at(id).value = choice[id] ?? "";
    }
    this.last = choice;
    if (document.activeElement !== at("tint")) at("tint").value = tint ?? "";
  }

  say(words, isRefused = false) {
    at("said").textContent = words;
    at("said").classList.toggle("refused", isRefused);
    clearTimeout(this.fading);
    this.fading = setTimeout(() => { at("said").textContent = ""; }, isRefused ? 12000 : 6000);
  }

  refuse(words) { this.say(words, true); }

  offer(address, name) {
    const link = document.createElement("a");
    link.href = address; link.download = name; link.textContent = `save ${name}`;
    at("made").replaceChildren(link);
    link.click();
  }
}

const cost = (state, substeps) => (state.step_ms[0] * (substeps / state.values.substeps)).toFixed(1);
const joules = value => `${Number(value.toPrecision(3))} J`;

function fill(select, rows) {
  while (select.options.length > 1) select.remove(1);
  for (const [value, text] of rows) select.add(new Option(text, value));
}

// Numbers over the last seconds: lines of [name, colour], in one unit.
class Plot {
  constructor(canvas, lines, unit) { this.canvas = canvas; this.lines = lines; this.unit = unit; this.rows = []; }

  put(time, energies) {
    if (energies.kinetic === undefined) return;
    const last = this.rows.at(-1);
    if (last && time < last.time) this.rows = [];
    if (last && time === last.time) return;
    this.rows.push({ time, ...energies });
    while (this.rows.length > 100) this.rows.shift();
    this.draw();
  }

  draw() {
    const { canvas, rows } = this, scale = devicePixelRatio;
    const width = (canvas.width = canvas.clientWidth * scale), height = (canvas.height = canvas.clientHeight * scale);
    const pen = canvas.getContext("2d");
    const { lines, unit } = this;
    const least = Math.min(0, ...rows.flatMap(r => lines.map(([k]) => r[k]))), most = Math.max(1e-9, ...rows.flatMap(r => lines.map(([k]) => r[k])));
    const x = t => ((t - rows[0].time) / Math.max(1e-9, rows.at(-1).time - rows[0].time)) * width;
    const y = v => height - 4 - ((v - least) / (most - least)) * (height - 22 * scale);
    pen.font = `${12 * scale}px system-ui`;
    lines.forEach(([key, color], i) => {
      pen.strokeStyle = pen.fillStyle = color;
      pen.lineWidth = 2 * scale;
      pen.beginPath();
      rows.forEach((r, k) => (k ? pen.lineTo(x(r.time), y(r[key])) : pen.moveTo(x(r.time), y(r[key]))));
      pen.stroke();
      pen.fillText(key, (8 + 62 * i) * scale, 12 * scale);
    });
    pen.fillStyle = "#4a5866";
    pen.fillText(`${Number(most.toPrecision(3))} ${unit}`, width - 80 * scale, 12 * scale);
  }
}
