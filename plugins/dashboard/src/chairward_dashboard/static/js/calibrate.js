// The cameras page: what to do with the board next, what is covered, and the result.

import { get, post } from "./api.js";
import { $, bar, disable, isOff, make, put } from "./dom.js";
import { attempt, frame } from "./frame.js";
import { amount, has, number, text } from "./texts.js";

const LOOK_MS = 300;
const TURNS = ["left", "right", "top", "bottom"];
let state = { running: false, newest: {}, result: null, error: "" };
let picture = 0;

function draw() {
  const { running, newest, result, error } = state;
  $("finish").hidden = !running;
  disable($("begin"), running);
  const hint = newest.ask ? [`calibrate.${newest.ask}.${newest.direction}`, `calibrate.${newest.ask}`].find(has) : "";
  const way = (newest.direction ?? "").split(" ").filter(Boolean).map((one) => text(`calibrate.way.${one}`)).join(" ");
  const words = error ? (has(error) ? text(error) : error) : result ? text("calibrate.done") : hint ? text(hint, { way }) : running ? text("calibrate.starting") : "";
  put($("hint"), words);
  $("hint").className = `heard ${error ? "stop" : result || newest.taken ? "go" : newest.ask === "hold" ? "warn" : ""}`;
  const share = Math.round(100 * (newest.coverage ?? 0));
  bar($("coverage"), share, 0, 100, false, amount(share, "%"));
  put($("views"), newest.ask ? text("calibrate.views", { n: number(newest.views), share: amount(share, "%") }) : "");
  const checks = newest.ask ? [...TURNS.map((side) => [`calibrate.turned.${side}`, newest.turned.includes(side)]), ["calibrate.near", newest.near], ["calibrate.far", newest.far]] : [];
  $("still").replaceChildren(...checks.map(([key, done]) => make("li", { class: done ? "good" : "" }, `${done ? "✓" : "○"} ${text(key)}`)));
  $("preview").alt = text("calibrate.preview");
  $("result").hidden = !result;
  if (result) {
    const figures = ["views_used", "rms_left", "rms_right", "rms_stereo", "epipolar_p95", "epipolar_p95_unseen"].filter((key) => result[key] != null);
    $("figures").replaceChildren(...figures.map((key) => make("div", {}, make("dt", {}, text(`calibrate.${key}`)), make("dd", {}, key === "views_used" ? number(result[key]) : amount(result[key], "px")))));
  }
}

async function look() {
  const before = state.running;
  state = await get("/api/calibrate");
  const preview = $("preview");
  if (state.newest.picture && state.newest.picture !== picture) {
    picture = state.newest.picture;
    preview.src = `/api/calibrate/preview.jpg?${picture}`;
    preview.hidden = false;
  }
  if (before || state.running || state.error || state.result) draw();
}

async function follow() {
  do {
    await new Promise((done) => setTimeout(done, LOOK_MS));
    await look();
  } while (state.running);
}

await frame({ onLanguage: draw });
$("board").addEventListener("submit", (event) => {
  event.preventDefault();
  if (isOff($("begin"))) return;
  attempt(async () => {
    put($("kept"), "");
    await post("/api/calibrate/begin", { columns: Number($("columns").value), rows: Number($("rows").value), square_mm: Number($("square").value) });
    await follow();
  });
});
$("finish").addEventListener("click", () => attempt(() => post("/api/calibrate/finish", {})));
$("keep").addEventListener("click", () => attempt(async () => {
  const { file, named } = await post("/api/calibrate/keep", {});
  put($("kept"), text(named ? "calibrate.kept" : "calibrate.kept.unnamed", { file }));
}));
draw();
await attempt(look);
if (state.running) attempt(follow);
