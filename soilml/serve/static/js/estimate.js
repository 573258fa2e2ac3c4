// The soil from a table of runs: bands against the prior, abstentions in words, what to drive next.

import { jobFile } from "./api.js";
import { byId, drawn, element, options, showError, wordList } from "./dom.js";
import { setRadius, setSoil, showReadings } from "./forward.js";
import { counted, number, percent, range, withUnit } from "./format.js";
import { work } from "./jobs.js";
import { clearModelFault, modelFault, modelIsOwn, modelOfEstimate } from "./model_box.js";
import { pullPlots } from "./pull_plots.js";
import { sweepPlots } from "./plots.js";

const ALL = "";
const current = { file: null, sheet: "" };

/** The table that estimates and gaps are made from: its key, and the run that is chosen. */
export const currentTable = () => (current.file ? { files: [current.file], sheet: current.sheet || null, run: byId("run").value } : null);

export function startEstimate() {
  byId("estimate-start").addEventListener("click", estimate);
}

/** Take a table: show it, then estimate. */
export async function takeTable(file, sheet, table, links = null) {
  Object.assign(current, { file, sheet });
  const wheel = modelIsOwn() ? "" : setRadius(table.radius);
  if (wheel) table = { ...table, remarks: [...table.remarks, wheel] };
  showTable(table, links);
  showReadings(table);
  options(byId("run"), [{ id: ALL, label: "all rows, as one soil" }, ...table.runs.map((run) => ({ id: run, label: `run ${run}` }))], ALL);
  byId("estimate-empty").hidden = true;
  byId("estimate-actions").hidden = false;
  byId("gap-start").disabled = false;
  byId("gap-empty").hidden = true;
  byId("gap-result").replaceChildren();
  await estimate();
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
  place.replaceChildren(
    element("p", { class: "soft" }, `${counted(result.used, "row")} (${result.channels.join(", ")}). Grey: the prior. Blue: the 90 % interval after the log, averaged over explanations of the rows${explained(result.explanations)}. Brown: that of exact_model, the model file taken as exact.`),
    ...(result.use ? [element("p", { class: "next" }, `${result.use[0].toUpperCase()}${result.use.slice(1)}.`)] : []),
    element("div", { class: "bands" }, ...result.parameters.map(band)),
    ...[wordList(result.words.slice(0, -1)), result.next ? element("p", { class: "next" }, element("b", {}, "Drive next: "), result.next) : null,
      wordList([...result.remarks, ...result.warnings], "remark")].filter(Boolean),
    element("div", { class: "buttons" },
      element("button", { type: "button", id: "use-soil", onclick: () => {
        setSoil(values);
        byId("forward").scrollIntoView();
      } }, "Show this soil in the forward model"),
      element("a", { class: "button", href: jobFile(id, "model.toml") }, "Save MODEL.toml"),
      element("a", { class: "button", href: jobFile(id, "identify.json") }, "Save estimates")),
    element("h3", {}, "Drawbar pull and slope"), element("div", { id: "pull-result" }));
  pullPlots(byId("pull-result"), result.pull);
  sweepPlots();
}

/** One parameter: value, band, what it leaves of the prior, and a picture of both. */
function band(parameter) {
  const { label, symbol, unit, value, band: [low, high], left, identified, weak } = parameter;
  const state = !identified
    ? `not identified: ${percent(left)} of the prior's width remains`
    : `${weak ? "weakly identified" : "identified"}: ${percent(left)} of the prior's width remains`;
  return element("article", { class: "band" },
    element("header", {}, element("h3", {}, `${label} `, element("span", { class: "unit" }, symbolText(symbol))),
      element("span", { class: "value" }, identified ? `${withUnit(value, unit)} ` : "not known ",
        element("span", { class: "unit" }, `90 %: ${range(low, high, unit)}`))),
    picture(parameter),
    element("p", { class: `state ${identified ? "yes" : "no"}` }, state), exactWords(parameter));
}

/** The interval of the model file taken as exact, beside a value that is known. */
function exactWords({ exact, exact_band: ends, identified, unit }) {
  if (!ends) return null;
  const value = identified ? `${withUnit(exact, unit)} ` : "";
  return element("p", { class: "state second" }, `exact_model: ${value}(90 %: ${range(...ends, unit)})`);
}

/** The explanations with their probabilities, in words. */
function explained(explanations) {
  const named = (explanations ?? []).map((one) => `${one.text} ${percent(one.probability)}`);
  return named.length ? ` (${named.join(", ")})` : "";
}

const SYMBOLS = { phi: "φ", k_phi: "kφ", k_c: "kc", a_0: "a₀", a_1: "a₁", gamma: "γ" };
const symbolText = (symbol) => SYMBOLS[symbol] ?? symbol;

function picture({ range: [low, high], prior, band: [from, to], exact_band: exact, value, log, identified, unit, label }) {
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
    ...(exact ? [bar(exact[0], exact[1], 19, 4, "b-exact")] : []),
    drawn("line", { class: `b-mid${known}`, x1: `${within(value)}%`, x2: `${within(value)}%`, y1: 7, y2: 17 }),
    words("0%", "start", low), words("100%", "end", high));
}
