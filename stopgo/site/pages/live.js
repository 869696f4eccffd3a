// The live floor: robots, their states with ages, what was seen and what is lost; and their orders.
import { read } from "./api.js";
import { fill, h, say, svg } from "./dom.js";
import { emptyMap, floorLayers, legend, markSize, moveRobot, robotMark, setFrame, stopMark, targetPaths } from "./map.js";
import { makeOrders, showOrders } from "./orders.js";
import { age, all, get, onChange, told } from "./store.js";
import { agoText, clock, duration, has, number, percent, t } from "./words.js";

const OLD_MS = 2500;
const drawings = new Map();
let focus = null;
let showPlan = true;

export function makeLive(main, me) {
  const map = emptyMap(t("map_of_floor"));
  const layers = { floor: svg("g"), targets: svg("g"), paths: svg("g"), stops: svg("g"), robots: svg("g") };
  map.append(...Object.values(layers));
  const cards = h("div", { class: "cards" });
  const events = h("ol", { class: "events", "aria-label": t("events") });
  const note = h("p", { class: "notice", hidden: true });
  const shares = h("dl", { class: "shares" });
  fill(main,
    h("div", { class: "live" },
      h("section", { class: "floor", "aria-label": t("live_floor") }, note, map, shares,
        legend(["seen", "coming", "lost", "hidden", "path", "stop_waiting", "stop_current", "stop_held", "stop_done", "stop_skipped", "robot"])),
      h("aside", {}, cards, h("h2", {}, t("events")), events)));
  const view = { me, map, layers, cards, events, note, shares, marks: new Map(), shown: "" };
  const redraw = (kinds) => drawAll(view, kinds);
  const off = onChange(redraw);
  const ticker = setInterval(() => tick(view), 250);
  redraw(new Set(["*"]));
  return () => {
    off();
    clearInterval(ticker);
  };
}

function drawAll(view, kinds) {
  const any = (...names) => kinds.has("*") || names.some((name) => kinds.has(name));
  const robots = all("robot");
  if (!focus || !get("robot", focus)) focus = robots.map((one) => one.key[1]).sort()[0] ?? null;
  if (any("robot", "mission", "run", "recording", "order", "stop")) drawCards(view, robots);
  if (any("mission", "coverage", "robot")) drawFloor(view);
  if (any("pose")) drawRobots(view);
  if (any("path", "run")) drawPaths(view);
  if (any("event", "run")) drawEvents(view);
}

async function drawingOf(mission) {
  const key = `${mission.id}/${mission.revision}/${mission.trouble}`;
  if (!drawings.has(key)) drawings.set(key, read(`/api/missions/${mission.id}/${mission.revision}`).catch(() => null));
  const drawing = await drawings.get(key);
  if (drawing === null) drawings.delete(key);
  return drawing;
}

async function drawFloor(view) {
  const mission = focus && get("mission", focus);
  if (!mission) {
    view.note.hidden = false;
    const state = (focus && get("robot", focus)) ?? {};
    const known = state.mission_id ? "mission_comes" : state.boot_id ? "no_mission" : "robot_not_found";
    say(view.note, t(focus ? known : "no_robots", { robot: focus }));
    return;
  }
  const drawing = await drawingOf(mission);
  if (!drawing || mission !== get("mission", focus)) return;
  view.note.hidden = drawing.has_floor;
  if (!drawing.has_floor) say(view.note, mission.trouble === "no_plan" ? t("no_plan") : t("plan_unread", { reason: mission.trouble }));
  if (view.shown !== `${focus} ${mission.id} ${mission.revision} ${drawing.has_floor}`) {
    view.shown = `${focus} ${mission.id} ${mission.revision} ${drawing.has_floor}`;
    setFrame(view.map, drawing.frame);
    fill(view.layers.floor, floorLayers(drawing), svg("path", { d: drawing.legs, class: "legs", "vector-effect": "non-scaling-stroke" }));
    view.drawing = drawing;
    view.size = markSize(drawing);
    drawRobots(view);
    drawPaths(view);
  }
  const coverage = get("coverage", focus);
  const [done, skipped] = [new Set(coverage?.done ?? []), new Set(coverage?.skipped ?? [])];
  fill(view.layers.targets, targetPaths(drawing, done, skipped));
  const state = get("robot", focus) ?? {};
  drawStops(view, drawing, (stop) => stopState(stop, state, done, skipped));
  drawShares(view, coverage?.coverage, done, skipped, drawing);
}

// Only marks of stops whose state has changed are made again: a mission may have hundreds.
function drawStops(view, drawing, stateOf) {
  if (view.markedFor !== view.shown) {
    view.markedFor = view.shown;
    view.stops = new Map();
    fill(view.layers.stops);
  }
  for (const stop of drawing.stops) {
    const [state, before] = [stateOf(stop), view.stops.get(stop.id)];
    if (before?.state === state) continue;
    const mark = stopMark(drawing, stop, state, view.size);
    if (before) before.mark.replaceWith(mark);
    else view.layers.stops.append(mark);
    view.stops.set(stop.id, { state, mark });
  }
}

function stopState(stop, state, done, skipped) {
  if (done.has(stop.id)) return "done";
  if (skipped.has(stop.id)) return "skipped";
  if (state.stop === stop.id) return state.state === "HELD" ? "held" : "current";
  return "waiting";
}

function drawShares(view, coverage, done, skipped, drawing) {
  const rows = [[t("stops_done"), t("of", { n: done.size, all: drawing.stops.length })]];
  if (skipped.size) rows.push([t("stops_skipped"), number(skipped.size)]);
  if (coverage) {
    rows.push([t("coverage_now"), percent(coverage.acquired)], [t("coverage_planned"), percent(coverage.planned)],
      [t("coverage_required"), percent(coverage.required)], [t("coverage_lost"), percent(coverage.lost)]);
  }
  fill(view.shares, rows.map(([name, value]) => h("div", {}, h("dt", {}, name), h("dd", {}, value))));
}

function drawRobots(view) {
  if (!view.drawing) return;
  const names = new Set();
  for (const { key, value } of all("pose")) {
    const name = key[1];
    names.add(name);
    if (!view.marks.has(name)) {
      const mark = robotMark(view.size);
      view.marks.set(name, mark);
      view.layers.robots.append(mark);
    }
    moveRobot(view.marks.get(name), view.drawing.frame, value, name);
    view.marks.get(name).classList.toggle("focus", name === focus);
  }
  for (const [name, mark] of view.marks) if (!names.has(name)) mark.remove(), view.marks.delete(name);
}

function drawPaths(view) {
  if (!view.drawing) return;
  const { left, top } = view.drawing.frame;
  const paths = new Map();
  for (const { key, value } of all("path")) {
    if (value.xy.length < 2) continue;
    const d = "M" + value.xy.map(([x, y]) => `${(x - left).toFixed(2)} ${(top - y).toFixed(2)}`).join("L");
    paths.set(key[1], (paths.get(key[1]) ?? "") + d);
  }
  fill(view.layers.paths, [...paths].map(([name, d]) =>
    svg("path", { d, class: name === focus ? "driven" : "driven other", "vector-effect": "non-scaling-stroke" })));
}

function drawEvents(view) {
  const found = focus ? all("event", focus).sort((a, b) => b.value.number - a.value.number) : [];
  fill(view.events, found.slice(0, 60).map(({ value }) => h("li", { class: `event ${value.event}` },
    h("span", { class: "when" }, duration(value.mission_time_s)), " ", eventText(value))));
}

export function eventText(value) {
  const key = `event_${value.event}`;
  if (!has(key)) return value.event;
  const at = value.at ? t("at_place", { x: number(value.at[0], 1), y: number(value.at[1], 1) }) : "";
  return t(key, {
    stop: value.stop ?? "", reason: value.reason ?? "", who: value.commander ?? "", before: value.before ?? "",
    mm: number(1000 * (value.deviation_m ?? 0)), file: value.file ?? "", waiting: value.waiting ?? "",
    revision: value.revision ?? "", silent: number(value.silent_s ?? 0), place: at,
  });
}

function drawCards(view, robots) {
  const names = robots.map((one) => one.key[1]).sort();
  if (view.names !== names.join("\n")) {
    view.names = names.join("\n");
    view.card = new Map(names.map((name) => [name, makeCard(view, name)]));
    fill(view.cards, [...view.card.values()].map((card) => card.element));
  }
  for (const [name, card] of view.card) showCard(view, name, card);
}

function makeCard(view, name) {
  const parts = {
    word: h("strong", { class: "state" }), age: h("span", { class: "age" }), where: h("p"), battery: h("p"),
    lease: h("p", { class: "lease" }), trouble: h("p", { class: "trouble", role: "status" }), reason: h("p", { class: "reason", role: "alert" }),
    vehicle: h("p", { class: "lease" }),
  };
  const choose = h("button", { type: "button", class: "name", onclick: () => {
    focus = name;
    view.shown = "";
    drawAll(view, new Set(["*"]));
  } }, name);
  const orders = view.me.role === "operator" ? makeOrders(name, view.me) : null;
  const element = h("section", { class: "card", "aria-label": t("robot_named", { robot: name }) },
    h("div", { class: "line" }, choose, parts.word, parts.age), parts.reason, parts.where, parts.battery, parts.lease, parts.vehicle, parts.trouble, orders);
  return { element, choose, orders, ...parts };
}

function showCard(view, name, card) {
  const state = get("robot", name) ?? {};
  const mission = get("mission", name);
  card.element.classList.toggle("focus", name === focus);
  card.choose.setAttribute("aria-pressed", String(name === focus));
  card.word.className = `state ${state.state ?? "none"}`;
  say(card.word, state.state ? t(`state_${state.state}`) : t("state_unknown"));
  const at = state.stop ? t("works_at", { stop: state.stop, what: t(`work_${state.stop_state}`) }) : "";
  const done = mission ? t("mission_progress", { name: mission.name, revision: state.revision, n: state.done_count ?? 0, all: mission.stops }) : "";
  const next = state.next_revision ? t("next_revision", { revision: state.next_revision }) : "";
  say(card.where, [done, at, next].filter(Boolean).join(" · "));
  say(card.battery, healthText(state));
  say(card.vehicle, state.vehicle ? t("drives_own_list", { url: state.vehicle.url }) : "");
  const holder = state.lease && state.lease.left_s > 0 ? state.lease.holder : null;
  say(card.lease, !holder ? t("lease_free") : holder === view.me.commander ? t("lease_mine") : t("lease_other", { who: holder }));
  const held = all("event", name).filter((one) => ["Held", "Paused", "Homing", "Aborted"].includes(one.value.event))
    .sort((a, b) => b.value.number - a.value.number)[0]?.value;
  const stands = ["HELD", "PAUSED", "HOMING", "ABORTED"].includes(state.state);
  say(card.reason, stands && held ? eventText(held) : "");
  const troubles = (state.trouble ?? []).map((one) => (has(`trouble_${one}`) ? t(`trouble_${one}`) : one));
  const recording = get("recording", name)?.trouble;
  say(card.trouble, [...troubles, ...(recording ? [t("not_recorded", { reason: recording })] : [])].join("; "));
  if (card.orders) showOrders(card.orders, name, state, holder);
}

function healthText(state) {
  const words = [t("battery", { charge: state.battery === null || state.battery === undefined ? t("unknown") : percent(state.battery, 0) })];
  if (state.battery_ok === false) words.push(t("battery_failsafe"));
  if (state.position_ok === false) words.push(t("position_lost"));
  if (state.fence_ok === false) words.push(t("fence_breached"));
  if (state.outside_count) words.push(t("outside_tolerance", { n: state.outside_count }));
  return words.join(" · ");
}

function tick(view) {
  for (const [name, card] of view.card ?? []) {
    const one = told("robot", name);
    const known = one && one.value.boot_id;
    const ms = known ? age(one.at) : 0;
    say(card.age, known ? agoText(ms) : t("never_heard"));
    card.element.classList.toggle("old", !known || ms > OLD_MS);
    view.marks.get(name)?.classList.toggle("old", !told("pose", name) || age(told("pose", name).at) > OLD_MS);
  }
}
