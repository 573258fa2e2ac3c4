// Plots in the colours of the page, redrawn where its width or its colours change.

import uPlot from "../vendor/uPlot.esm.js";
import { number, withUnit } from "./format.js";

const HEIGHT = 210;
const all = new Set();

export const colour = (name) =>
  getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();

/**
 * A plot in an element. `series` are { label, colour, dash, width, points, fill }, `bands` are
 * [upper, lower, colour] by the numbers of series; `marker` is a colour of a dot at the present
 * point; with `zero` the axis of y begins there.
 */
export class Plot {
  constructor(place, { x, y, series, bands = [], height = HEIGHT, reading = null, ticks = null, zero = false }) {
    Object.assign(this, { place, x, y, series, bands, height, reading, ticks, zero });
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
      paths: s.points ? () => null : undefined, pxAlign: 0, spanGaps: !!s.points,
      points: { show: !!s.points, size: 7, fill: colour(s.colour), stroke: colour("panel") },
    }));
    const bands = this.bands.map(([upper, lower, name, share]) => ({
      series: [upper, lower], fill: withAlpha(colour(name), share ?? 0.2),
    }));
    this.plot = new uPlot({
      width: this.width(), height: this.height, padding: [10, 14, 0, 0], pxAlign: 0,
      legend: { show: false }, scales: { x: { time: false }, ...(this.zero ? { y: { range: (_, low, high) => [Math.min(0, low), 1.08 * Math.max(0, high) || 1] } } : {}) },
      cursor: { y: false, drag: { x: false, y: false }, points: { size: 6 } },
      series: [first, ...lines], bands, axes: [axis(this.x, 26), axis(this.y, 46)],
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

  remove() {
    all.delete(this);
    this.plot?.destroy();
  }
}

function withAlpha(name, share) {
  const probe = /^#(..)(..)(..)$/.exec(name);
  if (!probe) return name;
  const [r, g, b] = probe.slice(1).map((part) => parseInt(part, 16));
  return `rgba(${r}, ${g}, ${b}, ${share})`;
}

/** Forget the plots of elements that are no longer in the page. */
export function sweepPlots() {
  for (const plot of [...all]) if (!plot.place.isConnected) plot.remove();
}

matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
  sweepPlots();
  for (const plot of all) plot.build();
});
