// The forward model: choices and sliders ask, curves and stresses answer.

import { ask } from "./api.js";
import { byId, element, options, showError } from "./dom.js";
import { number, percent, withUnit } from "./format.js";
import { Plot } from "./plots.js";
import { Slider } from "./sliders.js";
import { wheelPicture } from "./wheel_picture.js";

const CURVES = { torque: "N m", pull: "N", sinkage: "mm" };
const OPEN = 2; // groups of sliders that are open at first

const state = { model: "", modelName: "", sliders: new Map() };
const plots = {};
let generation = 0, busy = false, again = false;

/** The choice and the sliders as the server takes them. */
function chosen() {
  const values = {};
  for (const slider of state.sliders.values()) values[slider.path] = slider.value;
  const own = state.model ? { model: state.model } : { wheel: byId("wheel").value, soil: byId("soil").value };
  return { ...own, values };
}

export async function startForward(choices) {
  state.soils = choices.soils;
  options(byId("wheel"), choices.wheels);
  options(byId("soil"), choices.soils, choices.first);
  makePlots();
  for (const id of ["wheel", "soil"]) byId(id).addEventListener("change", () => {
    state.model = "";
    loadControls();
  });
  byId("reset").addEventListener("click", () => {
    for (const slider of state.sliders.values()) slider.set(slider.first);
    update();
  });
  await loadControls();
}

/** Take a model file that was dropped; its error stands beside the choices. */
export async function takeModel(text, name) {
  const before = { model: state.model, modelName: state.modelName };
  Object.assign(state, { model: text, modelName: name });
  if (await loadControls()) return true;
  Object.assign(state, before);
  return false;
}

async function loadControls() {
  const mine = ++generation;
  showError("choice-error", "");
  const { values, ...own } = chosen();
  let found;
  try {
    found = await ask("/api/controls", own);
  } catch (error) {
    showError("choice-error", error.message);
    return false;
  }
  if (mine !== generation) return true;
  byId("soil-note").textContent = state.model
    ? `Now: the model file, ${state.modelName}. Choose a gear or a soil to leave it.`
    : state.soils.find((entry) => entry.id === byId("soil").value).note;
  const opened = new Map([...document.querySelectorAll("details.group")].map((d) => [d.dataset.title, d.open]));
  state.sliders = new Map();
  const groups = found.groups.map(({ title, controls }, i) => {
    const made = controls.map((control) => new Slider(control, update));
    for (const slider of made) state.sliders.set(slider.path, slider);
    return element("details", { class: "group", "data-title": title, open: opened.get(title) ?? i < OPEN },
      element("summary", {}, title), ...made.map((slider) => slider.place));
  });
  byId("sliders").replaceChildren(...groups);
  update();
  return true;
}

/** Ask for new curves: one question at a time, and always about the latest values. */
async function update() {
  again = true;
  if (busy) return;
  busy = true;
  while (again) {
    again = false;
    const mine = generation;
    try {
      const answer = await ask("/api/forward", chosen());
      if (mine === generation) draw(answer);
    } catch (error) {
      if (mine === generation) fault(error.message);
    }
  }
  busy = false;
}

/** An error of the server, beside the slider that it names, else above the curves. */
function fault(text) {
  const slider = [...state.sliders.values()].find((s) => text.includes(`${s.path} is `));
  if (slider) slider.fail(text);
  else showError("forward-error", text);
}

function makePlots() {
  for (const [name, unit] of Object.entries(CURVES)) {
    plots[name] = new Plot(byId(`${name}-plot`), {
      x: "slip", y: null, reading: byId(`${name}-reading`),
      series: [{ label: "", colour: name, unit, width: 2.5 }],
    });
  }
  plots.stress = new Plot(byId("stress-plot"), {
    x: "angle from straight down (°)", y: "kPa", height: 250, reading: byId("stress-reading"),
    series: [
      { label: "σ", colour: "normal", unit: "kPa", width: 2.5 },
      { label: "τ", colour: "shear", unit: "kPa", width: 2.5 },
      { label: "strength", colour: "strength", unit: "kPa", dash: [6, 5], width: 1.8 },
    ],
  });
}

function draw(answer) {
  showError("forward-error", answer.reason ? `Slip ${number(answer.at.slip)}, load ${withUnit(answer.at.load, "N")}: ${answer.reason}` : "");
  byId("now").replaceChildren(
    now("Torque", answer.at.torque, "N m"), now("Drawbar pull", answer.at.pull, "N"),
    now("Pull over load", answer.at.pull_per_load, ""), now("Sinkage", answer.at.sinkage, "mm"));
  for (const name of Object.keys(CURVES)) drawCurve(name, answer);
  drawStress(answer);
}

const now = (label, value, unit) => element("div", {}, element("dt", {}, label),
  element("dd", {}, number(value), element("small", {}, unit ? `\u00a0${unit}` : "")));

function drawCurve(name, answer) {
  const here = answer.at[name];
  plots[name].set([answer.slip, answer[name]], [answer.at.slip, here, name],
    `${name === "pull" ? "Drawbar pull" : name} against slip; ${withUnit(here, CURVES[name])} at slip ${number(answer.at.slip)}`);
}

function drawStress({ profile, ...answer }) {
  byId("stress-figure").hidden = !profile;
  if (!profile) return;
  wheelPicture(byId("wheel-picture"), { profile, ...answer });
  const lines = ["angle", "normal", "shear", "strength"].map((name) => [...profile[name]].reverse());
  plots.stress.set(lines, null,
    `Stress against angle: normal stress up to ${number(Math.max(...profile.normal))} kPa, shear stress up to ${number(Math.max(...profile.shear))} kPa, entry at ${number(profile.angle[0])} degrees`);
  byId("mobilised").textContent = `${percent(profile.mobilised)} of the shear strength below the wheel is mobilised. Torque is the shear stress summed along the rim: it grows with slip, and with a smaller shear modulus K, until τ reaches the strength.`;
}

/** Set soil parameters (SI units by path), as an estimate found them. */
export function setSoil(values) {
  for (const [path, value] of Object.entries(values)) state.sliders.get(path)?.set(value);
  update();
}
