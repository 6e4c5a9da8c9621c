// The drive page: shows, and is a stop device while it can be seen.

import { $ } from "./dom.js";
import { drive } from "./drive.js";
import { navigation } from "./frame.js";
import { connect, stopButton, stopKeys } from "./link.js";
import { choices, dress, looks } from "./looks.js";
import * as panes from "./panes.js";
import * as scan from "./scan.js";
import { NOTHING } from "./sign.js";
import { sounds } from "./sound.js";
import { speak } from "./texts.js";

let last = { state: NOTHING, you: {}, linked: false };
let newest = -1e9;

document.querySelector("header").append(navigation("drive"));
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
    sounds(state, link.say);
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

// A page that asked for control and stuttered asks again while nobody else has it: the chair has been stopped by then,
// and must be armed anew.
let mine = true;
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
