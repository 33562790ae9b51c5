// The controls. They are plain HTML, so that keyboards and screen readers can use them.
import { Plot } from "./plot.js";
import { quantity } from "./quantity.js";
import { PATIENCE, Slider } from "./slider.js";

const at = id => document.getElementById(id);
const CHOICE = ["law", "strain", "flips"];
const waves = nu => (1 - nu) / ((1 + nu) * (1 - 2 * nu));

export class Panel {
  constructor(hello, ask, view) {
    this.ask = ask;
    at("sliders").querySelectorAll(".slider").forEach(each => each.remove());
    this.sliders = new Map(hello.sliders.map(about => [about.name, new Slider(about, ask)]));
    for (const name of ["young", "poisson", "substeps"]) {
      this.sliders.get(name).input.addEventListener("input", () => this.warn());
    }
    fill(at("law"), hello.laws.map(law => [law.name, `${law.name}: ${law.about}`]));
    fill(at("preset"), hello.presets.map(name => [name, name.replaceAll("_", " ")]));
    fill(at("tint"), hello.quantities.map(name => [name, name]));
    this.touched = new Map();
    this.isEdited = false;
    this.connect(view, hello.limit);
    const energies = [["kinetic", "#b45309"], ["elastic", "#0b6b74"], ["potential", "#5b61a8"]];
    this.plots = [
      new Plot(at("plot"), at("energies"), energies, "J"),
      new Plot(at("momentum"), at("momenta"), [["momentum", "#7c3a68"]], "N s"),
    ];
    if (hello.is_view) document.body.classList.add("attached");
  }

  connect(view, limit) {
    const { ask } = this;
    const on = (id, name, call) => { at(id)[`on${name}`] = call; };
    const choose = how => {
      ask({ do: how, ...Object.fromEntries(CHOICE.map(id => [id, at(id).value || null])) });
      this.isEdited = false;
      CHOICE.forEach(id => this.touched.set(id, performance.now()));
    };
    const pick = (id, request) => on(id, "change", () => {
      this.touched.set(id, performance.now());
      ask(request(at(id).value || null));
    });
    on("pause", "click", () => ask({ do: "pause", is_paused: at("pause").getAttribute("aria-pressed") !== "true" }));
    on("step", "click", () => ask({ do: "step" }));
    on("reset", "click", () => { this.release(); ask({ do: "reset" }); });
    on("undo", "click", () => { this.release(); ask({ do: "undo" }); });
    on("frame", "click", () => view.frameAll());
    on("choose", "click", () => choose("choose"));
    on("compare", "click", () => choose("compare"));
    on("alone", "click", () => ask({ do: "alone" }));
    for (const id of CHOICE) on(id, "change", () => { this.isEdited = true; });
    pick("tint", quantity => ({ do: "tint", quantity }));
    pick("preset", name => { this.release(); return { do: "preset", name }; });
    on("despawn", "click", () => ask({ do: "despawn" }));
    on("film", "click", () => ask({ do: "save", what: "film" }));
    on("script", "click", () => ask({ do: "save", what: "script" }));
    on("shot", "click", () => view.shot());
    on("upload", "change", () => this.upload(limit));
    on("fold", "click", () => fold(!document.body.classList.contains("folded")));
    fold(matchMedia("(max-width: 760px)").matches);
    document.onkeydown = event => {
      if (event.ctrlKey || event.metaKey ? event.key !== "z" : event.key.toLowerCase() !== "f") return;
      if (event.altKey || event.target.matches("select")) return;
      event.preventDefault();
      at(event.key === "z" ? "undo" : "frame").click();
    };
  }

  // Show the world's values on all sliders immediately, even on a slider that the user just moved.
  release() { for (const slider of this.sliders.values()) slider.touched = -PATIENCE; }

  async upload(limit) {
    const file = at("upload").files[0];
    if (!file) return;
    if (file.size > limit) this.say(`${file.name} has ${file.size.toLocaleString()} bytes: at most ${limit.toLocaleString()} are accepted`, true);
    else { this.ask({ do: "upload", name: file.name, up: at("up").value || null }); this.ask(await file.arrayBuffer()); }
    at("upload").value = "";
  }

  // Warn of a material that needs more substeps than the slider's value, before the bodies become unstable.
  warn() {
    const state = this.state, sliders = this.sliders;
    if (!state) return;
    const young = sliders.get("young").value(), nu = sliders.get("poisson").value(), has = state.values;
    let needed = state.stable;
    if (has.young !== null && has.poisson !== null) {
      needed = Math.ceil(state.stable * Math.sqrt((young * waves(nu)) / (has.young * waves(has.poisson))) - 1e-9);
    }
    const isTouched = performance.now() - sliders.get("substeps").touched < PATIENCE;
    const given = isTouched ? sliders.get("substeps").value() : state.given.substeps ?? Math.max(needed, state.values.substeps);
    const told = sliders.get("substeps").told;
    const isShort = given < needed;
    told.classList.toggle("unstable", isShort);
    told.textContent = isShort ? `unstable: this material needs ${needed}` : `this material needs ${needed}; a step takes ${cost(state, given)} ms`;
  }

  show(message) {
    if (message.pane !== 0) return;
    const state = (this.state = message.state);
    for (const [name, slider] of this.sliders) slider.show(state.values[name]);
    this.warn();
    at("controls").disabled = false;
    at("pause").setAttribute("aria-pressed", state.is_paused);
    at("pause").textContent = state.is_paused ? "Play" : "Pause";
    at("undo").disabled = !state.undo;
    at("undo").title = state.undo ? `Undo: ${state.undo}` : "Nothing to undo";
    at("step-ms").textContent = `${state.step_ms[0].toFixed(1)} ms`;
    at("step-ms").title = `99th percentile ${state.step_ms[1].toFixed(1)} ms`;
    at("factor").textContent = `${state.factor.toFixed(2)} x`;
    at("time").textContent = `${state.time.toFixed(state.time < 1000 ? 2 : 0)} s`;
    const share = state.step_ms[0] / 1e3 / state.dt;
    at("budget").style.width = `${Math.min(100, 100 * share)}%`;
    at("budget").classList.toggle("over", share > 1);
    this.showPalette(state.palette);
    for (const plot of this.plots) plot.put(state.time, state.energies);
    at("scale").hidden = !state.scale;
    if (state.scale) {
      at("scale-name").textContent = state.scale.quantity;
      at("scale-high").textContent = quantity(state.scale.high, state.scale.unit);
    }
    this.follow("tint", message.tint);
    this.follow("preset", state.preset);
    // Show the law that others chose or that remains after a refusal. Keep a selection that is not applied yet.
    const choice = message.coming ?? message.chosen;
    if (!this.isEdited) for (const id of CHOICE) this.follow(id, choice[id]);
  }

  follow(id, value) {
    if (performance.now() - (this.touched.get(id) ?? -PATIENCE) > PATIENCE) at(id).value = value ?? "";
  }

  showPalette(names) {
    if (at("palette").dataset.names === names.join()) return;
    at("palette").dataset.names = names.join();
    at("palette").replaceChildren(...names.map(name => {
      const button = document.createElement("button");
      button.type = "button";
      button.textContent = name;
      button.setAttribute("aria-label", `add a ${name}`);
      button.onclick = () => this.ask({ do: "spawn", name });
      return button;
    }));
  }

  say(words, isRefused = false) {
    at("said").textContent = words;
    at("said").classList.toggle("refused", isRefused);
    clearTimeout(this.fading);
    this.fading = setTimeout(() => { at("said").textContent = this.trouble ?? ""; }, isRefused ? 12000 : 8000);
  }

  // Show a text and disable the controls; null clears the text.
  stop(words) {
    const before = this.trouble;
    this.trouble = words;
    if (words) { this.say(words, true); at("controls").disabled = true; }
    else if (before) this.say("");
  }

  offer(address, name) {
    const link = document.createElement("a");
    link.href = address; link.download = name; link.textContent = `save ${name}`;
    at("made").replaceChildren(link);
    link.click();
  }
}

function fold(isFolded) {
  document.body.classList.toggle("folded", isFolded);
  at("fold").setAttribute("aria-expanded", !isFolded);
  at("fold").textContent = isFolded ? "Show controls" : "Hide controls";
}

const cost = (state, substeps) => (state.step_ms[0] * (substeps / state.values.substeps)).toFixed(1);

function fill(select, rows) {
  while (select.options.length > 1) select.remove(1);
  for (const [value, text] of rows) select.add(new Option(text, value));
}
