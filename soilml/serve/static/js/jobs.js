// Work that takes long: a line with its stage, its progress and a button to cancel it.

import { ask, end, Failure, get } from "./api.js";
import { byId, element } from "./dom.js";

const PAUSE = 200; // ms between two questions
const running = new Map(); // place -> token of the job that may still answer there

const wait = (time) => new Promise((resolve) => setTimeout(resolve, time));

/**
 * Start a job and wait for its answer, with progress shown in the element `place`.
 * Gives { id, result }, or null where it was cancelled or replaced by a newer one.
 */
export async function work(place, content) {
  const box = byId(place);
  const token = Symbol(place);
  running.set(place, token);
  const stage = element("span", { role: "status" }, "starting …");
  const bar = element("progress", { "aria-label": "Progress" });
  const cancel = element("button", { type: "button" }, "Cancel");
  box.replaceChildren(stage, bar, cancel);
  box.hidden = false;
  const alive = () => running.get(place) === token;
  // Cancel works from the moment it is seen, also before the server has named the job
  let id = null;
  const stop = () => { if (id !== null) end(id).catch(() => {}); };
  cancel.addEventListener("click", () => {
    if (alive()) running.delete(place);
    box.hidden = true;
    stop();
  });
  try {
    let job = await ask("/api/jobs", content);
    id = job.id;
    if (!alive()) stop();
    while (job.state === "running") {
      if (!alive()) return null;
      const text = job.share === null ? job.stage : `${job.stage}, ${Math.round(100 * job.share)} %`;
      if (stage.textContent !== text) stage.textContent = text;
      if (job.share === null) bar.removeAttribute("value");
      else bar.value = job.share;
      await wait(PAUSE);
      job = await get(`/api/jobs/${job.id}`);
    }
    if (!alive() || job.state === "cancelled") return null;
    if (job.state === "failed") throw new Failure(job.error);
    return { id: job.id, result: job.result };
  } finally {
    if (alive()) {
      running.delete(place);
      box.hidden = true;
    }
  }
}
