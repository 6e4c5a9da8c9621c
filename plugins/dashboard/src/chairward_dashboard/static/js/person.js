// The person page: who drives next, and that person's limits, within what the chair allows.

import { get, post } from "./api.js";
import { $, disable, isOff, make, put, twice } from "./dom.js";
import { attempt, frame } from "./frame.js";
import { has, number, text } from "./texts.js";

const SOON_MS = 500;
const UNITS = { mm_s2: "mm/s²", deg_s2: "°/s²", mm_s: "mm/s", deg_s: "°/s", mm: "mm", deg: "°", ms: "ms", s: "s" };

let people = { people: [], drives: "" };
let own = { limits: [], choices: [] };
let who = "";
let timer = 0;
let check = 0;

async function show(name) {
  who = name;
  const row = people.people.find((person) => person.name === name);
  own = row?.why ? { limits: [], choices: [], proof: "" } : await get(`/api/limits?${new URLSearchParams({ person: name })}`);
  draw();
}

function draw() {
  $("people").replaceChildren(...people.people.map((person) => make("label", { class: person.why ? "card bad" : "card" },
    make("input", { type: "radio", name: "who", value: person.name, checked: person.name === who, onchange: () => attempt(() => show(person.name)) }),
    make("strong", {}, person.name, person.name === people.drives ? ` – ${text("person.drives")}` : ""),
    make("span", {}, person.about),
    make("small", { class: person.why ? "problem" : "quiet" }, person.why ? `⚠ ${person.why}` : person.proof))));
  put($("choose"), text(who === people.drives ? "person.again" : "person.choose", { name: who }));
  disable($("choose"), !who || people.people.find(({ name }) => name === who)?.why);
  put($("limits-title"), text("person.limits", { name: who }));
  put($("proof"), own.proof ?? "");
  $("proof").className = "proof";
  disable($("keep"), true);
  $("fields").replaceChildren(...own.limits.map(limit), ...own.choices.map(choice));
  $("limits-section").hidden = !own.limits.length;
}

function unit(key) {
  const found = Object.keys(UNITS).find((end) => key.endsWith(`_${end}`));
  return found ? UNITS[found] : "";
}

const shown = (value) => (typeof value === "number" ? number(value) : Array.isArray(value) ? value.map((one) => text(`command.${one}`)).join(", ") : String(value));

function limit(row) {
  const name = `limits.${row.key}`;
  const words = has(`limit.${row.key}`) ? text(`limit.${row.key}`) : row.description;
  const allowed = row.safer === "free" ? "" : text(`person.${row.safer}`, { value: `${shown(row.chair)} ${unit(row.key)}`.trim() });
  if (row.safer === "subset") {
    const boxes = row.chair.map((value) => make("label", { class: "inline" },
      make("input", { type: "checkbox", value, checked: (row.own ?? row.chair).includes(value), "data-set": name }), ` ${text(`command.${value}`)}`));
    return make("fieldset", { class: "field", "data-name": name }, make("legend", {}, words), make("div", { class: "row tight" }, ...boxes), make("small", { class: "quiet" }, allowed));
  }
  const [least, most] = [row.safer === "higher" ? row.chair : row.least, row.safer === "lower" ? row.chair : row.most];
  return field(name, words, unit(row.key), allowed, { type: "number", value: row.own ?? "", placeholder: row.chair, min: least, max: most, step: row.whole ? 1 : "any" });
}

function choice(row) {
  const name = `settings.${row.component}.${row.key}`;
  const words = row.schema.description ?? row.key;
  const usual = row.chair ?? row.schema.default ?? "";
  if (Array.isArray(row.choice)) {
    const options = ["", ...row.choice].map((value) => make("option", { value: String(value), selected: value === (row.own ?? "") }, value === "" ? text("person.as.chair", { value: String(usual) }) : String(value)));
    return make("label", { class: "field" }, make("span", {}, `${row.component}: ${words}`), make("select", { "data-name": name }, ...options));
  }
  const numeric = row.schema.type === "number" || row.schema.type === "integer";
  const { min, max } = typeof row.choice === "object" ? row.choice : {};
  const allowed = min == null ? "" : text("person.between", { min: number(min), max: number(max) });
  return field(name, `${row.component}: ${words}`, "", allowed, { type: numeric ? "number" : "text", value: row.own ?? "", placeholder: usual, min, max, step: "any" });
}

function field(name, words, unitName, allowed, attributes) {
  return make("label", { class: "field" }, make("span", {}, words), make("span", { class: "row tight" }, make("input", { ...attributes, "data-name": name }), unitName), make("small", { class: "quiet" }, allowed));
}

/** What differs from the file, as `chairward profile set` takes it. */
function changes() {
  const found = [];
  const was = Object.fromEntries([...own.limits.map((row) => [`limits.${row.key}`, row.own]), ...own.choices.map((row) => [`settings.${row.component}.${row.key}`, row.own])]);
  for (const input of $("fields").querySelectorAll("input[data-name], select[data-name]")) {
    const name = input.dataset.name;
    const before = was[name] == null ? "" : String(was[name]);
    if (input.value !== before) found.push(`${name}=${input.value}`);
  }
  for (const group of $("fields").querySelectorAll("fieldset[data-name]")) {
    const name = group.dataset.name;
    const row = own.limits.find(({ key }) => `limits.${key}` === name);
    const now = [...group.querySelectorAll("input:checked")].map((box) => box.value).sort();
    if (now.join() !== [...(row.own ?? row.chair)].sort().join()) found.push(`${name}=${JSON.stringify(now)}`);
  }
  return found;
}

async function save(keep) {
  const wanted = changes();
  if (!wanted.length) {
    put($("proof"), own.proof);
    $("proof").className = "proof";
    return;
  }
  const nth = ++check;
  try {
    const told = await post("/api/set", { person: who, changes: wanted, keep });
    if (nth !== check) return;
    put($("proof"), `✓ ${Object.entries(told.proof).map(([chair, proof]) => `${chair}: ${proof}`).join(" · ")}`);
    $("proof").className = "proof good";
    disable($("keep"), keep);
    if (keep) {
      people = await get("/api/people");
      await show(who);
      put($("proof"), text("person.kept"));
    }
  } catch (error) {
    if (nth !== check) return;
    put($("proof"), `⚠ ${error.message}`);
    $("proof").className = "proof problem";
    disable($("keep"), true);
  }
}

/** Ask for another run, and wait until the chair is back with it. */
async function choose(name) {
  if (isOff($("choose")) && name) return;
  await post("/api/choose", { person: name });
  put($("chosen"), text(name ? "person.starting" : "person.ended"));
  disable($("choose"), true);
  disable($("end"), true);
  if (!name) return;
  const end = performance.now() + 120000;
  await new Promise((done) => setTimeout(done, 2000));
  while (performance.now() < end) {
    await new Promise((done) => setTimeout(done, 1000));
    try {
      if ((await get("/api/people")).drives === name) {
        location.reload();
        return;
      }
    } catch {
      // not there yet: ask again
    }
  }
  throw new Error(text("person.not.back"));
}

await frame({ onLanguage: draw });
twice($("end"), () => text("person.end.sure"), () => attempt(() => choose("")));
$("choose").addEventListener("click", () => attempt(() => choose(who)));
$("limits").addEventListener("input", () => {
  clearTimeout(timer);
  disable($("keep"), true);
  timer = setTimeout(() => attempt(() => save(false)), SOON_MS);
});
$("limits").addEventListener("submit", (event) => {
  event.preventDefault();
  if (!isOff($("keep"))) attempt(() => save(true));
});
$("back").addEventListener("click", () => attempt(() => show(who)));
await attempt(async () => {
  people = await get("/api/people");
  await show(people.drives);
});
