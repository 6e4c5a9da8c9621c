// The log of stops: when, how near, why; and the left camera's picture where the profile lets it be kept.

import { get } from "./api.js";
import { $, make } from "./dom.js";
import { attempt, frame } from "./frame.js";
import { reason } from "./sign.js";
import { amount, language, text, told } from "./texts.js";

const AGAIN_MS = 5000;
let rows = [];

async function load() {
  const newest = (await get("/api/stops")).stops;
  const same = newest.length === rows.length && newest[0]?.name === rows[0]?.name;
  rows = newest;
  if (!same || !rows.length) draw();
}

function draw() {
  $("none").hidden = rows.length > 0;
  const when = new Intl.DateTimeFormat(language, { dateStyle: "medium", timeStyle: "medium" });
  $("log").replaceChildren(...rows.map((row) => {
    const title = row.latch ? `${text("stops.latched")} – ${told(row.latch)}` : row.reasons[0] ? reason(row.reasons[0]) : text("stop");
    const more = row.reasons.slice(row.latch ? 0 : 1).map((why) => make("li", {}, reason(why)));
    return make("li", { class: "card" },
      row.picture ? make("img", { src: `/api/stops/${row.name}.jpg`, alt: text("stops.picture"), loading: "lazy", width: "320", height: "240" }) : make("p", { class: "no-picture quiet" }, text("stops.no.picture")),
      make("div", {},
        make("p", { class: "quiet" }, make("time", { datetime: new Date(1000 * row.at_s).toISOString() }, when.format(1000 * row.at_s)), ` · ${row.person} · ${row.chair}`),
        make("h2", {}, title),
        row.nearest_mm == null ? null : make("p", { class: "far" }, amount(row.nearest_mm, "mm")),
        more.length ? make("ul", {}, ...more) : null));
  }));
}

await frame({ onLanguage: draw });
await attempt(load);
setInterval(() => attempt(load), AGAIN_MS);
