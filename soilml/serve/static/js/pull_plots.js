// Drawbar pull and slope against slip, with bands of the log and of the prior.

import { element, fold, wordList } from "./dom.js";
import { number, range, withUnit } from "./format.js";
import { Plot, sweepPlots } from "./plots.js";

/** Draw a prediction into an element: curves by load, a rover's tables, or why there is none. */
export function pullPlots(place, pull) {
  if (pull.reason) return place.replaceChildren(element("p", { class: "remark" }, pull.reason));
  if (pull.text) return place.replaceChildren(element("pre", { tabindex: "0" }, pull.text));
  const view = element("div");
  const choose = element("select", { id: "pull-load" },
    ...pull.loads.map((one, i) => element("option", { value: String(i) }, `${one.gear ? `${one.gear}, ` : ""}${number(one.load)} N`)));
  const most = element("p", { class: "facts" });
  const choice = element("div", { class: "buttons" }, element("label", { for: "pull-load" }, pull.loads[0].gear ? "Wheel and load" : "Load"), choose);
  place.replaceChildren(most, fold("Drawbar pull and slope against slip", choice, view, wordList(pull.warnings, "soft")));
  const show = () => draw(view, most, pull, Number(choose.value));
  choose.addEventListener("change", show);
  return show();
}

function draw(view, most, pull, index) {
  const one = pull.loads[index];
  const figure = (title, unit) => {
    const reading = element("span", { class: "reading" }), plot = element("div", { class: "plot" });
    return { reading, plot, whole: element("figure", {}, element("figcaption", {}, element("h3", {}, `${title} `, element("span", { class: "unit" }, unit)), reading), plot) };
  };
  const left = figure("Drawbar pull", "N"), right = figure("Slope that is climbed", "°");
  const [pullKnown, slopeKnown] = one.known;
  most.replaceChildren(
    element("span", {}, answer(`Largest pull under ${number(one.load)} N`, one.largest_pull, "N", pullKnown, ` at slip ${number(one.best_slip[1], 2)}`)),
    element("span", {}, answer("steepest slope", one.steepest_slope, "°", slopeKnown, "")));
  view.replaceChildren(...[wordList(one.warnings, "remark")].filter(Boolean),
    element("div", { class: "pair" }, left.whole, right.whole),
    element("p", { class: "key", "aria-hidden": "true" }, element("span", { class: "k-posterior" }, "after the log, 90 % band"),
      element("span", { class: "k-prior" }, "before the log, 90 % band"), element("span", { class: "k-measured" }, "measured")));
  const { slip, load, pull: values } = one.measured ?? pull.measured;
  const points = slip.map((s, i) => [s, load[i], values[i]]).filter(([, l]) => Math.abs(l / one.load - 1) < 0.1);
  curves(left, "N", one.slip, one.pull, one.prior_pull, points, `Drawbar pull against slip under ${number(one.load)} N`);
  curves(right, "°", one.slip, one.slope, one.prior_slope, [], `Slope against slip under ${number(one.load)} N`);
  sweepPlots();
}

function answer(name, [low, middle, high], unit, known, where) {
  return known
    ? `${name}: ${withUnit(middle, unit)} (90 %: ${range(low, high, unit)})${where}`
    : `${name}: not determined`;
}

function curves(figure, unit, slip, [low, middle, high], [before, , after], points, description) {
  const plot = new Plot(figure.plot, {
    x: "slip", y: null, reading: figure.reading,
    series: [
      { label: "median", colour: "pull", unit, width: 2.5 },
      { label: "5 %", colour: "pull", width: 0.8 }, { label: "95 %", colour: "pull", width: 0.8 },
      { label: "before 5 %", colour: "held", width: 1.2, dash: [5, 4] }, { label: "before 95 %", colour: "held", width: 1.2, dash: [5, 4] },
      { label: "measured", colour: "ink", unit, points: true },
    ],
    bands: [[3, 2, "pull", 0.22]],
  });
  const x = [...new Set([...slip, ...points.map(([s]) => s)])].sort((a, b) => a - b);
  const at = new Map(slip.map((s, i) => [s, i]));
  const own = new Map(points.map(([s, , value]) => [s, value]));
  const line = (values) => x.map((s, k) => (at.has(s) ? values[at.get(s)] : between(x[k], slip, values)));
  plot.set([x, line(middle), line(low), line(high), line(before), line(after), x.map((s) => own.get(s) ?? null)], null, description);
}

/** Linear between the points of a curve; nothing outside. */
function between(s, slip, values) {
  const i = slip.findIndex((v) => v > s);
  if (i <= 0 || values[i] === null || values[i - 1] === null) return null;
  const share = (s - slip[i - 1]) / (slip[i] - slip[i - 1]);
  return values[i - 1] + share * (values[i] - values[i - 1]);
}
