// Elements of the page: text is always set as text, never as markup.

export const byId = (id) => document.getElementById(id);

/** An element with attributes, properties (`onclick`, `hidden`, `value`) and children. */
export function element(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (value === undefined || value === null || value === false) continue;
    if (name.startsWith("on")) made.addEventListener(name.slice(2), value);
    else if (name in made && typeof value !== "string") made[name] = value;
    else made.setAttribute(name === "className" ? "class" : name, value === true ? "" : value);
  }
  made.append(...children.filter((child) => child !== null && child !== undefined));
  return made;
}

const SVG = "http://www.w3.org/2000/svg";

/** The same for a picture. */
export function drawn(tag, attributes = {}, ...children) {
  const made = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  made.append(...children);
  return made;
}

/** Show an error beside what caused it; an empty text hides it. */
export function showError(id, text) {
  const place = byId(id);
  place.textContent = text || "";
  place.hidden = !text;
}

export function options(select, entries, chosen) {
  select.replaceChildren(...entries.map(({ id, label }) => element("option", { value: id }, label)));
  if (chosen !== undefined) select.value = chosen;
}

/** A list of texts, or nothing where there are none. */
export function wordList(texts, className = "") {
  if (!texts || !texts.length) return null;
  return element("ul", { class: `words ${className}` }, ...texts.map((t) => element("li", {}, t)));
}
