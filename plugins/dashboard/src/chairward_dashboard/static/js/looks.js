// How the page looks and sounds: kept in this browser only.

import { LANGUAGES, speak } from "./texts.js";

const KEY = "chairward.looks";
const dark = matchMedia("(prefers-color-scheme: dark)");
const contrast = matchMedia("(prefers-contrast: more)");

export const looks = { language: "", theme: "auto", large: false, colour: false, sound: false, speak: false, scan: "0", ...read() };
Object.defineProperty(looks, "set", { value: (wanted) => { Object.assign(looks, wanted); keep(); } });

function read() {
  try {
    return JSON.parse(localStorage.getItem(KEY) ?? "{}");
  } catch {
    return {}; // damaged or forbidden: the defaults are right
  }
}

function keep() {
  localStorage.setItem(KEY, JSON.stringify(looks));
}

export function dress() {
  const theme = looks.theme !== "auto" ? looks.theme : contrast.matches ? "contrast" : dark.matches ? "dark" : "light";
  document.documentElement.dataset.theme = theme;
  document.documentElement.toggleAttribute("data-large", looks.large);
}

/** Wire up the choices; onChange() after each. */
export function choices(onChange) {
  const language = document.getElementById("language");
  language.replaceChildren(...Object.entries(LANGUAGES).map(([code, name]) => {
    const option = new Option(name, code);
    option.lang = code;
    return option;
  }));
  const elements = ["language", "theme", "scan", "large", "colour", "sound", "speak"].map((id) => document.getElementById(id));
  for (const element of elements) {
    const isBox = element.type === "checkbox";
    if (isBox) element.checked = looks[element.id];
    else if (looks[element.id]) element.value = looks[element.id];
    element.addEventListener("change", async () => {
      looks.set({ [element.id]: isBox ? element.checked : element.value });
      dress();
      if (element.id === "language") await speak(looks.language);
      onChange();
    });
  }
  dark.addEventListener("change", dress);
  contrast.addEventListener("change", dress);
}
