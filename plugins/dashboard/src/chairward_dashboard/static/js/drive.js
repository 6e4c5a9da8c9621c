// Writes a state into the drive page. Texts only ever through textContent.

import { $, bar, disable, list, put } from "./dom.js";
import { distance, reason, shape } from "./sign.js";
import { amount, number, text, told } from "./texts.js";

const WAYS = { ahead: "▲", behind: "▼", left: "◀", right: "▶" };
let said = { mm: null, at: 0 };

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
  shape($("shape"), state.shape);
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
  const lines = [...rows].reverse().map((row) => [text("ago", { s: number(row.age_s) }), row.nearest_mm == null ? "" : amount(row.nearest_mm, "mm"), told(row.latch), row.reasons.map(reason).join("; ")].filter(Boolean).join(", "));
  list($("stops"), lines.length ? lines : [text("stops.none")]);
}
