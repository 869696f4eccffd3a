// What the server tells, by key, with the time at which it was true; and the page's own link to the server.
const values = new Map();
const listeners = new Set();
let last = "";
let source = null;
let heard = stamp(0);
let again = 0;

function stamp(age) {
  return { wall: Date.now() - age, page: performance.now() - age };
}

// Milliseconds since a stamp. One clock stands still while the machine sleeps, the other may be set.
export function age(at) {
  return Math.max(0, Date.now() - at.wall, performance.now() - at.page);
}

export function get(...key) {
  return values.get(key.join("\n"))?.value;
}

export function told(...key) {
  return values.get(key.join("\n"));
}

export function all(kind, name) {
  const found = [];
  for (const one of values.values()) {
    if (one.key[0] === kind && (name === undefined || one.key[1] === name)) found.push(one);
  }
  return found;
}

export function onChange(listener) {
  listeners.add(listener);
  return () => listeners.delete(listener);
}

export function silentMs() {
  return age(heard);
}

export function take(message) {
  heard = stamp(0);
  if (message.fresh) values.clear();
  const kinds = new Set(message.fresh ? ["*"] : []);
  for (const item of message.items) {
    const [kind, name] = item.key;
    if (kind === "run") dropOtherRuns(name, item.value.run);
    if (kind === "path" && get("path", name, "0")?.spacing !== item.value.spacing) drop("path", name);
    values.set(item.key.join("\n"), { key: item.key, value: item.value, at: stamp(item.age_ms) });
    kinds.add(kind);
  }
  if (kinds.size) for (const listener of listeners) listener(kinds);
}

function drop(kind, name, keep = () => false) {
  for (const [key, one] of values) {
    if (one.key[0] === kind && one.key[1] === name && !keep(one.value)) values.delete(key);
  }
}

function dropOtherRuns(name, run) {
  drop("event", name, (value) => value.run_id === run);
  drop("path", name, (value) => value.run === run);
}

export function listen(onRefused) {
  if (source) source.close();
  source = new EventSource(`/api/events?last=${encodeURIComponent(last)}`);
  source.onmessage = (event) => {
    last = event.lastEventId;
    again = 0;
    take(JSON.parse(event.data));
  };
  source.onerror = () => {
    source.close();
    again = Math.min(3000, 300 + 2 * again);
    setTimeout(() => reopen(onRefused), again);
  };
}

async function reopen(onRefused) {
  const answer = await fetch("/api/me").catch(() => null);
  if (answer && answer.status === 401) onRefused();
  listen(onRefused);
}

// A stream that is open and silent is dead: the server sends something every second.
export function watchLink(onRefused) {
  setInterval(() => {
    if (silentMs() > 6000 && source && source.readyState === EventSource.OPEN) {
      heard = { wall: heard.wall, page: heard.page };
      source.close();
      reopen(onRefused);
    }
  }, 2000);
  document.addEventListener("visibilitychange", () => {
    if (!document.hidden && silentMs() > 2500) reopen(onRefused);
  });
}
