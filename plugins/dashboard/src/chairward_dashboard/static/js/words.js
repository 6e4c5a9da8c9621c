// The words page: whose words, what they mean, recording them, trying them.

import { get, post } from "./api.js";
import { $, bar, disable, list, make, twice } from "./dom.js";
import { attempt, frame } from "./frame.js";
import * as recorder from "./recorder.js";
import { amount, number, text } from "./texts.js";
import * as tryout from "./tryout.js";

let table = { words: [], people: [], commands: [], person: "", warnings: [] };

function level(dbfs) {
  bar($("level"), dbfs, -80, 0, false, amount(Math.round(dbfs), "dB"));
}

const chosen = () => table.person;

async function load(person = "") {
  table = await get(`/api/words?${new URLSearchParams({ person })}`);
  draw();
}

function draw() {
  const means = (command) => (command ? text(`command.${command}`) : text("words.nothing"));
  const options = (value) => ["", ...table.commands].map((command) => make("option", { value: command, selected: command === value }, means(command)));
  $("person").replaceChildren(...table.people.map(({ name, about }) => make("option", { value: name, selected: name === table.person }, [name, about].filter(Boolean).join(" – "))));
  $("new-command").replaceChildren(...options("front"));
  list($("alike"), table.warnings);
  $("words").replaceChildren(...table.words.map((row) => {
    const name = make("bdi", {}, row.word);
    const select = make("select", { "aria-label": text("words.means", { word: row.word }), onchange: () => attempt(() => mean(row.word, select.value)) }, ...options(row.command));
    const sounds = row.sounds.map((sound, i) => make("button", { type: "button", class: "plain small", "aria-label": text("words.play", { n: number(i + 1), word: row.word }), onclick: () => recorder.play(sound) }, "▶"));
    const record = make("button", { type: "button", onclick: () => attempt(() => recorder.begin(row.word, row.sounds)) }, text(row.sounds.length ? "words.open" : "words.record"));
    const remove = twice(make("button", { type: "button", class: "plain", "aria-disabled": String(!row.sounds.length) }, text("words.delete")), () => text("words.delete.sure"), () => attempt(() => forget(row.word)));
    return make("tr", { "data-word": row.word },
      make("th", { scope: "row", class: "word" }, name),
      make("td", {}, select),
      make("td", {}, row.sounds.length ? make("span", { class: "row tight" }, ...sounds) : make("span", { class: "quiet" }, text("words.none"))),
      make("td", {}, apart(row)),
      make("td", {}, make("span", { class: "row tight" }, record, remove)));
  }));
}

/** How far a word is from the nearest other one, in words and as a bar: 1.35 times its own spread is too near. */
function apart(row) {
  if (row.apart == null) return make("span", { class: "quiet" }, "–");
  const near = row.apart < 1.35;
  const meter = make("div", { class: "bar thin" }, make("span"));
  const words = text(near ? "words.alike" : "words.unlike", { word: row.nearest });
  bar(meter, Math.min(row.apart, 3), 1, 3, near, words);
  meter.setAttribute("role", "meter");
  meter.setAttribute("aria-label", text("words.apart"));
  meter.setAttribute("aria-valuemin", "1");
  return make("div", {}, meter, make("small", {}, `${near ? "⚠ " : ""}${words}`));
}

async function mean(word, command) {
  try {
    await post("/api/words/means", { person: table.person, word, command });
  } finally {
    await load(table.person); // what is written, not what was wished
  }
}

async function forget(word) {
  await post("/api/words/remove", { person: table.person, word });
  await load(table.person);
}

await frame({
  onState: (newest) => {
    if ($("source").value === "chair") level(newest.microphone?.level_dbfs ?? -80);
  },
  onLanguage: draw,
});
$("person").addEventListener("change", () => attempt(() => load($("person").value)));
$("source").addEventListener("change", () => recorder.closeMicrophone());
$("add").addEventListener("submit", (event) => {
  event.preventDefault();
  const word = $("new-word").value.trim();
  attempt(async () => {
    await mean(word, $("new-command").value);
    $("new-word").value = "";
    await recorder.begin(word);
  });
});
recorder.wire({ attempt, level, person: chosen, saved: () => load(table.person) });
tryout.wire({ attempt, person: chosen });
disable($("save"), true);
await attempt(load);
