// Try-it: say anything, and see how near each word is and whether it would count.

import { post } from "./api.js";
import { $, bar, make, put } from "./dom.js";
import { once, theMicrophone } from "./recorder.js";
import { amount, number, text } from "./texts.js";

let page = null;
let running = false;

export function wire(wanted) {
  page = wanted;
  $("try").addEventListener("click", () => (running ? stop() : page.attempt(start)));
}

function stop() {
  running = false;
  put($("try"), text("words.try.start"));
}

async function start() {
  running = true;
  put($("try"), text("words.try.stop"));
  put($("heard"), text("words.try.listening"));
  try {
    if ($("source").value === "chair") {
      while (running) await judge((await once(2.5)).take);
    } else {
      const microphone = await theMicrophone();
      let busy = false;
      let failed = null;
      microphone.listen(async (sound) => {
        if (busy || !running) return;
        busy = true;
        try {
          await judge((await post("/api/words/take", sound)).take);
        } catch (error) {
          failed = error;
        }
        busy = false;
      });
      while (running && !failed) await new Promise((done) => setTimeout(done, 100));
      microphone.stop();
      if (failed) throw failed;
    }
  } finally {
    stop();
  }
}

async function judge(take) {
  const told = await post("/api/words/try", { person: page.person(), take });
  if (told.score == null) {
    put($("heard"), text("words.try.listening"));
    return;
  }
  const words = { word: told.word, score: number(told.score), needed: number(told.needed) };
  put($("heard"), text(told.heard == null ? "words.try.refused" : "words.try.heard", words));
  $("heard").className = `heard ${told.heard == null ? "warn" : "go"}`;
  $("scores").replaceChildren(...told.scores.map(({ word, near }) => {
    const meter = make("div", { class: "bar thin", role: "meter", "aria-label": word, "aria-valuemin": "0" }, make("span"));
    bar(meter, near, 0, 1, false, amount(Math.round(100 * near), "%"));
    return make("div", { class: "score" }, make("bdi", {}, word), meter, make("span", { class: "num" }, amount(Math.round(100 * near), "%")));
  }));
}
