// The page: what is started.

import { get } from "./api.js";
import { byId, showError } from "./dom.js";
import { startForward } from "./forward.js";
import { startLog } from "./log.js";

async function start() {
  const choices = await get("/api/choices");
  byId("version").textContent = choices.version;
  startLog(choices);
  await startForward(choices);
  document.documentElement.dataset.ready = "yes";
}

start().catch((error) => showError("log-error", error.message));
