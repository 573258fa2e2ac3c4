// Answers: each is the report of a command in a frame as high as its content, with its files.

import { jobFile } from "./api.js";
import { byId, element, wordList } from "./dom.js";

const REPORTS = ["report.html", "runs.report.html"];

/** Show what a job has written in an element, in the place of an earlier answer of this title. */
export function showReport(place, title, { id, result }, ...actions) {
  const report = result.files.find((name) => REPORTS.includes(name));
  const frame = element("iframe", { title, sandbox: "allow-same-origin", src: jobFile(id, report, true) });
  frame.addEventListener("load", () => fit(frame));
  const save = (name) => element("a", { class: "button", href: jobFile(id, name) }, `Save ${name}`);
  const made = element("article", { class: "answer", "data-title": title },
    element("h3", {}, title), frame, wordList(result.remarks, "remark"),
    element("div", { class: "buttons" }, ...actions,
      element("a", { class: "button", href: jobFile(id, report, true), target: "_blank", rel: "noopener" }, "Open in a tab"),
      ...result.files.map(save)),
    element("p", { class: "note" }, "The same on the command line: ", element("code", {}, result.command)));
  byId(place).querySelector(`[data-title="${title}"]`)?.remove();
  byId(place).prepend(made);
  made.scrollIntoView({ block: "start" });
}

function fit(frame) {
  const { body } = frame.contentDocument;
  const measure = () => { frame.style.height = `${Math.ceil(body.getBoundingClientRect().bottom + frame.contentWindow.scrollY) + 20}px`; };
  new ResizeObserver(measure).observe(body);
  measure();
}
