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
  document.title = words.title;
  for (const element of document.querySelectorAll("[data-text]")) element.textContent = text(element.dataset.text);
  for (const element of document.querySelectorAll("[data-label]")) element.setAttribute("aria-label", text(element.dataset.label));
}

/** The words of a key; {name} in them is replaced. A key without words shows itself. */
export function text(key, values = {}) {
  return (words[key] ?? key).replace(/\{(\w+)\}/g, (all, name) => values[name] ?? all);
}

export const has = (key) => key in words;
export const number = (value) => new Intl.NumberFormat(language).format(value);
