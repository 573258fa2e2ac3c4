// Plots in the colours of the page, redrawn where its width or its colours change.

import uPlot from "../vendor/uPlot.esm.js";
import { number, withUnit } from "./format.js";

const HEIGHT = 210;
const all = new Set();

export const colour = (name) =>
  getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();

/**
 * A plot in an element. `series` are { label, colour, unit, dash, width }.
 */
export class Plot {
  constructor(place, { x, y, series, height = HEIGHT, reading = null }) {
    Object.assign(this, { place, x, y, series, height, reading });
    this.data = [[], ...series.map(() => [])];
    this.marker = null;
    this.plot = null;
    place.setAttribute("role", "img");
    new ResizeObserver(() => this.resize()).observe(place);
    all.add(this);
    this.build();
  }

  build() {
    this.plot?.destroy();
    const axis = (label, size) => ({
      label, labelSize: 20, size, labelGap: 0, gap: 3, font: "12px system-ui, sans-serif",
      labelFont: "12px system-ui, sans-serif", stroke: colour("soft"),
      grid: { stroke: colour("grid"), width: 1 }, ticks: { show: false },
      values: (_, ticks) => ticks.map((tick) => number(tick, 4)),
    });
    const first = { label: this.x };
    const lines = this.series.map((s) => ({
      label: s.label, stroke: colour(s.colour), width: s.width ?? 2, dash: s.dash,
      pxAlign: 0, points: { show: false },
    }));
    this.plot = new uPlot({
      width: this.width(), height: this.height, padding: [10, 14, 0, 0], pxAlign: 0,
      legend: { show: false }, scales: { x: { time: false } },
      cursor: { y: false, drag: { x: false, y: false }, points: { size: 6 } },
      series: [first, ...lines], axes: [axis(this.x, 26), axis(this.y, 46)],
      hooks: { draw: [(u) => this.drawMarker(u)], setCursor: [(u) => this.read(u)] },
    }, this.data, this.place);
  }

  width() {
    return Math.max(160, Math.floor(this.place.clientWidth));
  }

  resize() {
    if (this.plot && this.plot.width !== this.width()) {
      this.plot.setSize({ width: this.width(), height: this.height });
    }
  }

  /** New numbers: an array for x and one for each series; the present point [x, y, colour]. */
  set(data, marker, description) {
    this.data = data;
    this.marker = marker ?? null;
    this.plot.setData(data);
    if (description) this.place.setAttribute("aria-label", description);
  }

  drawMarker(u) {
    if (!this.marker || this.marker[1] === null) return;
    const [x, y, name] = this.marker;
    const ctx = u.ctx, dot = devicePixelRatio || 1;
    ctx.save();
    ctx.beginPath();
    ctx.setLineDash([]); // what drew the lines may leave dashes behind
    ctx.arc(u.valToPos(x, "x", true), u.valToPos(y, "y", true), 5 * dot, 0, 2 * Math.PI);
    ctx.fillStyle = colour(name);
    ctx.strokeStyle = colour("panel");
    ctx.lineWidth = 2 * dot;
    ctx.fill();
    ctx.stroke();
    ctx.restore();
  }

  read(u) {
    if (!this.reading) return;
    const i = u.cursor.idx;
    const over = u.cursor.left >= 0 && i !== null && i !== undefined;
    this.reading.textContent = over ? this.readingAt(i) : "";
  }

  readingAt(i) {
    const parts = this.series
      .map((s, k) => [s, this.data[k + 1][i]])
      .filter(([s, v]) => s.unit !== undefined && v !== null && v !== undefined)
      .map(([s, v]) => `${s.label ? `${s.label} ` : ""}${withUnit(v, s.unit)}`);
    return parts.length ? `${this.x.split(" (")[0]} ${number(this.data[0][i])}: ${parts.join(", ")}` : "";
  }
}

matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
  for (const plot of all) plot.build();
});
