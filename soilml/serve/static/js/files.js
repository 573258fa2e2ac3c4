// Files that are dropped or chosen: model files, tables of runs, raw logs.

import { upload } from "./api.js";
import { byId, element, showError } from "./dom.js";
import { bytes } from "./format.js";
import { work } from "./jobs.js";
import { dropModel } from "./model_box.js";

const CASE = /^\s*\[(gear|gears\.|soil|rover)/m;

/** `taken` has functions `runs(file, sheet, table)`, `logs(files, names, sheet)`, `map(text)`, `wheel()`. */
export function startFiles(largest, taken) {
  byId("drop-note").textContent = `CSV, Parquet, spreadsheets, MATLAB, MCAP, bags, TOML; up to ${bytes(largest)} each`;
  const input = byId("file");
  input.addEventListener("change", async () => {
    const files = [...input.files];
    input.value = "";
    await take(files, largest, taken);
  });
  let inside = 0;
  const dragging = (on) => document.body.classList.toggle("dragging", on);
  addEventListener("dragenter", (event) => {
    event.preventDefault();
    inside += 1;
    dragging(true);
  });
  addEventListener("dragleave", () => {
    inside -= 1;
    if (inside <= 0) dragging(false);
  });
  addEventListener("dragover", (event) => event.preventDefault());
  addEventListener("drop", async (event) => {
    event.preventDefault();
    inside = 0;
    dragging(false);
    await take([...event.dataTransfer.files], largest, taken);
  });
}

async function take(files, largest, taken) {
  if (!files.length) return;
  showError("drop-error", "");
  try {
    const large = files.find((file) => file.size > largest);
    if (large) throw new Error(`${large.name} has ${bytes(large.size)}; at most ${bytes(largest)} are taken here: thin it, or use soilml import on the command line`);
    const empty = files.find((file) => file.size === 0);
    if (empty) throw new Error(`${empty.name} is empty`);
    const data = [];
    for (const file of files) {
      if (!file.name.toLowerCase().endsWith(".toml")) data.push(file);
      else await takeToml(file, taken);
    }
    if (data.length) await takeData(data, taken);
  } catch (error) {
    showError("drop-error", error.message);
    byId("drop-error").scrollIntoView({ block: "nearest" });
  }
}

async function takeToml(file, taken) {
  const text = await file.text();
  if (!CASE.test(text)) return taken.map(text);
  if (await dropModel(text, file.name)) {
    byId("model-box").scrollIntoView({ block: "nearest" });
    await taken.wheel();
  }
  else throw new Error(`${file.name} is not taken: ${byId("choice-error").textContent}`);
  return null;
}

async function takeData(files, taken) {
  const keys = [];
  for (const file of files) keys.push((await upload(file)).id);
  await look(keys, files.map((file) => file.name), "", taken);
}

async function look(keys, names, sheet, taken) {
  byId("sheets").hidden = true;
  const done = await work("drop-job", { kind: "look", files: keys, sheet: sheet || null });
  if (!done) return;
  const { kind, sheets } = done.result;
  if (kind === "sheets") askForSheet(keys, names, sheets, taken);
  else if (kind === "runs") await taken.runs(keys[0], sheet, done.result);
  else await taken.logs(keys, names, sheet);
}

/** A spreadsheet with several sheets: a button for each. */
function askForSheet(keys, names, sheets, taken) {
  const choose = async (sheet) => {
    try {
      await look(keys, names, sheet, taken);
    } catch (error) {
      showError("drop-error", error.message);
    }
  };
  byId("sheets").replaceChildren(element("span", {}, `Which sheet of ${names[0]}?`),
    ...sheets.map((sheet) => element("button", { type: "button", onclick: () => choose(sheet) }, sheet)));
  byId("sheets").hidden = false;
  byId("sheets").querySelector("button").focus();
}
