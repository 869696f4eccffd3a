// Requests to the server. What changes something carries the page's key, which cookies do not hold.
import { t } from "./words.js";

const KEY = "stopgo-key";

export function isSignedIn() {
  return Boolean(localStorage.getItem(KEY));
}

export async function signIn(token) {
  const answer = await fetch("/api/session", {
    method: "POST",
    headers: { "Content-Type": "application/json" },
    body: JSON.stringify({ token }),
  });
  const body = await answer.json();
  if (answer.ok) localStorage.setItem(KEY, body.key);
  return answer.ok;
}

export async function read(path) {
  return parsed(await fetch(path));
}

export async function send(path, body, signal) {
  const answer = await fetch(path, {
    method: "POST",
    headers: { "Content-Type": "application/json", "X-Stopgo-Key": localStorage.getItem(KEY) ?? "" },
    body: JSON.stringify(body),
    signal,
  }).catch((error) => { throw Object.assign(error, { isUnanswered: true }); });
  return parsed(answer);
}

// What became of a request that has failed: one without an answer may have been carried out.
export function failureText(error) {
  return t(error.isUnanswered ? "no_answer" : "not_sent", { reason: error.message });
}

async function parsed(answer) {
  const body = await answer.json().catch(() => null);
  if (!answer.ok) throw new Error(body?.error || `${answer.status}`);
  if (!body) throw Object.assign(new Error("the answer was cut off"), { isUnanswered: true });
  return body;
}

export function orderId() {
  return [...crypto.getRandomValues(new Uint8Array(12))].map((byte) => byte.toString(16).padStart(2, "0")).join("");
}
