// The gap analysis: started by a button, cancelled by another, its verdict in words and maps.

import { jobFile } from "./api.js";
import { byId, element, fold, showError, wordList } from "./dom.js";
import { currentTable } from "./estimate.js";
import { number, percent } from "./format.js";
import { work } from "./jobs.js";
import { clearModelFault, modelFault, modelOfEstimate } from "./model_box.js";

const SURE = 10; // sigma from which on only "10 or more" is said

export function startGap() {
  byId("gap-start").addEventListener("click", async () => {
    const button = byId("gap-start");
    button.disabled = true;
    showError("gap-error", "");
    clearModelFault();
    byId("gap-result").replaceChildren();
    try {
      const done = await work("gap-job", { kind: "gap", ...currentTable(), model: modelOfEstimate() });
      if (done) show(done);
    } catch (error) {
      if (!modelFault(error.message)) showError("gap-error", error.message);
    } finally {
      button.disabled = false;
    }
  });
}

function show({ id, result }) {
  byId("gap-result").replaceChildren(...[
    verdict(result),
    element("div", { class: "buttons" },
      element("a", { class: "button", href: jobFile(id, "report.html", true), target: "_blank", rel: "noopener" }, "Open the full report"),
      element("a", { class: "button", href: jobFile(id, "model.toml") }, "Save MODEL.toml"),
      element("a", { class: "button", href: jobFile(id, "next_runs.csv") }, "Save the next runs"),
      element("a", { class: "button", href: jobFile(id, "report.html") }, "Save the report"),
      element("a", { class: "button", href: jobFile(id, "gap.json") }, "Save gap.json")),
    fold("Why", element("p", {}, result.meaning), ...result.lines.map((line) => element("p", {}, line)),
      wordList(result.reasons.filter((reason) => reason !== result.sentence))),
    result.maps.length ? fold("Where the model disagrees",
      element("p", { class: "soft" }, `Scores in σ of the readings in a range of slip and load against the fit of the soil alone; ★ where significant, ▲ measured above the model, ▼ below. Probability of a gap: ${result.gap_probability}.`),
      element("div", { class: "maps" }, ...result.maps.map(map))) : null,
    fold("Effects and the size of the gap", ...effects(result.effects), sizes(result.sizes), suspects(result.suspects)),
    fold("What to drive or check next", nextRuns(result.next_runs)),
    fold("The data", wordList(result.notes)),
  ].filter(Boolean));
  byId("gap").scrollIntoView({ block: "start" });
}

function verdict(result) {
  const next = result.next_runs[0];
  return element("article", { class: "verdict" },
    element("p", { class: "sentence" }, element("span", { class: "badge" }, result.status), result.sentence),
    element("p", {}, element("b", {}, "What to do: "), result.advice),
    next ? element("p", {}, element("b", {}, "Next run: "), `${next.kind}, ${next.text}`) : null);
}

function cell(entry) {
  if (!entry) return element("td", { class: "none" }, "·");
  const side = entry.side === "above" ? "▲" : "▼";
  const text = `${entry.z >= 0.1 ? number(entry.z, 2) : "0"} ${side}${entry.sure ? " ★" : ""}`;
  const made = element("td", { title: `measured ${entry.side} the model, p = ${number(entry.p, 2)}` }, text);
  made.style.backgroundColor = entry.colour;
  made.style.color = entry.text;
  return made;
}

function map({ channel, slips, rows }) {
  return element("div", { class: "scroll", tabindex: "0", role: "region", "aria-label": `Map of ${channel}` },
    element("table", { class: "map" },
      element("caption", {}, channel),
      element("thead", {}, element("tr", {}, element("th", { scope: "col" }, "load (N) \\ slip"), ...slips.map((s) => element("th", { scope: "col" }, s)))),
      element("tbody", {}, ...rows.map(([load, entries]) => element("tr", {}, element("th", { scope: "row" }, load), ...entries.map(cell))))));
}

function table(title, heads, rows) {
  if (!rows.length) return null;
  const row = (cells) => element("tr", {}, ...cells.map((text, i) => element(i ? "td" : "th", i ? {} : { scope: "row" }, text)));
  return element("div", { class: "scroll", tabindex: "0", role: "region", "aria-label": title },
    element("table", {}, element("caption", {}, title),
      element("thead", {}, element("tr", {}, ...heads.map((head) => element("th", { scope: "col" }, head)))),
      element("tbody", {}, ...rows.map(row))));
}

const effects = (found) => found.map((e) => table(`Missing effect: ${e.name}, ${e.text} (probability ${percent(e.probability)})`,
  ["parameter", "value"], e.parameters));

const ROWS = { train: "fitted rows", run: "held-out runs", runs: "held-out runs", region: "held-out regions", regions: "held-out regions" };
const sizes = (found) => table("Size of the gap: mean squared residual in σ, 1 is noise alone", ["rows", "before", "after", "what"],
  found.map((g) => [ROWS[g.rows] ?? g.rows.replaceAll("_", " "), number(g.before), number(g.after), g.what]));

const suspects = (found) => table("Suspects, the likeliest first", ["effects", "probability", "given"],
  found.map((s) => [s.names.join(" + "), s.probability, s.given]));

const nextRuns = (found) => table("What to drive or check next, the most telling first", ["kind", "what to do", "discrimination"],
  found.map((n) => [n.kind, n.text, n.sigma >= SURE ? "10 σ or more" : `${number(n.sigma, 2)} σ`]));
