// The drive page: shows, and is a stop device while it can be seen.

import { drive, NOTHING } from "./drive.js";
import { connect, stopButton, stopKeys } from "./link.js";
import { choices, dress, looks } from "./looks.js";
import * as panes from "./panes.js";
import * as scan from "./scan.js";
import { play } from "./sound.js";
import { speak } from "./texts.js";

const $ = (id) => document.getElementById(id);
let last = { state: NOTHING, you: {}, linked: false };
let before = {};
let newest = -1e9;

dress();
await speak(looks.language || document.documentElement.lang);
panes.build($("panes"));

const link = connect({
  panes: panes.NAMES,
  controls: true,
  onBundle: async ({ state, you, panes: pictures }) => {
    newest = performance.now();
    await greet(state);
    last = { state, you, linked: true };
    panes.show(pictures);
    draw();
    sounds(state);
    awake(you.controls);
    keep(you);
  },
  onLost: () => {
    last = { state: NOTHING, you: {}, linked: false };
    draw();
  },
});

scan.offer($("scan"));
choices(() => {
  panes.name();
  scan.offer($("scan"));
  scan.walk();
  draw();
});

function draw() {
  drive(last.state, last.you, last.linked);
}

// A server that is silent is no news either: what is on the screen must not be old.
setInterval(() => {
  if (last.linked && performance.now() - newest > 1000) {
    last = { ...last, state: { ...NOTHING }, linked: false };
    draw();
    panes.show([]);
  }
}, 250);

let greeted = false;
async function greet(state) {
  if (greeted) return;
  greeted = true;
  if (!looks.language) {
    await speak(state.language);
    panes.name();
    scan.offer($("scan"));
  }
  $("language").value = document.documentElement.lang;
}

function sounds(state) {
  if (state.help && !before.help) play("help");
  else if (state.colour === "stop" && before.colour && before.colour !== "stop") play("stop");
  else if (state.colour === "warn" && before.colour !== "warn") play("warn");
  else if (state.heard && before.heard && state.heard.age_ms < before.heard.age_ms) play("heard");
  before = state;
}

// A page that controlled and stuttered asks for control again: the chair has been stopped by then, and must be armed anew.
let mine = false;
function keep(you) {
  if (you.controls) mine = true;
  else if (!you.free) mine = false;
  else if (mine && !document.hidden) link.say({ t: "take" });
}

// The screen of the page that controls stays on, where the browser can (on a network only over https).
let lock = null;
async function awake(wanted) {
  if (!wanted || lock || document.hidden || !navigator.wakeLock) return;
  lock = "asked";
  try {
    lock = await navigator.wakeLock.request("screen");
    lock.addEventListener("release", () => { lock = null; });
  } catch {
    setTimeout(() => { lock = null; }, 10000); // refused (battery saver): ask again later
  }
}

stopKeys(link.push);
stopButton($("stop"), link.push);
for (const id of ["arm", "reset", "help"]) {
  $(id).addEventListener("click", () => {
    if ($(id).getAttribute("aria-disabled") !== "true") link.push(id);
  });
}
scan.walk();
$("take").addEventListener("click", () => link.say({ t: "take" }));
$("give").addEventListener("click", () => {
  mine = false;
  link.say({ t: "give" });
});
draw();
