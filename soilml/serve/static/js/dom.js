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

/** Save a text as a file of this name. */
export function saveText(name, text) {
  const link = element("a", { href: URL.createObjectURL(new Blob([text], { type: "text/plain" })), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}

/** Select the line of a text box that an error names, by its number or by [table] and key. */
export function jumpTo(box, message) {
  const lines = box.value.split("\n");
  const at = lineOf(lines, message);
  if (at < 0 || at >= lines.length) return false;
  const fold = box.closest("details");
  if (fold) fold.open = true;
  const start = lines.slice(0, at).reduce((sum, line) => sum + line.length + 1, 0);
  box.focus({ preventScroll: true });
  box.setSelectionRange(start, start + lines[at].length);
  const height = parseFloat(getComputedStyle(box).lineHeight);
  box.scrollTop = Math.max(0, (at - 4) * height);
  box.scrollIntoView({ block: "nearest" });
  return true;
}

function lineOf(lines, message) {
  const number = /\bline (\d+)/.exec(message);
  if (number) return Number(number[1]) - 1;
  for (const [, table] of message.matchAll(/\[\[?([\w.-]+)\]/g)) {
    const head = lines.findIndex((line) => new RegExp(`^\\s*\\[\\[?${table.replaceAll(".", "\\.")}\\]`).test(line));
    if (head < 0) continue;
    let best = [Infinity, head]; // the key that the message names first
    for (let i = head + 1; i < lines.length && !/^\s*\[/.test(lines[i]); i += 1) {
      const key = /^\s*([\w.-]+)\s*=/.exec(lines[i])?.[1];
      const where = key ? message.search(new RegExp(`(?<![\\w])${key}(?![\\w])`)) : -1;
      if (where >= 0 && where < best[0]) best = [where, i];
    }
    return best[1];
  }
  return -1;
}
