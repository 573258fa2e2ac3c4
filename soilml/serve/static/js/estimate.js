// The soil from a table of runs: bands against the prior, abstentions in words, what to drive next.

import { jobFile } from "./api.js";
import { byId, drawn, element, fold, options, showError, wordList } from "./dom.js";
import { setRadius, setSoil, showReadings, wheelIsKnown } from "./forward.js";
import { counted, number, percent, range, withUnit } from "./format.js";
import { work } from "./jobs.js";
import { clearModelFault, modelFault, modelIsOwn, modelOfEstimate } from "./model_box.js";
import { pullPlots } from "./pull_plots.js";
import { sweepPlots } from "./plots.js";
import { askForWheel } from "./wheel_question.js";

const ALL = "";
const current = { file: null, sheet: "", name: "" };

/** The table that estimates and gaps are made from: its key, and the run that is chosen. */
export const currentTable = () => (current.file ? { files: [current.file], sheet: current.sheet || null, run: byId("run").value } : null);

/** The name of that table as the commands take it; empty without one. */
export const currentName = () => (current.file ? current.name + (current.sheet ? `#${current.sheet}` : "") : "");

export function startEstimate() {
  byId("estimate-start").addEventListener("click", estimate);
}

/** Take a table: show it, then estimate. */
export async function takeTable(file, sheet, table, links = null) {
  Object.assign(current, { file, sheet, name: table.name.split("#")[0] });
  dispatchEvent(new Event("table"));
  const wheel = modelIsOwn() ? "" : setRadius(table.radius);
  if (wheel) table = { ...table, remarks: [...table.remarks, wheel] };
  showTable(table, links);
  showReadings(table);
  options(byId("run"), [{ id: ALL, label: "all rows, as one soil" }, ...table.runs.map((run) => ({ id: run, label: `run ${run}` }))], ALL);
  byId("estimate-empty").hidden = true;
  byId("estimate-result").replaceChildren();
  byId("gap-result").replaceChildren();
  const known = modelIsOwn() || wheelIsKnown();
  ready(known);
  if (known) await estimate();
  else askForWheel(table.name, wheelAnswered);
}

/** The wheel of the table is known now: by an answer, or by a model file. */
export async function wheelAnswered() {
  if (!current.file || byId("estimate-actions").hidden === false) return;
  byId("ask-wheel").hidden = true;
  ready(true);
  await estimate();
}

/** Whether the estimate and the gap can be asked for. */
function ready(known) {
  byId("estimate-actions").hidden = !known;
  byId("gap-start").disabled = !known;
  byId("gap-empty").hidden = known;
  byId("gap-empty").textContent = "needs the wheel";
}

function showTable(table, links) {
  const fact = (name, value) => element("span", {}, `${name} `, element("b", {}, value));
  byId("table-panel").replaceChildren(
    element("h3", {}, `Table of runs: ${table.name}`),
    element("p", { class: "facts" },
      fact("rows", String(table.rows)), fact("runs", String(table.runs.length)),
      fact("slip", range(...table.slip, "")), fact("load", range(...table.load, "N")),
      fact("measured", table.measured.join(", "))),
    ...[wordList(table.remarks, "remark"), links].filter(Boolean));
  byId("table-panel").hidden = false;
}

async function estimate() {
  showError("estimate-error", "");
  clearModelFault();
  const button = byId("estimate-start");
  button.disabled = true;
  try {
    const done = await work("estimate-job", { kind: "estimate", ...currentTable(), model: modelOfEstimate() });
    if (done) show(done);
  } catch (error) {
    byId("estimate-result").replaceChildren();
    if (!modelFault(error.message)) showError("estimate-error", error.message);
  } finally {
    button.disabled = false;
  }
}

function show({ id, result }) {
  const values = Object.fromEntries(result.parameters.map((p) => [p.path, p.si]));
  const place = byId("estimate-result");
  const pull = element("div", { id: "pull-result" });
  const unknown = result.parameters.filter((p) => !p.identified).map((p) => p.label);
  place.replaceChildren(...[
    element("p", { class: "sentence" }, unknown.length
      ? `These rows do not determine ${unknown.join(" and ")}.`
      : `${counted(result.used, "row")} determine the soil${weakly(result.parameters)}.`),
    element("div", { class: "bands" }, ...result.parameters.map(band)),
    result.next ? element("p", { class: "next" }, element("b", {}, "Drive next: "), result.next) : null,
    wordList([...result.remarks, ...result.warnings], "remark"),
    pull,
    fold("How sure this is", element("p", { class: "soft" }, `${counted(result.used, "row")} (${result.channels.join(", ")}). Grey: the prior. Blue: the 90 % interval after the log, averaged over explanations of the rows${explained(result.explanations)}.`),
      sureness(result.parameters), wordList(result.words.slice(0, -1))),
    element("div", { class: "buttons" },
      element("button", { type: "button", id: "use-soil", onclick: () => {
        setSoil(values);
        byId("forward").scrollIntoView();
      } }, "Show this soil in the forward model"),
      element("a", { class: "button", href: jobFile(id, "model.toml") }, "Save MODEL.toml"),
      element("a", { class: "button", href: jobFile(id, "identify.json") }, "Save estimates")),
  ].filter(Boolean));
  pullPlots(pull, result.pull);
  sweepPlots();
}

/** The parameters that are determined weakly, in words. */
function weakly(parameters) {
  const names = parameters.filter((p) => p.weak).map((p) => p.label);
  return names.length ? `, ${names.join(" and ")} weakly` : "";
}

/** One parameter: its value and band before and after the log; what is not determined is said. */
function band(parameter) {
  const { label, symbol, unit, value, band: [low, high], identified } = parameter;
  return element("article", { class: "band" },
    element("header", {}, element("h3", {}, `${label} `, element("span", { class: "unit" }, symbolText(symbol))),
      identified
        ? element("span", { class: "value" }, `${withUnit(value, unit)} `, element("span", { class: "unit" }, `90 %: ${range(low, high, unit)}`))
        : element("span", { class: "state no" }, "not determined")),
    picture(parameter));
}

/** What each interval leaves of the prior. */
function sureness(parameters) {
  const heads = ["", "left of the prior's width", "90 %"];
  return element("div", { class: "scroll", tabindex: "0", role: "region", "aria-label": "How sure each parameter is" },
    element("table", {}, element("thead", {}, element("tr", {}, ...heads.map((head) => element("th", { scope: "col" }, head)))),
      element("tbody", {}, ...parameters.map((p) => element("tr", {}, element("th", { scope: "row" }, p.label),
        ...[percent(p.left), range(...p.band, p.unit)].map((text) => element("td", {}, text)))))));
}

/** The explanations with their probabilities, in words. */
function explained(explanations) {
  const named = (explanations ?? []).map((one) => `${one.text}: ${percent(one.probability)}`);
  return named.length ? ` (${named.join(", ")})` : "";
}

const SYMBOLS = { phi: "φ", k_phi: "kφ", k_c: "kc", a_0: "a₀", a_1: "a₁", gamma: "γ" };
const symbolText = (symbol) => SYMBOLS[symbol] ?? symbol;

function picture({ range: [low, high], prior, band: [from, to], value, log, identified, unit, label }) {
  const place = log
    ? (x) => (100 * Math.log(Math.max(x, low) / low)) / Math.log(high / low)
    : (x) => (100 * (x - low)) / (high - low);
  const within = (x) => Math.min(100, Math.max(0, place(x)));
  const known = identified ? "" : " unknown";
  const bar = (a, b, y, height, name) => drawn("rect", { class: name, x: `${within(a)}%`, y, width: `${Math.max(0.6, within(b) - within(a))}%`, height, rx: 3 });
  const words = (x, anchor, value) => {
    const made = drawn("text", { class: "b-text", x, y: 44, "text-anchor": anchor });
    made.textContent = withUnit(value, unit);
    return made;
  };
  return drawn("svg", { role: "img", "aria-label": `${label}: 90 % from ${number(from)} to ${withUnit(to, unit)}; before the log ${number(prior[0])} to ${withUnit(prior[2], unit)}` },
    drawn("line", { class: "b-range", x1: "0%", x2: "100%", y1: 15, y2: 15 }),
    bar(prior[0], prior[2], 5, 20, "b-prior"),
    bar(from, to, 7, 10, `b-post${known}`),
    drawn("line", { class: `b-mid${known}`, x1: `${within(value)}%`, x2: `${within(value)}%`, y1: 7, y2: 17 }),
    words("0%", "start", low), words("100%", "end", high));
}
