// The page: what is started.

import { get } from "./api.js";
import { byId, showError } from "./dom.js";
import { startForward } from "./forward.js";
import { startLog } from "./log.js";
import { startWheels } from "./wheels.js";

async function start() {
  const choices = await get("/api/choices");
  byId("version").textContent = choices.version;
  startLog(choices);
  startWheels(choices);
  await startForward(choices);
  document.documentElement.dataset.ready = "yes";
}

start().catch((error) => showError("log-error", error.message));
