// The log: dropped files become a table of runs and a model, and these an answer.

import { get, jobFile, upload } from "./api.js";
import { byId, element, jumpTo, options, saveText, showError } from "./dom.js";
import { bytes, counted } from "./format.js";
import { setSoil, takeModel } from "./forward.js";
import { work } from "./jobs.js";
import { showReport } from "./reports.js";

const CASE = /^\s*\[(gear|gears\.|soil|rover)/m;
const MARK = /\b(CHANGE|NEEDED)\b[:;]?\s*(.*)$/;
const SETTING = /^(\s*)(?:#\s*)?([A-Za-z_]+)\s*=\s*("[^"]*"|\[[^\]]*\]|[^#]*?)\s*(#.*)?$/;
const NOISE = { drawbar_pull_N: '"2 % + 0.5"', sinkage_m: "0.001" }; // of sensors that the table has
const TITLES = { identify: "The soil", gap: "What does the model lack?", pull: "Pull and slope" };
const state = { logs: [], sheet: "", table: null, facts: null };

const model = () => byId("model-text");
const modelText = () => model().value;

export function startLog({ largest_file: largest, soils }) {
  byId("drop-note").textContent = `CSV, Parquet, spreadsheets, MATLAB, MCAP, bags, TOML; up to ${bytes(largest)} each`;
  options(byId("wheel-soil"), [{ id: "", label: "unknown" }, ...soils.map(({ id, label }) => ({ id, label: `as ${label}` }))], "");
  const input = byId("file");
  input.addEventListener("change", () => {
    const files = [...input.files];
    input.value = "";
    attempt(() => take(files, largest));
  });
  let inside = 0;
  const dragging = (by) => {
    inside = by ? Math.max(0, inside + by) : 0;
    document.body.classList.toggle("dragging", inside > 0);
  };
  addEventListener("dragenter", (event) => { event.preventDefault(); dragging(1); });
  addEventListener("dragleave", () => dragging(-1));
  addEventListener("dragover", (event) => event.preventDefault());
  addEventListener("drop", (event) => {
    event.preventDefault();
    dragging(0);
    attempt(() => take([...event.dataTransfer.files], largest));
  });
  byId("example").addEventListener("click", () => attempt(example));
  byId("import-start").addEventListener("click", () => attempt(importLog));
  byId("ask-wheel").addEventListener("submit", (event) => {
    event.preventDefault();
    attempt(writeModel);
  });
  byId("model-save").addEventListener("click", () => saveText("MODEL.toml", modelText()));
  for (const kind of Object.keys(TITLES)) byId(`ask-${kind}`).addEventListener("click", () => ask(kind));
}

/** Do something about the log; what is wrong stands above it, and at its place in a text. */
async function attempt(what) {
  showError("log-error", "");
  try {
    await what();
  } catch (error) {
    showError("log-error", error.message);
    if (!pointTo(error.message)) byId("log-error").scrollIntoView({ block: "nearest" });
  }
}

const pointTo = (message) =>
  (message.includes("MODEL.toml") && jumpTo(model(), message)) || (message.includes("map.toml") && jumpTo(byId("map-text"), message));

async function take(files, largest) {
  const large = files.find((file) => file.size > largest);
  if (large) throw new Error(`${large.name} has ${bytes(large.size)}; at most ${bytes(largest)} are possible here: thin it, or use soilml import on the command line`);
  const empty = files.find((file) => file.size === 0);
  if (empty) throw new Error(`${empty.name} is empty`);
  const isText = (file) => file.name.toLowerCase().endsWith(".toml");
  for (const file of files.filter(isText)) {
    const text = await file.text();
    if (CASE.test(text)) await setModel(text, file.name);
    else if (state.logs.length) showMap(text);
    else throw new Error(`${file.name} is a map of a log: drop the log first, then the map`);
  }
  const data = files.filter((file) => !isText(file));
  if (data.length) {
    const keys = [];
    for (const file of data) keys.push((await upload(file)).id);
    await look(keys, "");
  } else if (state.table && modelText()) await ask("identify");
}

async function example() {
  const done = await work("log-job", { kind: "example", files: [] });
  if (!done) return;
  await setModel(await textOf(done.id, "model.toml"), "model.toml of the example");
  await look([`${done.id}/runs.csv`], "");
}

const textOf = async (job, name) => (await fetch(jobFile(job, name))).text();

async function look(keys, sheet) {
  byId("sheets").hidden = byId("map-panel").hidden = true;
  const done = await work("log-job", { kind: "look", files: keys, sheet: sheet || null });
  if (!done) return;
  Object.assign(state, { logs: keys, sheet });
  const { kind, sheets } = done.result;
  if (kind === "sheets") {
    byId("sheets").replaceChildren(element("span", {}, "Which sheet?"), ...sheets.map((name) =>
      element("button", { type: "button", onclick: () => attempt(() => look(keys, name)) }, name)));
    byId("sheets").hidden = false;
    byId("sheets").querySelector("button").focus();
  } else if (kind === "runs") await takeTable(keys[0], done.result);
  else await draft();
}

/** Guess the map of the logs; one without doubts is used at once. */
async function draft() {
  const done = await work("log-job", { kind: "draft", files: state.logs, sheet: state.sheet || null });
  if (!done) return;
  const marked = showMap(await textOf(done.id, "map.toml"));
  if (!marked) await importLog();
}

/** The map as text, and a field for each line that needs a look; how many there are. */
function showMap(text) {
  byId("map-text").value = text;
  const lines = text.split("\n"), head = lines.findIndex((line) => !line.trim());
  let table = "";
  const open = lines.flatMap((line, i) => {
    table = /^\s*\[([^[\]]+)\]/.exec(line)?.[1] ?? table;
    const mark = i > head && MARK.exec(line);
    return mark ? [field(lines, i, table, mark[2])] : [];
  });
  byId("map-open").replaceChildren(...open);
  byId("map-note").textContent = open.length
    ? `${counted(open.length, "line")} of the map ${open.length === 1 ? "needs" : "need"} a look: no log states ${open.length === 1 ? "it" : "them"} beyond doubt.`
    : "Names, units and physics agree with these guesses.";
  byId("map-panel").hidden = false;
  byId("map-panel").scrollIntoView({ block: "nearest" });
  return open.length;
}

function field(lines, i, table, why) {
  const id = `open-${i}`, found = SETTING.exec(lines[i]);
  const show = element("button", { type: "button", class: "link", onclick: () => jumpTo(byId("map-text"), `line ${i + 1}`) }, "show in the map");
  if (!found) return element("p", { class: "open" }, element("span", {}, lines[i].replace(/^[\s#]+/, "")), show);
  const [, space, key, value] = found, isSet = !lines[i].trim().startsWith("#");
  const change = (event) => {
    const given = event.target.value.trim();
    lines[i] = `${space}${key} = ${Number.isNaN(Number(given)) ? `"${given}"` : given}`;
    byId("map-text").value = lines.join("\n");
  };
  const plain = value.replaceAll('"', "");
  return element("p", { class: "open" }, element("label", { for: id }, `[${table}] ${key}`),
    element("input", { type: "text", id, value: isSet ? plain : "", placeholder: isSet ? "" : plain, onchange: change, "aria-describedby": `${id}-why` }),
    element("span", { class: "note", id: `${id}-why` }, why || "needed"), show);
}

async function importLog() {
  const request = { kind: "import", files: state.logs, sheet: state.sheet || null, map: byId("map-text").value, accept: byId("map-accept").checked };
  const done = await work("log-job", request);
  if (!done) return;
  const table = `${done.id}/runs.csv`;
  const { result } = await work("log-job", { kind: "look", files: [table] });
  await takeTable(table, result, done);
}

/** Use a table of runs: its answer follows at once where the model is known. */
async function takeTable(key, facts, imported = null) {
  Object.assign(state, { table: key, facts });
  options(byId("run"), [{ id: "", label: `all ${facts.rows}, as one soil` }, ...facts.runs.map((run) => ({ id: run, label: `run ${run}` }))], "");
  byId("answers").replaceChildren();
  byId("answer-empty").hidden = true;
  if (imported) showReport("answers", "The imported log", imported);
  if (modelText()) return ask("identify");
  byId("ask-wheel").hidden = false;
  if (facts.radius) byId("wheel-radius").value = String(Number((1000 * facts.radius).toPrecision(6)));
  byId("ask-wheel").scrollIntoView({ block: "nearest" });
  return byId("wheel-radius").focus();
}

/** A first model file for the wheel, with the noise of the sensors that the table has. */
async function writeModel() {
  const size = (name) => byId(`wheel-${name}`).valueAsNumber / 1000;
  const done = await work("log-job", { kind: "init", files: [], radius: size("radius"), width: size("width"), soil: byId("wheel-soil").value });
  if (!done) return;
  let text = await textOf(done.id, "MODEL.toml");
  for (const name of state.facts?.measured ?? []) text = text.replace(new RegExp(`^# ${name} = .*`, "m"), `${name} = ${NOISE[name]}`);
  await setModel(text, "for this wheel, with wide priors and typical noise");
  if (state.table) await ask("identify");
}

async function setModel(text, name) {
  model().value = text;
  byId("model-name").textContent = name;
  byId("model-box").hidden = false;
  byId("ask-wheel").hidden = true;
}

async function ask(kind) {
  byId("ask").hidden = false;
  showError("answer-error", "");
  const button = byId(`ask-${kind}`);
  button.disabled = true;
  try {
    const done = await work("answer-job", { kind, files: [state.table], sheet: state.table.includes("/") ? null : state.sheet || null, run: byId("run").value, model: modelText() });
    if (done) showReport("answers", TITLES[kind], done, ...actions(kind, done.id));
  } catch (error) {
    showError("answer-error", error.message);
    pointTo(error.message);
  } finally {
    button.disabled = false;
  }
}

/** What can be done with an answer on the page. */
function actions(kind, id) {
  const act = (label, what) => [element("button", { type: "button", class: "main", onclick: () => attempt(what) }, label)];
  if (kind === "gap") {
    return act("Use the returned model", async () => {
      await setModel(await textOf(id, "model.toml"), "returned by the search for what the model lacks");
      await ask("identify");
    });
  }
  if (kind !== "identify") return [];
  return act("Show this soil in the forward model", async () => {
    const { parameters } = await get(jobFile(id, "report.json"));
    if (!(await takeModel(modelText(), byId("model-name").textContent))) throw new Error(byId("choice-error").textContent);
    setSoil(Object.fromEntries(Object.entries(parameters).map(([path, found]) => [path, found.value])));
    byId("forward").scrollIntoView();
  });
}
