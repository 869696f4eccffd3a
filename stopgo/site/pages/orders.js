// Orders to one robot: none is ever disabled, for the page may be wrong; those that fit the state stand out.
import { failureText, orderId, read, send } from "./api.js";
import { fill, h, say } from "./dom.js";
import { get } from "./store.js";
import { lineOf } from "./stop.js";
import { clock, duration, seconds, t } from "./words.js";

const FITTING = {
  READY: ["start"], FINISHED: ["start"], ABORTED: ["start"], RUNNING: ["pause"], HOMING: ["pause"],
  PAUSED: ["resume"], HELD: ["retry", "skip"],
};
const VERBS = ["start", "pause", "resume", "skip", "retry", "home", "abort"];
const ASK_FIRST = ["skip", "home", "abort"];
const CONFIRM_MS = 5000;

export function makeOrders(name, me) {
  const result = h("p", { class: "result", role: "status" });
  const question = h("div", { class: "question" });
  const buttons = VERBS.map((verb) => h("button", { type: "button", "data-verb": verb, onclick: (event) => pressed(name, verb, event.currentTarget, question) }, t(`verb_${verb}`)));
  const push = h("button", { type: "button", onclick: () => offerMissions(name, question) }, t("push"));
  const cannot = h("p", { class: "cannot" });
  const element = h("div", { class: "orders" }, h("div", { class: "buttons" }, buttons, push), cannot, question, result);
  return element;
}

export function showOrders(element, name, state, holder) {
  const fitting = FITTING[state.state] ?? [];
  for (const button of element.querySelectorAll("[data-verb]")) {
    button.classList.toggle("primary", fitting.includes(button.dataset.verb));
    button.hidden = Boolean(state.vehicle?.cannot.includes(button.dataset.verb));
  }
  const cannot = (state.vehicle?.cannot ?? []).map((verb) => t("cannot", { verb: t(`verb_${verb}`), reason: t(`cannot_${verb}`) }));
  say(element.querySelector(".cannot"), cannot.join(" "));
  const record = get("order", name);
  if (record) say(element.querySelector(".result"), resultText(record));
}

export function resultText(record) {
  const verb = record.verb === "push" ? t("push") : t(`verb_${record.verb}`);
  if (record.outcome === "sent") return t("order_sent", { verb, time: clock(record.sent_at * 1000) });
  if (record.outcome === "ok") {
    return t("order_ok", { verb, took: seconds((record.heard_at - record.sent_at) * 1000, 2), note: record.message });
  }
  return t(`order_${record.outcome}`, { verb, reason: record.message });
}

function pressed(name, verb, button, question) {
  const seen = get("robot", name) ?? {};
  const again = verb === "start" && ["FINISHED", "ABORTED"].includes(seen.state);
  const order = { verb, again, ...meant(verb, seen) };
  if (ASK_FIRST.includes(verb) || again) {
    ask(question, t(`confirm_${verb}`, { robot: name, stop: seen.stop ?? "" }), t(`verb_${verb}`), () => give(name, order, question));
  } else give(name, order, question);
}

// What an order is for, as the page shows it: the robot refuses it if another page has changed that meanwhile.
function meant(verb, { mission_id, revision, run_id, stop }) {
  return verb === "start" ? { mission_id, revision } : { run_id, stop };
}

function ask(question, text, yes, work) {
  const done = () => fill(question);
  fill(question, h("p", {}, text),
    h("button", { type: "button", class: "primary", onclick: () => { done(); work(); } }, yes),
    h("button", { type: "button", onclick: done }, t("cancel")));
  question.querySelector("button").focus();
}

async function give(name, order, question) {
  const path = `/api/robots/${encodeURIComponent(name)}/orders`;
  await sent(name, question, (more) => send(path, { id: orderId(), ...order, ...more }));
}

// Refusals that another word of the operator lifts: question, answer, and what is sent then.
const TAKE_OVER = ["take_over_question", "take_over", { take_over: true }];
const REMEDIES = {
  not_the_commander: TAKE_OVER, fenced: TAKE_OVER, finished_before: ["confirm_start", "verb_start", { again: true }],
  not_at_start: ["from_here_question", "from_here", { from_here: true }],
};

async function sent(name, question, work, more = {}) {
  try {
    const { orders: [record] } = await work(more);
    const remedy = record.outcome === "refused" && REMEDIES[record.reason];
    if (!remedy) return;
    const [text, yes, fields] = remedy;
    const who = get("robot", name)?.lease?.holder ?? "?";
    ask(question, t(text, { who, robot: name }), t(yes), () => sent(name, question, work, { ...more, ...fields }));
  } catch (error) {
    fault(question, error);
  }
}

function fault(question, error) {
  fill(question, h("p", { class: "bad", role: "alert" }, failureText(error)));
}

async function offerMissions(name, question) {
  if (question.firstChild) return fill(question);
  const { missions, left, error } = await read("/api/folder").catch((error) => ({ error }));
  if (error) return fill(question, h("p", { class: "bad", role: "alert" }, error.message));
  if (!missions.length) return fill(question, h("p", {}, t("no_missions")));
  const list = h("select", { "aria-label": t("mission_to_push") }, missions.map((one) =>
    h("option", { value: one.file }, t("mission_choice", { ...one, time: duration(one.total_s) }))));
  const difference = h("p", { class: "difference" });
  // What is pushed is what was shown: the server refuses it if the file or the robot's mission has changed meanwhile.
  const show = async () => {
    const file = list.value;
    const found = await read(`/api/robots/${encodeURIComponent(name)}/difference?file=${encodeURIComponent(file)}`).catch((error) => ({ error: error.message }));
    if (file === list.value) say(difference, found.error ?? differenceText(found));
    return { file, digest: found.new?.digest, held: found.known ? found.held?.digest ?? "" : undefined };
  };
  let shown = null;
  list.addEventListener("change", () => { shown = show(); });
  fill(question, list, left ? h("p", {}, t("missions_left", { n: left, listed: missions.length })) : "", difference,
    h("button", { type: "button", class: "primary", onclick: async () => push(name, await shown, question) }, t("push_to", { robot: name })),
    h("button", { type: "button", onclick: () => fill(question) }, t("cancel")));
  shown = show();
  await shown;
}

export function differenceText(found) {
  if (!found.known) return t("difference_unknown", { stops: found.new.stops });
  if (!found.held) return t("difference_none", { stops: found.new.stops });
  if (found.same) return t("difference_same");
  const change = t("difference_stops", { added: found.added.length, removed: found.removed.length, kept: found.kept });
  const time = t("difference_time", { before: duration(found.held.total_s), after: duration(found.new.total_s) });
  const what = found.same_mission
    ? t("difference_revision", { before: found.held.revision, after: found.new.revision })
    : t("difference_other", { before: found.held.name, after: found.new.name });
  return `${what} ${change} ${time}`;
}

function push(name, mission, question) {
  const path = `/api/robots/${encodeURIComponent(name)}/push`;
  fill(question);
  return sent(name, question, (more) => send(path, { id: orderId(), ...mission, ...more }));
}

export { lineOf };
