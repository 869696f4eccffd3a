// Looking back: missions of the folder with their runs, reports, Rerun's viewer, downloads, and what is missing.
import { read, send } from "./api.js";
import { fill, h, say } from "./dom.js";
import { onChange } from "./store.js";
import { percent, t } from "./words.js";

const FORMS = ["pdf", "svg", "dxf", "csv", "json"];
const CELLS = ["began (UTC)", "robot", "ended", "took", "stops", "worst mm", "coverage", "acquired"];

export function makeBack(main, me) {
  const list = h("div", { class: "missions" });
  const note = h("p", { class: "notice", role: "status" }, t("reading_runs"));
  fill(main, h("section", { "aria-label": t("tab_back") }, note, list));
  load(list, note, me);
  return onChange((kinds) => {
    if (kinds.has("recording")) load(list, note, me);
  });
}

async function load(list, note, me) {
  try {
    const { missions, faults, left } = await read("/api/runs");
    say(note, left ? t("reading_left", { n: left }) : missions.length ? "" : t("no_recordings"));
    note.hidden = !left && missions.length > 0;
    fill(list, missions.map((one) => mission(one, me, () => load(list, note, me))),
      faults.map((fault) => h("p", { class: "bad" }, fault)));
    if (left && list.isConnected) load(list, note, me);
  } catch (error) {
    say(note, error.message);
  }
}

function mission(one, me, again) {
  const result = h("p", { class: "result", role: "status" });
  const operator = me.role === "operator";
  const plan = one.stops === null ? t("plan_missing") : t("plan_known", { stops: one.stops, coverage: percent(one.coverage) });
  return h("section", { class: "card mission", "aria-label": one.name },
    h("h2", {}, one.name), h("p", {}, plan),
    h("div", { class: "buttons" },
      h("a", { class: "button primary", href: `/reports/${one.key}`, target: "_blank", rel: "noopener" }, t(one.runs.length === 1 ? "report_one" : "report", { n: one.runs.length })),
      operator && h("button", { type: "button", onclick: () => view(one, result) }, t("open_viewer")),
      one.file && FORMS.map((form) => h("a", { class: "button", href: `/downloads?file=${encodeURIComponent(one.file)}&to=${form}`, download: "" }, form.toUpperCase())),
      operator && one.file && one.runs.length > 0 && h("button", { type: "button", onclick: () => followUp(one, result, again) }, t("follow_up"))),
    result, one.runs.length > 0 && h("div", { class: "scroll" }, table(one.runs)));
}

function table(runs) {
  return h("table", {}, h("thead", {}, h("tr", {}, CELLS.map((name) => h("th", { scope: "col" }, t(`cell_${name.split(" ")[0]}`))))),
    h("tbody", {}, runs.map((run) => h("tr", {}, CELLS.map((name) => h("td", {}, name === "acquired" ? t(`answer_${run[name]}`) : run[name]))))));
}

async function view(one, result) {
  const tab = window.open("about:blank", "_blank");
  say(result, t("merging"));
  try {
    const { address } = await send("/api/viewer", { key: one.key });
    say(result, "");
    result.append(h("a", { href: address, target: "_blank", rel: "noopener", class: "button" }, t("viewer_link")));
    if (tab) tab.location = address;
  } catch (error) {
    tab?.close();
    say(result, error.message);
  }
}

async function followUp(one, result, again) {
  say(result, t("planning_follow_up"));
  try {
    const made = await send("/api/follow-ups", { key: one.key });
    say(result, t("follow_up_made", made));
  } catch (error) {
    say(result, error.message);
  }
}
