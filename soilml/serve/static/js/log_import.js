// A raw log: its map in a text box, then its import.

import { jobFile } from "./api.js";
import { byId, element, showError, wordList } from "./dom.js";
import { counted, percent } from "./format.js";
import { work } from "./jobs.js";

let logs = [];

/** Show the guessed map of some logs; `imported(file, table, links)` takes the table. */
export async function showMap(keys, names, imported) {
  logs = keys;
  byId("table-panel").hidden = true;
  const done = await work("drop-job", { kind: "map", files: keys });
  if (!done) return;
  panel(done.result.map, done.result.marked, names, imported);
}

/** A dropped map takes the place of the guessed one. */
export function takeMap(text, imported) {
  if (!logs.length) throw new Error("this is a map of a log: drop the log first, then the map");
  panel(text, 0, [], imported);
}

function panel(map, marked, names, imported) {
  const text = element("textarea", { id: "map-text", rows: "22", spellcheck: "false", "aria-describedby": "map-note map-error" });
  text.value = map;
  const accept = element("input", { type: "checkbox", id: "map-accept" });
  const note = marked
    ? `What no log can tell is marked CHANGE or NEEDED, in ${counted(marked, "line")}: correct it, then import.`
    : "Look at the guesses, then import.";
  byId("map-panel").replaceChildren(
    element("h3", {}, `Map of the log${names.length ? `: ${names.join(", ")}` : ""}`),
    element("p", { class: marked ? "remark" : "soft", id: "map-note" }, note),
    element("label", { for: "map-text" }, "What is what in the log (TOML)"),
    text,
    element("p", { class: "error", id: "map-error", role: "alert", hidden: true }),
    element("div", { class: "buttons" },
      element("button", { type: "button", class: "main", id: "import-start", onclick: () => run(text, accept, imported) }, "Import"),
      element("label", { for: "map-accept" }, accept, " import although the map looks wrong")),
    element("div", { class: "job", id: "import-job", hidden: true }));
  byId("map-panel").hidden = false;
  text.focus({ preventScroll: true });
  byId("map-panel").scrollIntoView({ block: "nearest" });
}

async function run(text, accept, imported) {
  showError("map-error", "");
  try {
    const done = await work("import-job", { kind: "import", files: logs, map: text.value, accept: accept.checked });
    if (!done) return;
    const { id, result } = done;
    const kept = 1 - result.left_out / result.seconds;
    const links = element("div", {},
      element("p", {}, `${percent(kept)} of ${Math.round(result.seconds)} s are steady and in the table; the report says why the rest is left out.`),
      wordList(result.remarks, "remark"),
      element("div", { class: "buttons" },
        element("a", { class: "button", href: jobFile(id, "runs.csv") }, "Save RUNS.csv"),
        element("a", { class: "button", href: jobFile(id, "import_report.html", true), target: "_blank", rel: "noopener" }, "Open the import report"),
        element("a", { class: "button", href: jobFile(id, "import_report.html") }, "Save the report"),
        element("a", { class: "button", href: jobFile(id, "bias.toml") }, "Save shared errors")));
    await imported(`${id}/runs.csv`, { ...result, remarks: [] }, links);
  } catch (error) {
    showError("map-error", error.message);
  }
}
