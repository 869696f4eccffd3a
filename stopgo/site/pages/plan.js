// Planning: a floor of the folder, twelve options, variants beside each other, and stops moved by hand.
import { failureText, read, send } from "./api.js";
import { fill, h, say, svg } from "./dom.js";
import { emptyMap, floorLayers, legend, markSize, place, setFrame, stopMark, targetPaths } from "./map.js";
import { all, onChange } from "./store.js";
import { duration, number, percent, t } from "./words.js";

const FORBIDDEN_M = 0.6;
const NUDGE_M = 0.1;
const FINGER_PX = 22;
const FLOOR_CHOICES = ["storey", "level", "drawing", "date"];
const chosen = { floor: null, options: {}, shown: null, base: null };
const drawings = new Map();
onChange((kinds) => { if (kinds.has("*")) drawings.clear(); }); // another server may count its variants from 1 again

export function makePlan(main, me) {
  const map = emptyMap(t("map_of_floor"), "group");
  const layers = Object.fromEntries(["floor", "targets", "progress", "legs", "stops", "findings", "pointer"].map((name) => [name, svg("g")]));
  map.append(...Object.values(layers));
  const view = {
    me, map, layers, form: h("form", { class: "options" }), findings: h("ul", { class: "findings" }),
    note: h("p", { class: "notice", role: "status" }), variants: h("div", { class: "variants" }),
    hand: h("div", { class: "hand", role: "group", "aria-label": t("by_hand") }), selected: null, mode: null, draft: null, focus: null, cards: new Map(), names: new Map(),
  };
  const may = me.role === "operator";
  fill(main, h("div", { class: "planning" },
    h("section", { class: "floor", "aria-label": t("tab_plan") }, view.note, map, view.hand,
      legend(["seen", "unplanned", "hidden", "stop_waiting"], { seen: "legend_covered", stop_waiting: "legend_stop" })),
    h("aside", {}, may ? view.form : h("p", { class: "notice" }, t("viewer_cannot_plan")),
      h("h2", {}, t("variants")), view.variants, h("h2", {}, t("findings")), view.findings)));
  map.addEventListener("click", (event) => pressedMap(view, event));
  const off = onChange((kinds) => {
    if (kinds.has("plan") || kinds.has("*")) drawVariants(view);
  });
  if (may) makeForm(view);
  drawVariants(view);
  return off;
}

async function makeForm(view) {
  const [{ floors, error }, { options }] = await Promise.all([
    read("/api/folder").catch((error) => ({ error })), read("/api/plan-options")]);
  if (error) return say(view.note, error.message);
  if (!floors.length) return say(view.note, t("no_floors"));
  const floor = h("select", { id: "floor", onchange: () => otherFloor(view) },
    floors.map((name) => h("option", { value: name, selected: name === chosen.floor }, name)));
  const fields = options.map((option) => h("label", {}, h("span", {}, t(`option_${option.key}`), option.unit && option.key !== "date" && ` (${option.unit})`), field(view, option)));
  fill(view.form, h("label", {}, h("span", {}, t("floor")), floor), fields,
    h("button", { type: "submit", class: "primary", id: "plan" }, t("plan_now")));
  view.form.onsubmit = (event) => {
    event.preventDefault();
    begin(view, { floor: floor.value, options: given(view), required: [], forbidden: [] });
  };
  view.floor = floor;
  await readFloor(view, !chosen.shown);
}

// Storeys, days and the place on Earth are those of one model: another floor begins without them.
function otherFloor(view) {
  fill(view.storeys, h("option", { value: "" }));
  for (const one of ["date", "origin"]) view.form.elements[one].value = "";
  readFloor(view, true);
}

function field(view, option) {
  const about = { name: option.key, id: `option-${option.key}`, title: option.help };
  const value = chosen.options[option.key] ?? "";
  const undecided = option.default || (/none|--|_/.test(option.undecided) ? "" : option.undecided);
  const reread = ["storey", "date"].includes(option.key) ? () => readFloor(view, true) : null;
  const words = option.flag ? ["yes", "no"] : option.choices;
  if (option.key === "storey") {
    const kept = Object.entries(chosen.options).filter(([key]) => key !== "date" && FLOOR_CHOICES.includes(key));
    const now = kept.length ? { value: JSON.stringify(Object.fromEntries(kept)) } : { value: "" };
    view.storeys = h("select", { ...about, onchange: reread }, h("option", now, kept[0]?.[1] ?? t("only_one")));
    return view.storeys;
  }
  if (words.length) {
    return h("select", about, h("option", { value: "" }, undecided || "–"), words.map((word) => h("option", { value: word, selected: word === value }, word)));
  }
  return h("input", { ...about, value, placeholder: undecided || option.form, autocomplete: "off", ...(reread ? { type: "date", onchange: reread } : {}) });
}

function given(view) {
  const options = {};
  for (const [name, value] of new FormData(view.form)) {
    if (value && name === "storey") Object.assign(options, JSON.parse(value));
    else if (value) options[name] = value;
  }
  chosen.options = options;
  return options;
}

async function readFloor(view, show) {
  chosen.floor = view.floor.value;
  const options = given(view);
  const asked = view.asked = {};
  say(view.note, t("reading", { floor: chosen.floor }));
  const wanted = Object.fromEntries(Object.entries(options).filter(([key]) => FLOOR_CHOICES.includes(key)));
  const found = await send("/api/floors", { floor: chosen.floor, options: wanted }).catch((error) => ({ trouble: error.message, storeys: [] }));
  if (asked !== view.asked) return; // another floor was chosen meanwhile
  const isChosen = (one) => Object.entries(one.options).every(([key, value]) => found.chosen[key] === value);
  fill(view.storeys, found.storeys.length ? null : h("option", { value: "" }, t("only_one")), found.storeys.map((one) =>
    h("option", { value: JSON.stringify(one.options), selected: isChosen(one) }, one.area_m2 ? `${one.name} (${number(one.area_m2)} m²)` : one.name)));
  given(view);
  say(view.note, found.trouble ?? t("floor_read", { area: number(found.about.area_m2), rooms: found.about.rooms, openings: found.about.openings }));
  if (show && found.drawing) {
    chosen.shown = null;
    showFloor(view, found.drawing);
  } else if (show) {
    chosen.shown = view.drawing = null;
    for (const layer of Object.values(view.layers)) fill(layer);
    fill(view.findings);
  }
}

function showFloor(view, drawing) {
  view.drawing = drawing;
  setFrame(view.map, drawing.frame);
  fill(view.layers.floor, floorLayers(drawing));
  for (const name of ["targets", "progress", "legs", "stops", "pointer"]) fill(view.layers[name]);
  showFindings(view, drawing.findings ?? []);
}

function showFindings(view, findings) {
  const frame = view.drawing.frame;
  const size = 0.014 * Math.max(frame.width, frame.height);
  const places = findings.filter((one) => one.at);
  fill(view.layers.findings, places.map((one, index) => {
    const [x, y] = place(frame, one.at[0], one.at[1]);
    return svg("g", { class: `finding ${one.rank}`, transform: `translate(${x} ${y})` }, svg("title", {}, one.text),
      svg("path", { d: `M0 ${-1.4 * size}L${1.3 * size} ${size}H${-1.3 * size}Z`, "vector-effect": "non-scaling-stroke" }),
      svg("text", { y: 0.75 * size, "font-size": 1.3 * size, "text-anchor": "middle" }, index + 1));
  }));
  fill(view.findings, findings.length ? findings.map((one) =>
    h("li", { class: one.rank }, one.at && h("b", {}, `${places.indexOf(one) + 1} `), one.text)) : h("li", {}, t("no_findings")));
}

async function begin(view, request) {
  try {
    const { number: made } = await send("/api/plans", request);
    chosen.shown = made;
    view.follow = made;
    drawVariants(view);
  } catch (error) {
    say(view.note, failureText(error));
  }
}

function variantsShown() {
  return all("plan").map((one) => one.value).sort((a, b) => a.number - b.number);
}

function drawVariants(view) {
  const variants = variantsShown();
  showCards(view, variants.map((one) => keptCard(view, one, variants)));
  const shown = variants.find((one) => one.number === chosen.shown) ?? null;
  if (shown) show(view, shown);
  drawHand(view, shown);
}

// A card is made anew only if it shows something else: what is typed or pressed while another page plans is not lost.
function keptCard(view, one, variants) {
  const base = variants.find((other) => other.number === one.request.base) ?? variants.filter((other) => other.report && other.number < one.number).pop();
  const shows = JSON.stringify([one, base?.report, one.number === chosen.shown]);
  const kept = view.cards.get(one.number);
  if (kept?.shows === shows) return kept.element;
  const element = card(view, one, base);
  view.cards.set(one.number, { shows, element });
  return element;
}

function showCards({ variants }, cards) {
  for (const old of [...variants.children]) if (!cards.includes(old)) old.remove();
  cards.forEach((one, place) => { if (variants.children[place] !== one) variants.insertBefore(one, variants.children[place] ?? null); });
}

function card(view, one, base) {
  const operator = view.me.role === "operator";
  const name = h("input", { value: view.names.get(one.number) ?? defaultName(one), "aria-label": t("name_of_plan"), autocomplete: "off", oninput: () => view.names.set(one.number, name.value) });
  const report = one.report;
  return h("section", { class: `variant ${one.state}${one.number === chosen.shown ? " focus" : ""}`, "aria-label": t("variant", { n: one.number }) },
    h("div", { class: "line" }, h("button", { type: "button", "aria-pressed": String(one.number === chosen.shown), onclick: () => { chosen.shown = one.number; view.selected = null; drawVariants(view); } }, t("variant", { n: one.number })),
      h("span", { class: "state" }, one.state === "running" ? t(`stage_${one.stage}`) : t(`variant_${one.state}`))),
    h("p", { class: "what" }, describe(one.request)),
    one.error && one.state === "failed" && h("p", { class: "bad", role: "alert" }, one.error),
    report && figures(report, base?.report),
    operator && one.state === "done" && h("div", { class: "buttons" }, name,
      h("button", { type: "button", class: one.saved ? "" : "primary", onclick: () => save(view, one, name.value) }, t("save"))),
    one.saved && h("p", { class: "result" }, t("saved_as", { file: one.saved })),
    operator && ["running", "waiting"].includes(one.state) && h("button", { type: "button", onclick: () => send(`/api/plans/${one.number}/cancel`, {}) }, t("cancel")));
}

function defaultName(one) {
  const { storey, level, drawing, date } = one.request.options;
  const stem = one.request.floor.split("/").pop().replace(/\.\w+$/, "");
  return one.request.replaces?.match(/^plans\/([^/]+)\//)?.[1] ?? [stem, storey ?? level ?? drawing, date].filter(Boolean).join("-");
}

function describe(request) {
  const options = Object.entries(request.options).map(([key, value]) => `${t(`option_${key}`)} ${value}`);
  if (request.required.length || request.forbidden.length) options.push(t("by_hand_count", { n: request.required.length, not: request.forbidden.length }));
  return [request.floor, ...options].join(" · ");
}

function figures(report, base) {
  const joined = (one) => !one.findings.some((finding) => finding.code === "scans_not_joined");
  const rows = [
    [t("figure_stops"), number(report.stops), base && signed(report.stops - base.stops, 0)],
    [t("figure_coverage"), percent(report.coverage), base && signed(100 * (report.coverage - base.coverage), 1, " %")],
    [t("figure_route"), `${number(report.length_m, 1)} m`, base && signed(report.length_m - base.length_m, 1, " m")],
    [t("figure_time"), duration(report.total_s), base && signed((report.total_s - base.total_s) / 60, 1, " min")],
    [t("figure_twice"), percent(report.twice), base && signed(100 * (report.twice - base.twice), 1, " %")],
    [t("figure_overlap"), joined(report) ? t("joined") : t("not_joined"), base && joined(base) !== joined(report) ? "≠" : ""],
  ];
  return h("table", {}, h("tbody", {}, rows.map(([name, value, change]) =>
    h("tr", {}, h("th", { scope: "row" }, name), h("td", {}, value), h("td", { class: "change" }, change || "")))),
    report.coverage < report.required && h("caption", { class: "bad" }, t("below_required", { required: percent(report.required) })));
}

function signed(value, digits, unit = "") {
  const rounded = Number(value.toFixed(digits));
  return rounded === 0 ? "±0" : `${rounded > 0 ? "+" : "−"}${number(Math.abs(rounded), digits)}${unit}`;
}

async function save(view, one, name) {
  try {
    await send(`/api/plans/${one.number}/save`, { name });
  } catch (error) {
    say(view.note, failureText(error));
  }
}

async function show(view, one) {
  if (one.state === "done") {
    const drawing = drawings.get(one.number) ?? await read(`/api/plans/${one.number}/drawing`).catch(() => null);
    if (drawing) drawings.set(one.number, drawing);
    if (!drawing || chosen.shown !== one.number) return;
    showFloor(view, { ...drawing, findings: one.report.findings });
    view.size = markSize(drawing);
    const seen = new Set(drawing.stops.map((stop) => stop.id));
    fill(view.layers.targets, targetPaths(drawing, seen, new Set()));
    fill(view.layers.legs, svg("path", { d: drawing.legs, class: "legs", "vector-effect": "non-scaling-stroke" }));
    drawStops(view, drawing);
    return;
  }
  if (one.error) say(view.note, one.state === "failed" ? one.error : t("variant_cancelled"));
  if (one.drawing && view.drawing?.made !== one.number) showFloor(view, { ...one.drawing, made: one.number });
  if (!view.drawing || !one.drawing) return;
  const frame = view.drawing.frame;
  const r = 0.004 * Math.max(frame.width, frame.height);
  const dot = (radius, kind) => ([x, y]) => {
    const [px, py] = place(frame, x, y);
    return svg("circle", { cx: px, cy: py, r: radius, class: kind });
  };
  fill(view.layers.progress, one.chosen ? one.chosen.map(dot(3 * r, "chosen")) : (one.candidates ?? []).map(dot(r, "candidate")));
  const line = (leg) => "M" + leg.map(([x, y]) => place(frame, x, y).map((part) => part.toFixed(2)).join(" ")).join("L");
  fill(view.layers.legs, one.legs && svg("path", { d: one.legs.map(line).join(""), class: "legs", "vector-effect": "non-scaling-stroke" }));
}

// Stops of the plan and of the changes by hand: those that go are crossed out, those that come are named +1.
function drawStops(view, drawing) {
  const draft = draftOf(view);
  const gone = new Set(draft?.gone);
  const stops = [...drawing.stops.map((stop) => [stop, gone.has(stop.id) ? "skipped" : "waiting"]), ...(draft?.added ?? []).map((stop) => [stop, "waiting"])];
  fill(view.layers.stops, stops.map(([stop, state]) => {
    const pick = () => { view.selected = stop.id; view.mode = null; drawVariants(view); };
    return stopMark(drawing, stop, view.selected === stop.id ? "current" : state, view.size, {
      tabindex: "0", role: "button", "aria-label": t("stop_named", { stop: stop.id }), "data-stop": stop.id,
      onclick: (event) => { if (view.mode) return; event.stopPropagation(); pick(); },
      onkeydown: (event) => keyOnStop(view, event, stop, pick),
    });
  }));
  if (view.focus) view.layers.stops.querySelector(`[data-stop="${view.focus}"]`)?.focus();
}

function keyOnStop(view, event, stop, pick) {
  const steps = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
  if (event.key === "Enter" || event.key === " ") pick();
  else if (event.key === "Delete") edit(view, { without: stop.id });
  else if (steps[event.key]) {
    const [dx, dy] = steps[event.key];
    edit(view, { without: stop.id, at: [stop.x + NUDGE_M * dx, stop.y + NUDGE_M * dy] });
  } else return;
  event.preventDefault();
}

function drawHand(view, shown) {
  if (view.me.role !== "operator" || shown?.state !== "done") return fill(view.hand);
  const mode = (name) => () => { view.mode = view.mode === name ? null : name; drawHand(view, shown); };
  const button = (name, work, needs) => (!needs || view.selected) && h("button", { type: "button", "aria-pressed": String(view.mode === name), onclick: work }, t(`hand_${name}`, { stop: view.selected }));
  const draft = draftOf(view);
  fill(view.hand, h("span", { role: "status" }, view.mode ? t(`hand_${view.mode}_where`) : draft ? costText(draft) : view.selected ? "" : t("hand_help")),
    button("add", mode("add")), button("move", mode("move"), true), button("forbid", () => edit(view, { without: view.selected }), true),
    draft && h("button", { type: "button", class: "primary", onclick: () => planDraft(view, shown) }, t("hand_plan")),
    draft && h("button", { type: "button", onclick: () => { view.draft = view.selected = null; drawVariants(view); } }, t("hand_discard")));
}

// A press near a stop picks it, so that its target is as large as a finger.
function pressedMap(view, event) {
  if (!view.drawing) return;
  const scale = view.map.getScreenCTM();
  const point = new DOMPoint(event.clientX, event.clientY).matrixTransform(scale.inverse());
  const { left, top } = view.drawing.frame;
  const at = [Math.round(1000 * (point.x + left)) / 1000, Math.round(1000 * (top - point.y)) / 1000];
  if (view.mode) return edit(view, view.mode === "add" ? { at } : { without: view.selected, at });
  const stops = [...(view.drawing.stops ?? []), ...(draftOf(view)?.added ?? [])];
  const away = (stop) => Math.hypot(stop.x - at[0], stop.y - at[1]) * scale.a;
  const nearest = stops.sort((a, b) => away(a) - away(b))[0];
  if (!nearest || away(nearest) > FINGER_PX) return;
  view.selected = nearest.id;
  drawVariants(view);
}

function draftOf(view) {
  return view.draft?.number === chosen.shown ? view.draft : null;
}

// What a change costs is there at once, from what the plan's stops see. The plan is made again on demand.
async function edit(view, change) {
  const drawing = drawings.get(chosen.shown);
  if (!drawing) return;
  const before = draftOf(view);
  const draft = withChange(before ?? { number: chosen.shown, gone: [], added: [], named: 0 }, change);
  view.draft = draft;
  view.mode = view.selected = null;
  view.focus = change.at ? draft.added.at(-1).id : null;
  drawVariants(view);
  const kept = drawing.stops.map((stop) => stop.id).filter((id) => !draft.gone.includes(id));
  try {
    draft.cost = await send(`/api/plans/${draft.number}/edit`, { kept, added: draft.added.map((stop) => [stop.x, stop.y]) });
  } catch (error) {
    if (view.draft === draft) view.draft = before;
    say(view.note, t("not_changed", { reason: error.message }));
  }
  drawVariants(view);
}

function withChange(draft, { without = null, at = null }) {
  const isNew = draft.added.some((stop) => stop.id === without);
  const added = draft.added.filter((stop) => stop.id !== without);
  const gone = without && !isNew ? [...new Set([...draft.gone, without])] : draft.gone;
  const named = draft.named + (at && !isNew ? 1 : 0);
  if (at) added.push({ id: isNew ? without : `+${named}`, x: at[0], y: at[1] });
  return { number: draft.number, gone, added, named };
}

function costText({ cost }) {
  if (!cost) return t("hand_counting");
  const { before, after } = cost;
  return t("hand_cost", {
    coverage: percent(after.coverage), coverage_change: signed(100 * (after.coverage - before.coverage), 1, " %"),
    twice: percent(after.twice), twice_change: signed(100 * (after.twice - before.twice), 1, " %"),
    time: duration(after.total_s), time_change: signed((after.total_s - before.total_s) / 60, 1, " min"),
  });
}

// The changes become a new variant beside this one: all other stops stay, so the difference is their cost.
// A stop in a doorway cannot be required; the planner chooses it again where it is needed.
function planDraft(view, base) {
  const [draft, drawing] = [draftOf(view), drawings.get(chosen.shown)];
  if (!draft || !drawing) return;
  const gone = drawing.stops.filter((stop) => draft.gone.includes(stop.id));
  const stay = drawing.stops.filter((stop) => !draft.gone.includes(stop.id) && !stop.doorway);
  const required = [...stay, ...draft.added].map((stop) => [stop.x, stop.y]);
  const radius = (stop) => Math.min(FORBIDDEN_M, ...draft.added.map((one) => 0.5 * Math.hypot(one.x - stop.x, one.y - stop.y)));
  const forbidden = [...base.request.forbidden, ...gone.map((stop) => [stop.x, stop.y, radius(stop)])];
  view.draft = view.mode = view.selected = view.focus = null;
  const { floor, options, replaces } = base.request;
  begin(view, { floor, options, required, forbidden, replaces: base.saved ?? replaces ?? null });
}
