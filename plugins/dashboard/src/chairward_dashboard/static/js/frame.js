// What every page has: the way to the others; and on set-up pages what the chair does now, with a Stop.

import { $, make, put } from "./dom.js";
import { connect, stopButton, stopKeys } from "./link.js";
import { dress, looks } from "./looks.js";
import { walk } from "./scan.js";
import { NOTHING, shape } from "./sign.js";
import { amount, LANGUAGES, speak, text } from "./texts.js";

export const PAGES = { drive: "/", live: "/live", words: "/words", person: "/person", plugins: "/plugins", stops: "/stops", calibrate: "/calibrate" };

export function navigation(here) {
  const links = Object.entries(PAGES).map(([name, path]) => make("a", { href: path, "data-text": `${name}.title`, "aria-current": name === here ? "page" : null }));
  return make("nav", { "data-label": "nav" }, ...links);
}

/** Dress, translate and connect a set-up page; onState(state) with each state, onLanguage() when its words change. */
export async function frame({ onState = () => {}, onLanguage = () => {} } = {}) {
  const here = document.body.dataset.page;
  const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg");
  svg.setAttribute("viewBox", "0 0 100 100");
  svg.setAttribute("aria-hidden", "true");
  svg.append(document.createElementNS("http://www.w3.org/2000/svg", "path"));
  const words = make("span", { id: "instruction", "aria-live": "assertive" });
  const mm = make("span", { id: "mm" });
  const sign = make("p", { id: "strip-sign", class: "stop" }, svg, words, mm);
  const stop = make("button", { id: "stop", type: "button" }, make("span", { "data-text": "stop" }));
  const language = make("select", { id: "language" }, ...Object.entries(LANGUAGES).map(([code, name]) => make("option", { value: code, lang: code }, name)));
  const label = make("label", { class: "language" }, make("span", { class: "said", "data-text": "language" }), language);
  $("top").append(make("div", { class: "bar-of-pages" }, navigation(here), label), make("div", { class: "strip" }, sign, stop));

  let state = NOTHING;
  const draw = () => {
    sign.className = state.colour;
    shape(svg, state.shape);
    put(words, text(`instruction.${state.instruction}`));
    put(mm, state.nearest_mm == null ? "" : amount(state.nearest_mm, "mm"));
    const resting = $("resting");
    if (resting) resting.hidden = !state.armed;
  };
  const change = async (code) => {
    await speak(code);
    language.value = document.documentElement.lang;
    draw();
    onLanguage();
  };
  dress();
  await speak(looks.language || "en");
  language.value = document.documentElement.lang;
  let greeted = Boolean(looks.language);
  const link = connect({
    panes: [],
    onBundle: async ({ state: newest }) => {
      state = newest;
      if (!greeted && newest.language) {
        greeted = true;
        if (newest.language !== document.documentElement.lang) await change(newest.language);
      }
      draw();
      onState(newest);
    },
    onLost: () => {
      state = NOTHING;
      draw();
      onState(NOTHING);
    },
  });
  language.addEventListener("change", () => {
    looks.set({ language: language.value });
    change(language.value);
  });
  stopKeys(link.push);
  stopButton(stop, link.push);
  walk("#stop, nav a, main :is(button, input, select, summary)");
  draw();
  return link;
}

/** Do it, and show what went wrong; the first time, until when the page is loading. */
export async function attempt(work) {
  trouble(null);
  try {
    await work();
  } catch (error) {
    trouble(error);
  }
  $("loading").hidden = true;
}

/** Show what went wrong, or nothing. */
export function trouble(error) {
  const place = $("trouble");
  place.hidden = !error;
  put(place, error ? error.message : "");
  if (error) place.scrollIntoView({ block: "nearest" });
}
