import { quantity } from "./quantity.js";

// Plots numbers over the last seconds, all in one unit. Each line is [name, colour].
export class Plot {
  constructor(canvas, list, lines, unit) {
    this.canvas = canvas; this.lines = lines; this.unit = unit; this.rows = [];
    this.values = new Map(lines.map(([name, color]) => {
      const term = document.createElement("dt"), value = document.createElement("dd");
      term.textContent = name[0].toUpperCase() + name.slice(1);
      term.style.setProperty("--color", color);
      value.textContent = "–";
      list.append(term, value);
      return [name, value];
    }));
  }

  put(time, energies) {
    if (energies.kinetic === undefined) return;
    for (const [name, value] of this.values) value.textContent = quantity(energies[name], this.unit);
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
    const { lines } = this;
    const least = Math.min(0, ...rows.flatMap(r => lines.map(([k]) => r[k]))), most = Math.max(1e-9, ...rows.flatMap(r => lines.map(([k]) => r[k])));
    const x = t => ((t - rows[0].time) / Math.max(1e-9, rows.at(-1).time - rows[0].time)) * width;
    const y = v => height - 4 - ((v - least) / (most - least)) * (height - 8);
    lines.forEach(([key, color]) => {
      pen.strokeStyle = color;
      pen.lineWidth = 2 * scale;
      pen.beginPath();
      rows.forEach((r, k) => (k ? pen.lineTo(x(r.time), y(r[key])) : pen.moveTo(x(r.time), y(r[key]))));
      pen.stroke();
    });
  }
}
