// Wheels of a rover for a slope: a form for the question, its report.

import { ask, jobFile } from "./api.js";
import { byId, element, jumpTo, options, saveText, showError } from "./dom.js";
import { currentName, currentTable } from "./estimate.js";
import { work } from "./jobs.js";
import { modelOfEstimate } from "./model_box.js";
import { reportParts } from "./report.js";

const NAMES = { rover: "Rover", wheel: "Wheel", goal: "Goal", soil: "Soil" };
const MEASURED = "measured";
const text = () => byId("design-text");

export async function startDesign() {
  byId("design-start").addEventListener("click", run);
  byId("design-save").addEventListener("click", () => saveText("rover.toml", text().value));
  text().addEventListener("change", () => change(null));
  addEventListener("table", () => change(null));
  await change(null);
}

/** Change a figure on the server, and show the question as it is then. */
async function change(what) {
  const focus = document.activeElement?.id;
  try {
    const found = await ask("/api/design", { question: text().value, change: what });
    text().value = found.question;
    if (!byId("design-effort").options.length) {
      options(byId("design-effort"), found.efforts.map((id) => ({ id, label: id })), "usual");
    }
    show(found.fields);
    byId(focus)?.focus({ preventScroll: true });
    showError("design-error", "");
  } catch (error) {
    fault(error.message);
  }
}

function fault(message) {
  showError("design-error", message);
  if (message.includes("rover.toml")) jumpTo(text(), message);
}

function show(fields) {
  const groups = new Map();
  fields.forEach((field, i) => {
    if (!groups.has(field.table)) groups.set(field.table, []);
    groups.get(field.table).push(figure(field, i));
  });
  byId("design-form").replaceChildren(...[...groups].map(([table, rows]) =>
    element("fieldset", {}, element("legend", {}, NAMES[table]), ...rows)));
}

function figure(field, i) {
  const id = `design-${i}`, label = `${field.label}${field.unit ? ` (${field.unit})` : ""}`;
  const set = (value) => change({ field: i, value });
  const row = (...inputs) => element("p", { class: "open" }, element("label", { for: id }, label), ...inputs);
  if (field.value === null) return row(element("input", { type: "text", id, disabled: true, placeholder: "in the text below" }));
  if (field.kind === "choice") {
    const list = element("select", { id, onchange: () => set(list.value) });
    options(list, field.choices.map((name) => ({ id: name, label: name.replaceAll("_", " ") })), field.value);
    return row(list);
  }
  if (field.kind === "names") return soils(field, id, label, set);
  const values = field.kind === "range" ? [field.value[0], field.value.at(-1)] : [field.value];
  const inputs = values.map((value, k) => element("input", {
    type: "number", step: "any", inputmode: "decimal", id: k ? `${id}-to` : id, value: String(value),
    "aria-label": field.kind === "range" ? `${label}, ${k ? "to" : "from"}` : undefined,
    onchange: () => set(field.kind === "range" ? inputs.map((input) => input.valueAsNumber) : inputs[0].valueAsNumber) }));
  return row(inputs[0], inputs[1] ? element("span", {}, "to") : null, inputs[1] ?? null);
}

/** The published soils: those of the question as buttons that take them out, and a list to add one.
 * A soil of measured rows stands alone, and so does the next published one after it. */
function soils(field, id, label, set) {
  const rows = currentName(), measured = rows && rows !== field.rows ? [{ id: MEASURED, label: `that of ${rows}` }] : [];
  const add = element("select", { id, onchange: () => add.value && set(add.value === MEASURED ? { rows } : [...field.value, add.value]) });
  options(add, [{ id: "", label: field.rows ? `that of ${field.rows}` : "add a soil" }, ...measured, ...field.choices.filter((name) => !field.value.includes(name)).map((name) => ({ id: name, label: name }))], "");
  return element("div", { class: "open" }, element("label", { for: id }, label), add,
    ...field.value.map((name) => element("button", { type: "button", "aria-label": `leave out ${name}`, onclick: () => set(field.value.filter((other) => other !== name)) }, `${name} ×`)));
}

async function run() {
  showError("design-error", "");
  const button = byId("design-start");
  button.disabled = true;
  try {
    const measured = /^\s*runs\s*=/m.test(text().value) && currentTable();
    const of = measured ? { ...measured, model: modelOfEstimate() } : { files: [] };
    const done = await work("design-job", { kind: "design", ...of, question: text().value, effort: byId("design-effort").value });
    if (done) answer(done);
  } catch (error) {
    fault(error.message);
  } finally {
    button.disabled = false;
  }
}

function answer({ id, result }) {
  const buttons = element("div", { class: "buttons" },
    element("a", { class: "button", href: jobFile(id, "design_report.html", true), target: "_blank", rel: "noopener" }, "Open the full report"),
    element("a", { class: "button", href: jobFile(id, "design.json") }, "Save design.json"),
    element("a", { class: "button", href: jobFile(id, "rover.toml") }, "Save rover.toml"),
    result.files.includes("MODEL.toml") ? element("a", { class: "button", href: jobFile(id, "MODEL.toml") }, "Save MODEL.toml") : "");
  byId("design-result").replaceChildren(...reportParts(result.report, buttons));
  byId("design-result").scrollIntoView({ block: "start" });
}
