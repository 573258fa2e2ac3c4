// Wheels of a rover for a slope: the question as text, and the report of its answer.

import { byId, jumpTo, options, showError } from "./dom.js";
import { work } from "./jobs.js";
import { modelText, tableKey } from "./log.js";
import { showReport } from "./reports.js";

export function startWheels({ question, efforts }) {
  byId("wheels-text").value = question;
  options(byId("wheels-effort"), efforts.map((id) => ({ id, label: id })), "normal");
  byId("wheels-start").addEventListener("click", compare);
}

async function compare() {
  const text = byId("wheels-text"), button = byId("wheels-start");
  showError("wheels-error", "");
  button.disabled = true;
  try {
    const measured = /^\s*runs\s*=/m.test(text.value) && tableKey();
    const soil = measured ? { files: [tableKey()], model: modelText() } : { files: [] };
    const done = await work("wheels-job", { kind: "wheels", ...soil, question: text.value, effort: byId("wheels-effort").value });
    if (done) showReport("wheels-answer", "Wheels for the slope", done);
  } catch (error) {
    showError("wheels-error", error.message);
    jumpTo(text, error.message);
  } finally {
    button.disabled = false;
  }
}
