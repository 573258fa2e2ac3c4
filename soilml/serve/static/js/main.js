// The page: what is started, and how its parts meet.

import { get } from "./api.js";
import { byId, showError } from "./dom.js";
import { startDesign } from "./design.js";
import { startEstimate, takeTable, wheelAnswered } from "./estimate.js";
import { startFiles } from "./files.js";
import { startForward } from "./forward.js";
import { startGap } from "./gap.js";
import { showMap, takeMap } from "./map_editor.js";
import { startModelBox } from "./model_box.js";

async function start() {
  const choices = await get("/api/choices");
  byId("version").textContent = choices.version;
  startModelBox();
  startEstimate();
  startGap();
  startFiles(choices.largest_file, {
    wheel: wheelAnswered,
    runs: (file, sheet, table) => {
      byId("map-panel").hidden = true;
      return takeTable(file, sheet, table);
    },
    logs: (files, names, sheet) => showMap(files, names, sheet, takeTable),
    map: takeMap,
  });
  await startForward(choices);
  await startDesign();
  document.documentElement.dataset.ready = "yes";
}

start().catch((error) => showError("choice-error", error.message));
