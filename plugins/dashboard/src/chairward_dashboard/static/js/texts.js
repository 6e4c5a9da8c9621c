// Words of the page from plain message files, one a language; anyone can add one (and its line in LANGUAGES).

export const LANGUAGES = { en: "English", de: "Deutsch", fr: "Français", hi: "हिन्दी", ar: "العربية" };
const RIGHT_TO_LEFT = new Set(["ar"]);

let words = {};
export let language = "en";

/** Load a language (English for one that is not there) and write it into the page. */
export async function speak(wanted) {
  language = wanted in LANGUAGES ? wanted : "en";
  const answer = await fetch(`/static/messages/${language}.json`);
  words = await answer.json();
  document.documentElement.lang = language;
  document.documentElement.dir = RIGHT_TO_LEFT.has(language) ? "rtl" : "ltr";
  document.title = `${words[`${document.body.dataset.page ?? "drive"}.title`] ?? words.title} – Chairward`;
  for (const element of document.querySelectorAll("[data-text]")) element.textContent = text(element.dataset.text);
  for (const element of document.querySelectorAll("[data-label]")) element.setAttribute("aria-label", text(element.dataset.label));
}

/** The words of a key; {name} in them is replaced. A key without words shows itself. */
export function text(key, values = {}) {
  return (words[key] ?? key).replace(/\{(\w+)\}/g, (all, name) => values[name] ?? all);
}

export const has = (key) => key in words;
export const number = (value) => new Intl.NumberFormat(language).format(value);

/** A number with its unit, kept together and in order inside words of any direction. */
export const amount = (value, unit) => `\u2066${number(value)} ${unit}\u2069`;

/** A sentence of the chair in the language of the page, as far as its parts are known: numbers stand for themselves. */
export function told(sentence) {
  const whole = known(sentence);
  return whole ?? sentence.split(": ").map((part) => known(part) ?? part).join(": ");
}

function known(sentence) {
  for (const part of [sentence, sentence.replace(/ \(.*\)$/, "")]) {
    const found = words[`said.${part.replace(/\d+/g, "#")}`];
    const numbers = part.match(/\d+/g) ?? [];
    if (found) return found.replace(/#( m[ms])?/g, (unit) => `\u2066${unit.replace("#", numbers.shift())}\u2069`);
  }
  return null;
}
