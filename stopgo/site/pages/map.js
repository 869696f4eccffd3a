// The floor as SVG, in metres: building, targets by what was seen of them, stops by state, paths and robots.
import { fill, h, say, svg } from "./dom.js";
import { t } from "./words.js";

const fixed = { "vector-effect": "non-scaling-stroke" };

export function place(frame, x, y) {
  return [x - frame.left, frame.top - y];
}

// Size of a stop's mark: large enough to press, and never larger than the distance of two stops allows.
export function markSize(drawing) {
  const size = 0.016 * Math.max(drawing.frame.width, drawing.frame.height);
  const apart = [];
  const stops = drawing.stops ?? [];
  for (let k = 1; k < stops.length; k++) {
    apart.push(Math.hypot(stops[k].x - stops[k - 1].x, stops[k].y - stops[k - 1].y));
  }
  apart.sort((a, b) => a - b);
  const usual = apart.length ? apart[apart.length >> 1] : Infinity;
  return Math.max(0.1, Math.min(size, 0.35 * usual));
}

export function floorLayers(drawing) {
  const { frame, layers = [], names = [] } = drawing;
  const size = 0.018 * Math.max(frame.width, frame.height);
  return [
    layers.map(({ kind, d, fill: area, stroke }) =>
      svg("path", { d, class: `layer ${kind}`, fill: area || null, stroke: stroke || null, "fill-rule": "evenodd", ...fixed })),
    placedNames(frame, names, size).map(({ name, x, y, font }) =>
      svg("text", { x, y, class: "room", "font-size": font, "text-anchor": "middle" }, name)),
  ];
}

// Names of rooms, smaller where one would cover another; the last ones are left out where none fits.
function placedNames(frame, names, size) {
  const placed = [];
  const covers = (one, other) => Math.abs(one.x - other.x) < 0.29 * (one.name.length * one.font + other.name.length * other.font)
    && Math.abs(one.y - other.y) < 0.55 * (one.font + other.font);
  for (const [name, x, y] of names) {
    const [px, py] = place(frame, x, y);
    const sizes = [1, 0.7, 0.5].map((part) => ({ name, x: px, y: py + 1.5 * part * size, font: part * size }));
    const fits = sizes.find((one) => !placed.some((other) => covers(one, other)));
    if (fits) placed.push(fits);
  }
  return placed;
}

// Class of a group of targets: seen, lost (no stop left that would see it), still to come, or never visible.
export function targetState(group, done, skipped) {
  if (!group.visible) return "hidden";
  const seen = group.stops.filter((id) => done.has(id)).length;
  if (seen >= group.need) return "seen";
  const left = group.stops.filter((id) => !skipped.has(id)).length;
  if (group.stops.length < group.need) return "unplanned";
  return left < group.need ? "lost" : "coming";
}

export function targetPaths(drawing, done, skipped) {
  const paths = { hidden: "", unplanned: "", coming: "", lost: "", seen: "" };
  for (const group of drawing.targets) paths[targetState(group, done, skipped)] += group.d;
  return Object.entries(paths).map(([state, d]) => svg("path", { d, class: `target ${state}`, ...fixed }));
}

// A stop's mark differs by shape as well as by colour.
export function stopMark(drawing, stop, state, size, more = {}) {
  const [x, y] = place(drawing.frame, stop.x, stop.y);
  const r = size;
  const shapes = {
    done: [svg("circle", { r, ...fixed }), svg("path", { d: `M${-0.5 * r} 0l${0.35 * r} ${0.4 * r}l${0.65 * r} ${-0.8 * r}`, class: "sign", ...fixed })],
    skipped: [svg("rect", { x: -r, y: -r, width: 2 * r, height: 2 * r, ...fixed }), svg("path", { d: `M${-0.5 * r} ${-0.5 * r}L${0.5 * r} ${0.5 * r}M${-0.5 * r} ${0.5 * r}L${0.5 * r} ${-0.5 * r}`, class: "sign", ...fixed })],
    current: [svg("path", { d: `M0 ${-1.5 * r}L${1.5 * r} 0L0 ${1.5 * r}L${-1.5 * r} 0Z`, ...fixed })],
    held: [svg("path", { d: `M0 ${-1.6 * r}L${1.6 * r} ${1.2 * r}L${-1.6 * r} ${1.2 * r}Z`, ...fixed })],
  };
  const marks = shapes[state] ?? [svg("circle", { r, ...fixed })];
  const label = stop.id.replace(/^s0*/i, "");
  const withText = !["done", "skipped"].includes(state);
  return svg("g", { class: `stop ${state}`, transform: `translate(${x} ${y})`, ...more },
    svg("title", {}, `${stop.id}: ${t(`stop_${state}`)}`), marks,
    withText && svg("text", { y: 0.38 * r, "font-size": 1.1 * r, "text-anchor": "middle" }, label));
}

export function robotMark(size) {
  return svg("g", { class: "robot" },
    svg("circle", { r: 1.2 * size, class: "halo", ...fixed }),
    svg("path", { d: `M${1.7 * size} 0L${-0.9 * size} ${size}L${-0.4 * size} 0L${-0.9 * size} ${-size}Z`, ...fixed }),
    svg("text", { "font-size": 1.5 * size, y: -2.1 * size, "text-anchor": "middle" }));
}

export function moveRobot(mark, frame, pose, name) {
  const [x, y] = place(frame, pose.x, pose.y);
  mark.setAttribute("transform", `translate(${x} ${y})`);
  mark.children[1].setAttribute("transform", `rotate(${(-180 * pose.heading) / Math.PI})`);
  say(mark.children[2], name);
}

// A map with things to press is a group: screen readers show nothing that is within an image.
export function emptyMap(label, role = "img") {
  return svg("svg", { class: "map", role, "aria-label": label, preserveAspectRatio: "xMidYMid meet" });
}

export function setFrame(map, frame) {
  map.setAttribute("viewBox", `0 0 ${frame.width} ${frame.height}`);
}

export function legend(entries, words = {}) {
  return h("ul", { class: "legend" }, entries.map((kind) => h("li", {}, sample(kind), t(words[kind] ?? `legend_${kind}`))));
}

function sample(kind) {
  const box = svg("svg", { viewBox: "-13 -7 26 14", width: 26, height: 14, "aria-hidden": "true" });
  if (["seen", "lost", "coming", "hidden", "unplanned"].includes(kind)) fill(box, svg("path", { d: "M-12 0H12", class: `target ${kind}` }));
  else if (kind === "path") fill(box, svg("path", { d: "M-12 0H12", class: "driven" }));
  else if (kind === "robot") fill(box, svg("g", { class: "robot" }, svg("path", { d: "M6 0L-4 5L-2 0L-4 -5Z" })));
  else {
    const frame = { left: 0, top: 0 };
    fill(box, stopMark({ frame }, { id: "", x: 0, y: 0 }, kind.replace("stop_", ""), kind.endsWith("held") || kind.endsWith("current") ? 3.6 : 5));
  }
  return box;
}
