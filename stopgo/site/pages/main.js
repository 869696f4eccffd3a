// The page from top to bottom: sign in, the STOP bar, and three views that share one link to the server.
import { isSignedIn, read, send, signIn } from "./api.js";
import { fill, h, say } from "./dom.js";
import { makeBack } from "./back.js";
import { makeLive } from "./live.js";
import { makePlan } from "./plan.js";
import { makeStopBar } from "./stop.js";
import { listen, silentMs, watchLink } from "./store.js";
import { chooseLanguage, otherLanguage, seconds, t } from "./words.js";

const SILENT_MS = 2500;
const main = document.getElementById("main");
const head = document.getElementById("head");
const offline = document.getElementById("offline");
const VIEWS = { live: makeLive, plan: makePlan, back: makeBack };
let leave = () => {};

async function begin() {
  const token = new URLSearchParams(location.hash.slice(1)).get("token");
  if (token) {
    history.replaceState(null, "", "/");
    if (!(await signIn(token))) return showSignIn(t("token_used"));
  }
  const me = isSignedIn() ? await read("/api/me").catch(() => null) : null;
  if (me) showPage(me);
  else showSignIn(t("sign_in"));
}

function showSignIn(text) {
  fill(document.getElementById("stopbar"));
  fill(head, h("h1", {}, "stopgo"));
  fill(main, h("p", { class: "notice", role: "alert" }, text));
}

function showPage(me) {
  const refused = () => showSignIn(t("sign_in"));
  makeStopBar(document.getElementById("stopbar"), me);
  const tabs = Object.keys(VIEWS).map((name) =>
    h("a", { href: `#${name}`, id: `tab-${name}`, role: "tab" }, t(`tab_${name}`)));
  const other = otherLanguage();
  fill(head,
    h("h1", {}, me.folder),
    h("nav", { role: "tablist", "aria-label": t("views") }, tabs),
    h("div", { class: "tools" },
      me.role === "operator" && h("button", { type: "button", class: "plain", onclick: () => invite() }, t("invite")),
      h("button", { type: "button", class: "plain", lang: other, onclick: () => chooseLanguage(other) }, t("other_language")),
      h("span", { class: "who", title: t("commander") }, me.role === "operator" ? me.commander : t("role_viewer"))),
    h("div", { id: "invitation" }));
  listen(refused);
  watchLink(refused);
  setInterval(showLink, 250);
  addEventListener("hashchange", () => showView(me));
  showView(me);
}

function showView(me) {
  const name = location.hash.slice(1).split("/")[0] in VIEWS ? location.hash.slice(1).split("/")[0] : "live";
  leave();
  for (const tab of head.querySelectorAll("[role=tab]")) {
    tab.setAttribute("aria-selected", String(tab.id === `tab-${name}`));
  }
  leave = VIEWS[name](main, me) ?? (() => {});
}

function showLink() {
  const silent = silentMs();
  offline.hidden = silent < SILENT_MS;
  document.body.classList.toggle("offline", !offline.hidden);
  if (!offline.hidden) say(offline, t("no_server", { age: seconds(silent, 0) }));
}

async function invite() {
  const place = document.getElementById("invitation");
  if (place.firstChild) return fill(place);
  const ask = (role) => async () => {
    const { address } = await send("/api/invitations", { role });
    fill(place, h("p", {}, t(`invited_${role}`)), h("output", { class: "address" }, address));
  };
  fill(place,
    h("button", { type: "button", onclick: ask("operator") }, t("invite_operator")),
    h("button", { type: "button", onclick: ask("viewer") }, t("invite_viewer")));
}

begin();
