// Which wheel drove the rows: asked before anything is estimated, where no model file says it.

import { byId, element, options } from "./dom.js";
import { chooseWheel, setWheelKnown, sizesOfWheel, update, wheelList } from "./forward.js";

/** Show the question; `answered()` is called once the sizes are confirmed. */
export function askForWheel(name, answered) {
  const sizes = element("div", { class: "sizes" });
  const list = element("select", { id: "ask-list", onchange: async () => {
    await chooseWheel(list.value);
    fill(sizes);
  } });
  options(list, wheelList(), byId("wheel").value);
  fill(sizes);
  byId("ask-wheel").replaceChildren(
    element("h3", {}, "Which wheel was it?"),
    element("p", {}, `No model file says which wheel drove ${name}. The soil depends on its sizes: give them, or drop a MODEL.toml.`),
    element("form", { onsubmit: (event) => {
      event.preventDefault();
      if (!sizesOfWheel().every((slider) => !slider.error.textContent)) return;
      byId("ask-wheel").hidden = true;
      setWheelKnown(true);
      update();
      answered();
    } },
      element("p", { class: "open" }, element("label", { for: "ask-list" }, "Like"), list), sizes,
      element("div", { class: "buttons" }, element("button", { class: "main", id: "ask-done" }, "These are right: estimate"))));
  byId("ask-wheel").hidden = false;
  byId("ask-wheel").scrollIntoView({ block: "nearest" });
  sizes.querySelector("input")?.focus({ preventScroll: true });
}

function fill(place) {
  place.replaceChildren(...sizesOfWheel().map((slider) => {
    const id = `ask-${slider.path.replace(".", "-")}`;
    const wrong = element("span", { class: "note wrong", id: `${id}-error`, role: "alert" });
    const input = element("input", { type: "number", id, step: "any", inputmode: "decimal", required: true, "aria-describedby": `${id}-error`, oninput: () => {
      slider.number.value = input.value;
      slider.typed();
      wrong.textContent = slider.error.textContent;
    } });
    input.value = slider.number.value;
    return element("p", { class: "open" }, element("label", { for: id }, `${slider.label} (${slider.unit})`), input, wrong);
  }));
}
