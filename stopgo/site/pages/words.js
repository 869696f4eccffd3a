// Words of the page in the language of its reader: one catalogue, and numbers as the language writes them.
import { MESSAGES } from "./messages.js";

const stored = localStorage.getItem("stopgo-language");
const wished = (stored || navigator.language || "en").slice(0, 2);
export const language = wished in MESSAGES ? wished : "en";
document.documentElement.lang = language;

export function t(key, values = {}) {
  const text = MESSAGES[language][key] ?? MESSAGES.en[key] ?? key;
  return text.replace(/\{(\w+)\}/g, (whole, name) => String(values[name] ?? whole));
}

export function has(key) {
  return key in MESSAGES.en;
}

export function otherLanguage() {
  return language === "en" ? "de" : "en";
}

export function chooseLanguage(name) {
  localStorage.setItem("stopgo-language", name);
  location.reload();
}

export function number(value, digits = 0) {
  return value.toLocaleString(language, { minimumFractionDigits: digits, maximumFractionDigits: digits });
}

export function percent(share, digits = 1) {
  return share === null || share === undefined ? t("unknown") : `${number(100 * share, digits)} %`;
}

export function seconds(ms, digits = 1) {
  return `${number(ms / 1000, digits)} s`;
}

export function duration(s) {
  const whole = Math.round(s);
  const [hours, minutes, rest] = [Math.floor(whole / 3600), Math.floor(whole / 60) % 60, whole % 60];
  const two = (part) => String(part).padStart(2, "0");
  return hours ? `${hours}:${two(minutes)}:${two(rest)}` : `${minutes}:${two(rest)}`;
}

export function agoText(ms) {
  if (ms < 60000) return t("age_seconds", { age: number(ms / 1000, 1) });
  return t("age_minutes", { age: duration(ms / 1000) });
}

export function clock(ms) {
  const at = new Date(ms);
  const two = (part, length = 2) => String(part).padStart(length, "0");
  return `${two(at.getHours())}:${two(at.getMinutes())}:${two(at.getSeconds())}.${two(at.getMilliseconds(), 3)}`;
}
