// A slider with a number beside it: both say the same, and what is wrong stands below them.

import { element } from "./dom.js";
import { number, withUnit } from "./format.js";

const STEPS = 1000;

/** A control as the server describes it; `changed(path, value)` is told values in SI units. */
export class Slider {
  constructor(control, changed) {
    Object.assign(this, control);
    this.changed = changed;
    this.first = control.value;
    this.value = control.value;
    const id = `s-${this.path.replace(/[^\w]/g, "-")}`;
    const name = this.unit ? `${this.label} in ${this.unit}` : this.label;
    this.number = element("input", {
      type: "number", id, step: "any", inputmode: "decimal", "aria-describedby": `${id}-error`,
      oninput: () => this.typed(),
      onchange: () => this.settle(),
    });
    this.range = element("input", {
      type: "range", min: "0", max: String(STEPS), step: "1", "aria-label": `${name}, slider`,
      oninput: () => this.slid(),
    });
    this.error = element("p", { class: "error", id: `${id}-error`, role: "alert", hidden: true });
    this.place = element("div", { class: "slider" },
      element("label", { for: id }, `${this.label} `,
        element("span", { class: "symbol" }, this.symbol)),
      element("span", { class: "typed" }, this.number,
        element("span", { class: "unit" }, this.unit)),
      this.range, this.error,
      this.text && this.text !== this.label ? element("p", { class: "note" }, this.text) : null);
    this.show();
  }

  get shown() {
    return this.value * this.factor;
  }

  position(shown) {
    const { min, max } = this;
    const share = this.log
      ? Math.log(Math.max(shown, min) / min) / Math.log(max / min)
      : (shown - min) / (max - min);
    return Math.round(STEPS * Math.min(1, Math.max(0, share)));
  }

  at(position) {
    const { min, max } = this, share = position / STEPS;
    const shown = this.log ? min * (max / min) ** share : min + (max - min) * share;
    return Number(shown.toPrecision(3));
  }

  show(typed = false) {
    if (!typed) this.number.value = String(Number(this.shown.toPrecision(4)));
    this.range.value = String(this.position(this.shown));
    this.range.setAttribute("aria-valuetext", withUnit(this.shown, this.unit));
  }

  typed() {
    const shown = this.number.valueAsNumber;
    const { least, most, unit } = this;
    if (!Number.isFinite(shown)) return this.fail(`${this.label}: needed is a number`);
    if (shown < least || shown > most) {
      const ends = `${number(least, 4)} and ${withUnit(most, unit, 4)}`;
      return this.fail(`${withUnit(shown, unit, 4)} given; needed is a value between ${ends}`);
    }
    this.fail("");
    this.value = shown / this.factor;
    this.show(true);
    return this.changed(this);
  }

  settle() {
    if (!this.error.textContent) this.show();
  }

  slid() {
    this.fail("");
    this.value = this.at(Number(this.range.value)) / this.factor;
    this.show();
    this.changed(this);
  }

  set(value) {
    this.value = value;
    this.fail("");
    this.show();
  }

  fail(text) {
    this.error.textContent = text;
    this.error.hidden = !text;
    if (text) this.number.setAttribute("aria-invalid", "true");
    else this.number.removeAttribute("aria-invalid");
  }
}
