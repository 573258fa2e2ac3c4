// A report of any analysis, as the program makes it: verdict, pictures, tables, remarks.

import { element, fold, wordList } from "./dom.js";

/** The elements of a report; `buttons` stand below its verdict. */
export function reportParts(report, buttons) {
  const [first, ...others] = report.pictures;
  const lead = report.with_figures ? 1 : 0;
  return [
    element("article", { class: `verdict tone-${report.tone}` },
      element("p", { class: "sentence" }, report.status ? element("span", { class: "badge" }, report.status) : null, report.verdict),
      ...report.lines.map((line) => element("p", {}, line)),
      report.next.length ? element("p", {}, element("b", {}, "What to do: "), report.next[0]) : null),
    buttons,
    first ? picture(first) : null,
    ...report.tables.slice(0, lead).map(table),
    ...others.map((one) => fold(one.title, picture(one))),
    ...report.tables.slice(lead).map((one) => fold(one.title, table(one))),
    fold("Remarks", wordList([...report.next.slice(1), ...report.remarks])),
    ...report.details.map(([head, texts]) => fold(head, wordList(texts))),
  ].filter(Boolean);
}

function picture({ title, caption, images }) {
  return element("div", { role: "group", "aria-label": title },
    caption ? element("p", { class: "note" }, caption) : null,
    element("div", { class: "panels" }, ...images.map((svg) => {
      const image = new DOMParser().parseFromString(svg, "text/html").querySelector("svg");
      return element("figure", {}, document.importNode(image, true));
    })));
}

function table({ title, note, heads, rows, words }) {
  const cell = (text, i) => element(i ? "td" : "th", i ? { class: words[i] ? "" : "num" } : { scope: "row" }, text);
  return element("div", { class: "scroll", tabindex: "0", role: "region", "aria-label": title },
    note ? element("p", { class: "note" }, note) : null,
    element("table", {}, element("caption", {}, title),
      element("thead", {}, element("tr", {}, ...heads.map((head) => element("th", { scope: "col" }, head)))),
      element("tbody", {}, ...rows.map((row) => element("tr", {}, ...row.map(cell))))));
}
