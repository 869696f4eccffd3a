// The STOP bar: always on screen, always enabled, whatever the page believes of any robot.
import { orderId, send } from "./api.js";
import { fill, h, say } from "./dom.js";
import { age, all, told } from "./store.js";
import { clock, seconds, t } from "./words.js";

const RETRY_MS = 300;
const GIVE_UP_MS = 20000;
const TWICE_MS = 800;
let press = null;
let escaped = -Infinity;

export function makeStopBar(bar, me) {
  if (me.role !== "operator") {
    fill(bar, h("p", { class: "watching" }, t("viewer_cannot_stop")));
    return;
  }
  const list = h("ul", { id: "stopped" });
  const button = h("button", { id: "stop", type: "button", "aria-describedby": "stop-help", onclick: pressed });
  fill(button, h("span", { class: "big" }, t("stop")), h("span", { class: "small" }, t("stop_all")));
  fill(bar, button, list, h("p", { id: "stop-help", class: "hidden-text" }, t("stop_help")));
  document.addEventListener("keydown", (event) => {
    if (event.key !== "Escape" || event.repeat) return;
    const at = event.timeStamp; // when the key went down: a busy page handles it later
    if (at - escaped < TWICE_MS) pressed();
    escaped = at - escaped < TWICE_MS ? -Infinity : at;
  });
  setInterval(() => show(list), 100);
}

// A press is sent again until the server has it: a pause that comes twice is carried out once.
async function pressed() {
  const mine = { id: orderId(), at: Date.now(), began: performance.now(), state: "sending", robots: [] };
  press = mine;
  while (press === mine && mine.state !== "answered" && performance.now() - mine.began < GIVE_UP_MS) {
    try {
      const answer = await send("/api/stop", { id: mine.id, robots: mine.robots }, AbortSignal.timeout(8000));
      mine.state = "answered";
      mine.orders = answer.orders;
    } catch (error) {
      mine.state = "not_sent";
      mine.error = error.message;
      await new Promise((resolve) => setTimeout(resolve, RETRY_MS));
    }
  }
}

function show(list) {
  const lines = [];
  const records = all("stop").map((one) => one.value).sort((a, b) => a.robot.localeCompare(b.robot));
  const given = press && records.some((record) => record.id === press.id); // robots may brake before the answer comes
  if (press && press.state !== "answered" && !given) {
    const seconds_ = seconds(performance.now() - press.began);
    lines.push([press.state === "sending" ? "wait" : "bad", t(`stop_${press.state}`, { time: clock(press.at), age: seconds_ })]);
  }
  for (const record of records) lines.push(lineOf(record));
  while (list.children.length > lines.length) list.lastChild.remove();
  while (list.children.length < lines.length) list.append(h("li"));
  lines.forEach(([kind, text], index) => {
    list.children[index].className = kind;
    say(list.children[index], text);
  });
}

export function lineOf(record) {
  const parts = [t("sent_at", { time: clock(record.sent_at * 1000) })];
  let kind = "wait";
  const bad = record.outcome === "unknown" || record.outcome === "not_sent";
  if (record.heard_at) {
    const took = seconds((record.heard_at - record.sent_at) * 1000, 2);
    parts.push(t("heard_at", { time: clock(record.heard_at * 1000), took }));
    if (record.outcome === "refused") parts.push(t("refused_because", { reason: record.message }));
  } else parts.push(t(bad ? `heard_${record.outcome}` : "heard_waiting"));
  if (bad) {
    kind = "bad";
    if (record.repeated) parts.push(t("sent_again"));
    if (record.message) parts.push(record.message);
  }
  if (record.standing_at) {
    kind = "good";
    parts.push(t("standing_at", { time: clock(record.standing_at * 1000) }));
  } else parts.push(standing(record));
  return [kind, `${record.robot}: ${parts.join(" · ")}`];
}

function standing(record) {
  const pose = told("pose", record.robot);
  if (!pose || age(pose.at) > 2000) return t("standing_unknown");
  return t("standing_not_yet", { speed: pose.value.speed.toFixed(2) });
}
