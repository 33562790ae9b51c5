import { quantity } from "./quantity.js";

// Time for which a control keeps the user's value [ms]. The server confirms a value only some frames later.
export const PATIENCE = 1500;

export class Slider {
  constructor(about, ask) {
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
    this.touched = -PATIENCE;
    this.input.addEventListener("input", () => {
      this.touched = performance.now();
      const value = this.value();
      this.write(value);
      ask({ do: "set", name: about.name, value });
    });
    document.getElementById("sliders").append(box);
  }

  value() {
    const { low, high, is_log, is_whole } = this.about, share = this.input.valueAsNumber / 1000;
    const value = is_log ? low * (high / low) ** share : low + share * (high - low);
    const exact = Math.min(high, Math.max(low, Number(value.toPrecision(4))));
    return is_whole ? Math.round(exact) : exact;
  }

  write(value) {
    const words = quantity(value, this.about.unit);
    this.output.textContent = words;
    this.input.setAttribute("aria-valuetext", words);
  }

  // Show the world's value, unless the user is moving the slider.
  show(value) {
    if (performance.now() - this.touched < PATIENCE) return;
    const { low, high, is_log } = this.about;
    if (value !== null) {
      const share = is_log ? Math.log(value / low) / Math.log(high / low) : (value - low) / (high - low);
      this.input.value = Math.round(1000 * Math.min(1, Math.max(0, share)));
    }
    this.write(value);
  }
}
