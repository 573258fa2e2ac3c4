// The map of a raw log: its columns with their roles and units, the curves that it gives, its text.

import { jobFile } from "./api.js";
import { byId, drawn, element, jumpTo, options, saveText, showError, wordList } from "./dom.js";
import { counted, number, percent } from "./format.js";
import { work } from "./jobs.js";
import { Plot } from "./plots.js";

const UNUSED = "";
const COLOURS = { slip: "strength", load: "pull", torque: "torque" };
const state = { logs: [], sheet: "", names: [], map: "", imported: null, shown: null };

/** Look at logs and guess their map; `imported(file, table, links)` takes the table. */
export async function showMap(keys, names, sheet, imported) {
  Object.assign(state, { logs: keys, names, sheet, imported, map: "" });
  byId("table-panel").hidden = true;
  byId("map-panel").hidden = true;
  const done = await work("drop-job", request({}));
  if (!done) return;
  build();
  show(done.result);
  byId("map-panel").scrollIntoView({ block: "start" });
}

/** A dropped map takes the place of the guessed one. */
export async function takeMap(text) {
  if (!state.logs.length) throw new Error("this is a map of a log: drop the log first, then the map");
  byId("map-text").value = text;
  await change({}, text);
}

const request = (more) => ({ kind: "map", files: state.logs, sheet: state.sheet || null, map: state.map, ...more });

function build() {
  const text = element("textarea", { id: "map-text", rows: "22", spellcheck: "false", "aria-describedby": "map-error",
    onchange: () => change({}, byId("map-text").value) });
  byId("map-panel").replaceChildren(
    element("h3", {}, `What is what in ${state.names.join(", ")}${state.sheet ? `, sheet ${state.sheet}` : ""}`),
    element("p", { id: "map-note" }), element("div", { id: "map-open" }),
    element("div", { class: "grid", id: "map-curves" }),
    element("p", { class: "note", id: "map-of" }), element("div", { id: "map-hints" }),
    element("table", { class: "columns" }, element("caption", {}, "Columns of the log"),
      element("thead", {}, element("tr", {}, ...["column", "samples", "range", "what it is", "unit", "look at"].map((head) => element("th", { scope: "col" }, head)))),
      element("tbody", { id: "map-columns" })),
    element("p", { class: "error", id: "map-error", role: "alert", hidden: true }),
    element("div", { class: "job", id: "map-job", hidden: true }),
    element("div", { class: "buttons" },
      element("button", { type: "button", class: "main", id: "import-start", onclick: run }, "Import"),
      element("button", { type: "button", onclick: () => saveText("map.toml", byId("map-text").value) }, "Save map.toml"),
      element("label", { for: "map-accept" }, element("input", { type: "checkbox", id: "map-accept" }), " import although physics objects")),
    element("div", { class: "job", id: "import-job", hidden: true }),
    element("details", { id: "map-box" }, element("summary", {}, "The map as text"), element("label", { for: "map-text" }, "map.toml"), text));
  state.shown = null;
  byId("map-panel").hidden = false;
}

/** Change the map on the server, and show what it is then. */
async function change(what, map = state.map) {
  showError("map-error", "");
  const focus = document.activeElement?.id;
  try {
    const done = await work("map-job", request({ map, change: what }));
    if (!done) return;
    show(done.result);
    byId(focus)?.focus({ preventScroll: true });
  } catch (error) {
    fault(error.message);
  }
}

function fault(message) {
  showError("map-error", message);
  if (jumpTo(byId("map-text"), message)) byId("map-box").open = true;
}

function show(result) {
  state.map = result.map;
  byId("map-text").value = result.map;
  const { marked, preview } = result;
  byId("map-note").textContent = marked
    ? `${counted(marked, "line")} of the map are in no log, or only guessed.`
    : "Names, units and physics agree with these guesses.";
  byId("map-note").className = marked ? "remark" : "soft";
  byId("map-open").replaceChildren(...result.open.map(openLine));
  const left = new Set(preview.hints ?? []);
  byId("map-columns").replaceChildren(...result.columns.map((column, i) => row(column, i, result, left)));
  showPreview(preview, [...left]);
}

/** A line that needs a look: a value to set, or a link to its place in the text. */
function openLine(line) {
  const id = `open-${line.line}`;
  const where = `[${line.table}] ${line.key}`;
  const go = element("button", { type: "button", class: "link", onclick: () => goTo(line.line) }, line.key ? "show" : line.why);
  if (!line.key || line.key === "column") {
    return element("p", { class: "open" }, element("span", {}, line.key ? `${where}: ${line.why} ` : ""), go);
  }
  const set = (event) => change({ line: line.line, value: event.target.value });
  return element("p", { class: "open" },
    element("label", { for: id }, where),
    element("input", { type: "text", id, value: line.unset ? "" : line.value, placeholder: line.unset ? line.value : "", onchange: set, "aria-describedby": `${id}-why` }),
    element("span", { class: "note", id: `${id}-why` }, line.why || "needed"));
}

function goTo(line) {
  byId("map-box").open = true;
  jumpTo(byId("map-text"), `line ${line}`);
}

/** A column; it takes the hints that are about its role, of those that are left. */
function row(column, i, { roles, units, open }, left) {
  const role = column.role.split(".").at(-1);
  const kind = roles.find((r) => r.id === column.role)?.unit;
  const marked = open.filter((line) => column.role && line.table === column.role).map((line) => `${line.key}: ${line.why}`);
  const hints = [...left].filter((hint) => role && hint.about.includes(role));
  hints.forEach((hint) => left.delete(hint));
  const what = element("select", { id: `role-${i}`, "aria-label": `What ${column.name} is`,
    onchange: (event) => change({ column: column.name, role: event.target.value }) });
  const time = column.role === "time" ? [{ id: "time", label: "time" }] : [];
  options(what, [{ id: UNUSED, label: "not used" }, ...time, ...roles], column.role);
  what.disabled = column.role === "time";
  const known = [...new Set([column.unit, column.stated, ...(units[kind] ?? [])])].filter(Boolean);
  const unit = element("select", { id: `unit-${i}`, "aria-label": `Unit of ${column.name}`,
    onchange: (event) => change({ role: column.role, unit: event.target.value }) });
  options(unit, [...(column.unit ? [] : [{ id: "", label: column.scaled ? "by its scale" : "–" }]), ...known.map((u) => ({ id: u, label: u }))], column.unit);
  unit.disabled = !kind;
  const note = (text, wrong) => element("p", { class: `note ${wrong ? "wrong" : "remark"}` }, `${wrong ? "✗" : "!"} ${text}`);
  const notes = [...hints.map((hint) => note(plain(hint), hint.wrong)), ...marked.map((text) => note(text, false))];
  return element("tr", { class: column.role ? "used" : "" },
    element("th", { scope: "row" }, column.name),
    element("td", { class: "spark" }, spark(column)),
    element("td", { class: "num" }, column.constant ? "constant" : `${number(column.low)} … ${number(column.high)}`, element("small", {}, column.stated ? ` ${column.stated}` : "")),
    element("td", {}, what), element("td", {}, unit), element("td", { class: "looks" }, ...notes));
}

const plain = (hint) => hint.text.replace(/^map\.toml: /, "");

function spark({ name, spark: values }) {
  const known = values.filter((v) => v !== null);
  const low = Math.min(...known), high = Math.max(...known);
  const y = (v) => (high > low ? 22 - (20 * (v - low)) / (high - low) : 12);
  const points = values.map((v, i) => (v === null ? "" : `${((100 * i) / Math.max(1, values.length - 1)).toFixed(1)},${y(v).toFixed(1)}`)).join(" ");
  return drawn("svg", { viewBox: "0 0 100 24", preserveAspectRatio: "none", role: "img", "aria-label": `Samples of ${name} over time` },
    drawn("polyline", { points }));
}

function showPreview(preview, hints) {
  const curves = preview.curves ?? [];
  byId("map-curves").hidden = !curves.length;
  const kinds = curves.map((c) => c.quantity).join();
  if (kinds !== state.shown) {
    state.shown = kinds;
    state.plots?.forEach((plot) => plot.remove());
    state.plots = [];
    byId("map-curves").replaceChildren(...curves.map(figure));
  }
  curves.forEach((c, i) => state.plots[i].set([c.time, c.values, c.steady], null, `${c.quantity} over time; thick where it is steady`));
  const several = preview.logs > 1 ? ` of ${preview.log}, the first of ${preview.logs} logs` : "";
  byId("map-of").textContent = preview.error ? "" : `Thick: steady windows, ${counted(preview.rows, "row")} of the table${several}.`;
  const lists = [[true, "wrong"], [false, "remark"]].map(([wrong, name]) => wordList(hints.filter((h) => h.wrong === wrong).map(plain), name));
  byId("map-hints").replaceChildren(...lists.filter(Boolean));
  showError("map-error", preview.error);
}

function figure({ quantity, unit }) {
  const place = element("div", { class: "plot" }), reading = element("span", { class: "reading" });
  const made = element("figure", {}, element("figcaption", {}, element("h3", {}, `${quantity} `, element("span", { class: "unit" }, unit)), reading), place);
  state.plots.push(new Plot(place, {
    x: "time (s)", y: null, height: 150, reading, zero: true,
    series: [{ label: "", colour: "held", unit, width: 1 }, { label: "steady", colour: COLOURS[quantity], unit, width: 3 }],
  }));
  return made;
}

async function run() {
  showError("map-error", "");
  const map = byId("map-text").value;
  try {
    const done = await work("import-job", request({ kind: "import", map, accept: byId("map-accept").checked }));
    if (!done) return;
    const { id, result } = done;
    const kept = result.seconds ? `${percent(1 - result.left_out / result.seconds)} of ${Math.round(result.seconds)} s are steady and in the table; the report says why the rest is left out.` : "";
    const links = element("div", {},
      element("p", {}, kept), wordList(result.remarks, "remark"),
      element("div", { class: "buttons" },
        element("a", { class: "button", href: jobFile(id, "runs.csv") }, "Save RUNS.csv"),
        element("a", { class: "button", href: jobFile(id, "import_report.html", true), target: "_blank", rel: "noopener" }, "Open the import report"),
        element("a", { class: "button", href: jobFile(id, "import_report.html") }, "Save the report"),
        element("a", { class: "button", href: jobFile(id, "bias.toml") }, "Save shared errors")));
    await state.imported(`${id}/runs.csv`, "", { ...result, remarks: [] }, links);
  } catch (error) {
    fault(error.message);
  }
}
