// The model file of the estimate: written from the sliders until somebody changes it.

import { ask } from "./api.js";
import { chosen, droppedModel, takeModel } from "./forward.js";
import { byId, jumpTo, saveText, showError } from "./dom.js";

let own = false; // whether the text is the user's

const text = () => byId("model-text");

function tell(what) {
  byId("model-state").textContent = what;
}

/** What the server takes as the model: the text, or the choice and the sliders. */
export const modelOfEstimate = () => (own ? { model: text().value } : chosen());

/** Whether the model is a text of the user's, which nothing else changes. */
export const modelIsOwn = () => own;

export function startModelBox() {
  text().addEventListener("input", () => {
    own = true;
    tell("as changed below");
    showError("model-error", "");
  });
  byId("model-reset").addEventListener("click", () => {
    own = false;
    write();
  });
  byId("model-save").addEventListener("click", save);
  byId("model-box").addEventListener("toggle", () => byId("model-box").open && !own && write());
  document.addEventListener("sliders-moved", () => byId("model-box").open && !own && later());
}

let timer = 0;
function later() {
  clearTimeout(timer);
  timer = setTimeout(write, 250);
}

async function write() {
  if (own) return;
  tell("wheel and soil of the sliders, usual priors and noise");
  try {
    text().value = (await ask("/api/model", chosen())).text;
    showError("model-error", "");
  } catch (error) {
    showError("model-error", error.message);
  }
}

/** A dropped model file: it moves the sliders and stands in the box. */
export async function dropModel(content, name) {
  if (!(await takeModel(content, name))) return false;
  own = true;
  text().value = content;
  tell(name);
  return Boolean(droppedModel());
}

/** An error that names the model file is shown beside it. */
export function modelFault(message) {
  if (!message.includes("MODEL.toml")) return false;
  byId("model-box").open = true;
  showError("model-error", message);
  const shown = own ? Promise.resolve() : write();
  shown.then(() => {
    showError("model-error", message);
    jumpTo(text(), message);
  });
  return true;
}

export const clearModelFault = () => showError("model-error", "");

async function save() {
  if (!own) await write();
  saveText("MODEL.toml", text().value);
}
