// Recording a word: takes with their pictures, each to be heard, said again or left out; saved when they are good.

import { get, post } from "./api.js";
import { $, disable, isOff, list, make, put } from "./dom.js";
import { open } from "./microphone.js";
import { drawMel, drawWave } from "./picture.js";
import { amount, number, text } from "./texts.js";

const SECONDS = 2.2;
const WANTED = 4;
const FEWEST = 3;
const PAUSE_MS = 700;

let page = null;
let word = "";
let takes = [];
let microphone = null;
let running = false;
let sound = null;

export function wire(wanted) {
  page = wanted;
  $("record").addEventListener("click", () => (running ? stop() : page.attempt(all)));
  $("save").addEventListener("click", () => !isOff($("save")) && page.attempt(() => save(false)));
  $("anyway").addEventListener("click", () => page.attempt(() => save(true)));
  $("cancel").addEventListener("click", close);
  $("files").addEventListener("change", () => page.attempt(fromFiles));
}

/** Show the recording part for a word, with what is stored of it. */
export async function begin(wanted, stored = []) {
  word = wanted;
  takes = await Promise.all(stored.map(async (take) => ({ take, ...(await get(`/api/words/look/${take}`)) })));
  $("recording").hidden = false;
  $("anyway").hidden = true;
  list($("problems"), []);
  put($("recording-title"), text("words.recording", { word }));
  put($("prompt"), text("words.say.ready", { word, n: number(WANTED) }));
  draw();
  $("record").focus();
  $("recording").scrollIntoView({ block: "nearest" });
}

export function close() {
  stop();
  $("recording").hidden = true;
  closeMicrophone();
}

export function closeMicrophone() {
  microphone?.close();
  microphone = null;
}

export async function theMicrophone() {
  microphone ??= await open(page.level);
  return microphone;
}

/** One recording through the microphone that is chosen; {take, seconds, wave, mel, level_dbfs, problem}. */
export async function once(seconds = SECONDS) {
  if ($("source").value === "chair") return post("/api/words/listen", { seconds });
  return post("/api/words/take", await (await theMicrophone()).record(seconds));
}

function stop() {
  running = false;
  draw();
}

/** One take after the other until there are enough good ones, or it is pressed again. */
async function all() {
  running = true;
  if (takes.filter((take) => !take.problem).length >= WANTED) takes = [];
  draw();
  try {
    while (running && takes.filter((take) => !take.problem).length < WANTED) {
      await one(takes.findIndex((take) => take.problem));
      await new Promise((done) => setTimeout(done, PAUSE_MS));
    }
  } finally {
    running = false;
    draw();
  }
  put($("prompt"), text("words.say.enough"));
}

async function one(place) {
  if ($("source").value === "browser") await theMicrophone();
  put($("prompt"), text("words.say.now", { word }));
  $("recording").classList.add("listens");
  try {
    const take = await once();
    if (place < 0) takes.push(take);
    else takes[place] = take;
  } finally {
    $("recording").classList.remove("listens");
    put($("prompt"), "");
    draw();
  }
}

async function fromFiles() {
  for (const file of $("files").files) takes.push(await post("/api/words/take", file));
  $("files").value = "";
  draw();
}

function draw() {
  put($("record"), text(running ? "words.record.stop" : "words.record"));
  disable($("save"), running || takes.length < FEWEST);
  $("takes").replaceChildren(...takes.map((take, i) => {
    const n = number(i + 1);
    const wave = make("canvas", { "aria-hidden": "true" });
    const mel = make("canvas", { class: "mel", role: "img", "aria-label": text("words.picture", { n, s: number(take.seconds) }) });
    drawWave(wave, take.wave);
    drawMel(mel, take.mel);
    return make("li", { class: take.problem ? "bad" : "" },
      make("strong", {}, text("words.take", { n })), wave, mel,
      make("p", { class: take.problem ? "problem" : "quiet" }, take.problem ? `⚠ ${take.problem}` : `${amount(take.seconds, "s")}, ${amount(Math.round(take.level_dbfs), "dB")}`),
      make("span", { class: "row tight" },
        make("button", { type: "button", class: "plain small", "aria-label": text("words.play", { n, word }), onclick: () => play(take.take) }, "▶"),
        make("button", { type: "button", class: "plain small", onclick: () => !running && page.attempt(() => one(i)) }, text("words.again")),
        make("button", { type: "button", class: "plain small", onclick: () => { takes.splice(i, 1); draw(); } }, text("words.leave.out"))));
  }));
}

async function save(force) {
  const told = await post("/api/words/save", { person: page.person(), word, takes: takes.map((take) => take.take), force });
  list($("problems"), told.problems);
  $("anyway").hidden = Boolean(told.stored);
  if (!told.stored) return;
  close();
  await page.saved();
}

export function play(name) {
  sound?.pause();
  sound = new Audio(`/api/words/sound/${name}`);
  sound.play();
}
