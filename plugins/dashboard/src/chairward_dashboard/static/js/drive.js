// Writes a state into the drive page. Texts only ever through textContent.

import { amount, has, number, text, told } from "./texts.js";

const $ = (id) => document.getElementById(id);
const SHAPES = {
  circle: "M50 10a40 40 0 1 0 .1 0zM30 52l14 14 28-32",
  up: "M50 90V14M20 44 50 12l30 32",
  left: "M88 82V60Q88 40 66 40H16M42 12 14 40l28 28",
  right: "M12 82V60Q12 40 34 40h50M58 12l28 28-28 28",
  octagon: "M33 8h34l25 25v34L67 92H33L8 67V33zM32 50h36",
};
const WAYS = { ahead: "▲", behind: "▼", left: "◀", right: "▶" };
let said = { mm: null, at: 0 };

export const NOTHING = { colour: "stop", shape: "octagon", instruction: "stop_now", news: false };

export function put(element, words) {
  if (element.textContent !== words) element.textContent = words;
}

export function reason({ rule, source, detail }) {
  const known = has(`rule.${rule}`) ? text(`rule.${rule}`) : rule;
  return [known, [source, told(detail)].filter(Boolean).join(": ")].filter(Boolean).join(" – ");
}

export function distance(state) {
  return state.nearest_mm == null ? "–" : number(state.nearest_mm);
}

export function drive(state, you, linked) {
  sign(state, linked);
  control(state, you, linked);
  now(state);
  health(state.sources ?? []);
  stops(state.stops ?? []);
  put($("who"), [state.person, state.chair].filter(Boolean).join(" · "));
}

function sign(state, linked) {
  $("sign").className = state.colour;
  const path = $("shape").firstElementChild;
  if (path.getAttribute("d") !== SHAPES[state.shape]) path.setAttribute("d", SHAPES[state.shape]);
  put($("instruction"), text(`instruction.${state.instruction}`));
  put($("mm"), distance(state));
  put($("unit"), "mm");
  const lines = [];
  if (!linked) lines.push(text("no_link"));
  else if (!state.news) lines.push(text("no_news"));
  if (state.latch) lines.push(`${text(state.needs_reset ? "latch.reset" : "latch.arm")} – ${told(state.latch)}`);
  else if (linked && state.news && !state.armed) lines.push(text("not_armed"));
  if (state.remembers) lines.push(text("remembers"));
  if (state.help) lines.push(text("help.called"));
  const reasons = (state.reasons ?? []).filter(({ rule }) => rule !== "latch"); // it has its own line above
  list($("reasons"), [...new Set([...lines, ...reasons.map(reason)])].slice(0, 4));
  announce(state);
}

// A screen reader hears the distance when it has changed by a tenth, at most every 2 s.
function announce(state) {
  const at = performance.now();
  const { nearest_mm: mm = null } = state;
  const changed = mm === null ? said.mm !== null : said.mm === null || Math.abs(mm - said.mm) > said.mm / 10;
  if (!changed || at - said.at < 2000) return;
  said = { mm, at };
  put($("distance-said"), mm === null ? text("distance.none") : text("distance", { mm: number(mm) }));
}

function control(state, you, linked) {
  const alive = linked && you.controls && you.alive;
  const key = !linked ? "no_link" : alive ? "control.alive" : you.controls ? "control.starting" : you.free ? "control.free" : "control.other";
  put($("control"), text(key));
  $("control").classList.toggle("alive", alive);
  const still = alive && state.standing && state.news;
  disable($("arm"), !(still && !state.armed && !state.needs_reset));
  disable($("reset"), !(still && (state.needs_reset || state.remembers)));
  $("take").hidden = !linked || you.controls || !you.free;
  $("give").hidden = !linked || !you.controls;
  put($("refused"), you.refused ? text(you.refused) : told(state.refused ?? ""));
}

function disable(button, off) {
  const value = String(off);
  if (button.getAttribute("aria-disabled") !== value) button.setAttribute("aria-disabled", value);
}

function now(state) {
  const open = state.open ?? [];
  put($("ways"), open.length ? open.map((way) => `${WAYS[way]} ${text(`way.${way}`)}`).join("  ") : text("ways.none"));
  const heard = state.heard;
  put($("heard"), heard ? `${heard.word || text(`command.${heard.command}`)} = ${text(`command.${heard.command}`)}, ${amount(Math.round(heard.confidence * 100), "%")}, ${text("ago", { s: number(Math.round(heard.age_ms / 1000)) })}` : text("heard.none"));
  bar($("lease"), state.lease_left_s ?? 0, 0, state.lease_s ?? 8, (state.lease_left_s ?? 0) > 0 && state.lease_left_s <= state.lease_warn_s, amount(Math.ceil(state.lease_left_s ?? 0), "s"));
  const mic = state.microphone;
  bar($("mic"), mic?.level_dbfs ?? -80, -80, 0, mic?.clipping ?? false, mic ? amount(Math.round(mic.level_dbfs), "dB") : text("none"));
  const motion = state.motion ?? { speed_mm_s: 0, turn_deg_s: 0 };
  put($("speed"), `${amount(motion.speed_mm_s, "mm/s")}, ${amount(motion.turn_deg_s, "°/s")}`);
  const { battery, linked, armed, fault, stopped_by_user: stopped, charging } = state.drive ?? {};
  put($("battery"), battery == null ? text("none") : amount(Math.round(battery * 100), "%"));
  const drives = [text(!linked ? "drive.lost" : armed ? "drive.armed" : "drive.idle")];
  if (stopped) drives.push(text("drive.stopped"));
  if (charging) drives.push(text("drive.charging"));
  if (fault) drives.push(told(fault));
  put($("drive"), drives.join(", "));
}

function bar(element, value, least, most, warn, words) {
  const part = Math.min(1, Math.max(0, (value - least) / (most - least)));
  element.firstElementChild.style.width = `${(100 * part).toFixed(1)}%`;
  element.setAttribute("aria-valuemax", most);
  element.setAttribute("aria-valuenow", Math.min(most, Math.max(least, value)).toFixed(1));
  element.setAttribute("aria-valuetext", words);
  element.classList.toggle("warn", warn);
}

function list(parent, lines) {
  while (parent.children.length > lines.length) parent.lastElementChild.remove();
  lines.forEach((line, i) => put(parent.children[i] ?? parent.appendChild(document.createElement("li")), line));
}

function health(sources) {
  const body = $("sources");
  while (body.rows.length > sources.length) body.deleteRow(-1);
  sources.forEach((source, i) => {
    const row = body.rows[i] ?? body.insertRow();
    while (row.cells.length < 4) row.insertCell();
    row.className = source.state;
    row.cells[2].className = row.cells[3].className = "num";
    const mark = { well: "✓", ill: "!", silent: "✕" }[source.state];
    const state = `${mark} ${text(`health.${source.state}`)}`;
    const words = [source.name, source.reason ? `${state}: ${told(source.reason)}` : state, source.age_ms == null ? "–" : amount(source.age_ms, "ms"), amount(source.limit_ms, "ms")];
    words.forEach((word, j) => put(row.cells[j], word));
  });
}

function stops(rows) {
  const lines = [...rows].reverse().map((row) => [text("ago", { s: number(row.age_s) }), row.nearest_mm == null ? "" : amount(row.nearest_mm, "mm"), row.reasons.map(reason).join("; ")].filter(Boolean).join(", "));
  list($("stops"), lines.length ? lines : [text("stops.none")]);
}
