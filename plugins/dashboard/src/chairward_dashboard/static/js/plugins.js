// The plugins page: what is installed, what this chair uses of it and how that is now, and all settings.

import { get, post } from "./api.js";
import { $, list, make, put } from "./dom.js";
import { attempt, frame } from "./frame.js";
import { amount, number, text, told } from "./texts.js";

const KINDS = ["source", "sensor", "recognizer", "drive", "observer", "companion"];
const MARKS = { well: "✓", ill: "!", silent: "✕" };

let data = { components: [], refused: [], choices: [] };

function draw() {
  const used = data.components.filter((row) => row.used.length);
  put($("counts"), text("plugins.counts", { used: number(used.length), all: number(data.components.length) }));
  list($("refused"), data.refused.map(({ plugin, reason }) => text("plugins.refused", { plugin, reason })));
  $("plugins").replaceChildren(...KINDS.map((kind) => {
    const rows = data.components.filter((row) => row.kind === kind).sort((a, b) => b.used.length - a.used.length);
    return rows.length ? make("section", {}, make("h2", {}, text(`plugins.${kind}`)), ...rows.map(component)) : null;
  }).filter(Boolean));
}

function component(row) {
  const places = row.used.map(({ where }) => make("span", { class: "state", "data-where": where }, where));
  return make("details", { class: row.used.length ? "component" : "component unused" },
    make("summary", {}, make("strong", {}, row.name), make("span", { class: "quiet" }, row.summary), make("span", { class: "row tight" }, ...(places.length ? places : [make("span", { class: "quiet" }, text("plugins.unused"))]))),
    make("p", { class: "quiet" }, text("plugins.from", { plugin: row.plugin })),
    settings(row));
}

function settings(row) {
  const properties = Object.entries(row.settings.properties ?? {});
  if (!properties.length) return make("p", {}, text("plugins.nothing"));
  const inForce = row.used[0]?.settings ?? {};
  const heads = ["plugins.setting", "plugins.value", "plugins.default", "plugins.allowed"].map((key) => make("th", { scope: "col" }, text(key)));
  return make("div", { class: "scroll", tabindex: "0", role: "region", "aria-label": row.name }, make("table", {}, make("thead", {}, make("tr", {}, ...heads)), make("tbody", {}, ...properties.map(([key, schema]) => {
    const choice = data.choices.find((one) => one.component === row.name && one.key === key);
    const value = key in inForce ? inForce[key] : schema.default;
    return make("tr", {},
      make("th", { scope: "row" }, make("code", {}, key), make("small", {}, schema.description ?? "")),
      make("td", {}, choice && row.used.length ? editor(row.name, key, schema, choice) : make("span", { class: key in inForce ? "own" : "quiet" }, shown(value))),
      make("td", { class: "quiet" }, shown(schema.default)),
      make("td", { class: "quiet" }, allowed(schema)));
  }))));
}

const shown = (value) => (value === null || value === undefined || value === "" ? "–" : typeof value === "object" ? JSON.stringify(value) : String(value));

function allowed(schema) {
  const kinds = schema.anyOf ?? [schema];
  return kinds.filter((one) => one.type !== "null").map((one) => {
    if (one.enum) return one.enum.join(", ");
    if (one.const !== undefined) return String(one.const);
    const [least, most] = [one.minimum ?? one.exclusiveMinimum, one.maximum ?? one.exclusiveMaximum];
    if (least !== undefined || most !== undefined) return `${least ?? "…"} – ${most ?? "…"}`;
    return text(`plugins.type.${one.type ?? "any"}`);
  }).join(" / ");
}

/** A setting that the chair leaves to the person: written to the person's profile, in force from the next start on. */
function editor(component, key, schema, choice) {
  const numeric = schema.type === "number" || schema.type === "integer";
  const { min, max } = typeof choice.choice === "object" ? choice.choice : {};
  const input = Array.isArray(choice.choice)
    ? make("select", {}, ...["", ...choice.choice].map((value) => make("option", { value: String(value), selected: value === (choice.own ?? "") }, value === "" ? "–" : String(value))))
    : make("input", { type: numeric ? "number" : "text", step: "any", min, max, value: choice.own ?? "", placeholder: shown(schema.default) });
  input.setAttribute("aria-label", `${component}.${key}`);
  const said = make("small", { role: "status" });
  const button = make("button", { type: "button", class: "small", onclick: async () => {
    try {
      await post("/api/set", { person: data.person, changes: [`settings.${component}.${key}=${input.value}`], keep: true });
      put(said, `✓ ${text("person.kept")}`);
      said.className = "good";
    } catch (error) {
      put(said, `⚠ ${error.message}`);
      said.className = "problem";
    }
  } }, text("person.keep"));
  return make("span", {}, make("span", { class: "row tight" }, input, button), said);
}

function health({ sources = [] }) {
  for (const place of document.querySelectorAll("[data-where]")) {
    const source = sources.find(({ name }) => name === place.dataset.where);
    if (!source) continue;
    const words = [`${MARKS[source.state]} ${place.dataset.where}: ${text(`health.${source.state}`)}`, source.reason ? told(source.reason) : "", source.age_ms == null ? "" : amount(source.age_ms, "ms")].filter(Boolean);
    put(place, words.join(", "));
    place.className = `state ${source.state}`;
  }
}

await frame({ onState: health, onLanguage: draw });
await attempt(async () => {
  data = await get("/api/plugins");
  draw();
});
