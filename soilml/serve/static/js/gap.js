// The gap analysis: started by a button, cancelled by another; its report.

import { jobFile } from "./api.js";
import { byId, element, showError } from "./dom.js";
import { currentTable } from "./estimate.js";
import { work } from "./jobs.js";
import { clearModelFault, modelFault, modelOfEstimate } from "./model_box.js";
import { reportParts } from "./report.js";

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
  const buttons = element("div", { class: "buttons" },
    element("a", { class: "button", href: jobFile(id, "report.html", true), target: "_blank", rel: "noopener" }, "Open the full report"),
    element("a", { class: "button", href: jobFile(id, "model.toml") }, "Save MODEL.toml"),
    element("a", { class: "button", href: jobFile(id, "next_runs.csv") }, "Save the next runs"),
    element("a", { class: "button", href: jobFile(id, "report.html") }, "Save the report"),
    element("a", { class: "button", href: jobFile(id, "gap.json") }, "Save gap.json"));
  byId("gap-result").replaceChildren(...reportParts(result.report, buttons));
  byId("gap").scrollIntoView({ block: "start" });
}
