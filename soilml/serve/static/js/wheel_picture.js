// The lower part of the wheel in the soil, to scale, with normal and shear stress along the rim.

import { drawn } from "./dom.js";
import { number } from "./format.js";

const WIDTH = 420, HEIGHT = 292, RIM = 140, FAN = 64;

/** Draw the wheel of an answer into an element; a gear that is no wheel has no picture. */
export function wheelPicture(place, answer) {
  const { profile, radius, at } = answer;
  const isWheel = answer.gear.endsWith("wheel") && profile && radius > 0;
  place.hidden = !isWheel;
  if (!isWheel) return;
  const scale = RIM / radius;
  const cx = WIDTH / 2 - 20, cy = 70;
  const depth = Math.min(at.sinkage / 1000, radius) * scale;
  const surface = cy + RIM - depth;
  const entry = (profile.angle[0] * Math.PI) / 180;
  const xEntry = cx + RIM * Math.sin(entry);
  const bottom = cy + RIM;
  // travel is to the right: the soil in front of the wheel is untouched, behind it is the rut
  const ground = `M0 ${HEIGHT} L0 ${bottom} L${cx} ${bottom} ${rim(cx, cy, 0, entry)} L${xEntry} ${surface} L${WIDTH} ${surface} L${WIDTH} ${HEIGHT} Z`;
  const edge = `M0 ${bottom} L${cx} ${bottom} ${rim(cx, cy, 0, entry)} L${WIDTH} ${surface}`;
  const largest = Math.max(...profile.normal, ...profile.shear.map(Math.abs), 1e-9);
  const outside = (values) => values.map((value, i) => {
    const angle = (profile.angle[i] * Math.PI) / 180, r = RIM + (FAN * value) / largest;
    return [cx + r * Math.sin(angle), cy + r * Math.cos(angle)];
  });
  const line = (points) => points.map(([x, y], i) => `${i ? "L" : "M"}${x.toFixed(1)} ${y.toFixed(1)}`).join(" ");
  const normal = outside(profile.normal);
  const arrows = normal.filter((_, i) => i % 8 === 4).map(([x, y], k) => {
    const angle = (profile.angle[8 * k + 4] * Math.PI) / 180;
    const to = [cx + RIM * Math.sin(angle), cy + RIM * Math.cos(angle)];
    return drawn("line", { class: "p-arrow", x1: x, y1: y, x2: to[0], y2: to[1] });
  });
  const closed = `${line(normal)} ${rimBack(cx, cy, profile.angle.at(-1) * Math.PI / 180, entry)} Z`;
  const picture = drawn("svg", { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, "aria-hidden": "true" },
    drawn("path", { class: "p-ground", d: ground }),
    drawn("path", { class: "p-surface", d: edge }),
    drawn("circle", { class: "p-wheel", cx, cy, r: RIM }),
    drawn("circle", { class: "p-hub", cx, cy, r: 5 }),
    drawn("path", { class: "p-normal", d: closed }), ...arrows,
    drawn("path", { class: "p-shear", d: line(outside(profile.shear)) }),
    ...turning(cx, cy, at.slip), ...sinkage(surface, bottom, at.sinkage));
  place.replaceChildren(picture);
  place.setAttribute("aria-label",
    `Wheel in the soil: sinkage ${number(at.sinkage)} mm, contact from ${number(profile.angle[0])} to ${number(profile.angle.at(-1))} degrees`);
}

const point = (cx, cy, angle) => `${(cx + RIM * Math.sin(angle)).toFixed(1)} ${(cy + RIM * Math.cos(angle)).toFixed(1)}`;
const rim = (cx, cy, from, to) => `A${RIM} ${RIM} 0 0 0 ${point(cx, cy, to)}`;
const rimBack = (cx, cy, from, to) => `L${point(cx, cy, from)} A${RIM} ${RIM} 0 0 0 ${point(cx, cy, to)}`;

function turning(cx, cy, slip) {
  const r = 44;
  const text = slip < 0 ? "braking" : "driving";
  return [
    drawn("path", { class: "p-dim", d: `M${cx - r} ${cy} A${r} ${r} 0 0 1 ${cx} ${cy - r}` }),
    drawn("path", { class: "p-dim", d: `M${cx - 6} ${cy - r - 5} L${cx + 1} ${cy - r} L${cx - 6} ${cy - r + 5}` }),
    label(cx - 22, cy - 12, text),
    drawn("path", { class: "p-dim", d: `M${WIDTH - 60} 24 h44 m-7 -5 l7 5 l-7 5` }),
    label(WIDTH - 60, 16, "travel"),
  ];
}

function sinkage(surface, bottom, depth) {
  const x = 30;
  return [
    drawn("path", { class: "p-dim", "stroke-dasharray": "3 3", d: `M8 ${surface} H${x + 90}` }),
    drawn("path", { class: "p-dim", d: `M${x} ${surface} V${bottom}` }),
    label(x + 8, Math.max(surface - 6, 12), `${number(depth)} mm`),
  ];
}

function label(x, y, text) {
  const made = drawn("text", { class: "p-text", x, y });
  made.textContent = text;
  return made;
}
