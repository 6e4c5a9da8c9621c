// The live view: one picture, as large as the screen, for people who cannot turn their head. It only looks (and stops).

import { $, put } from "./dom.js";
import { navigation } from "./frame.js";
import { connect, stopButton, stopKeys } from "./link.js";
import { dress, looks } from "./looks.js";
import { NAMES } from "./panes.js";
import { NOTHING } from "./sign.js";
import { amount, speak, text } from "./texts.js";

const asked = new URLSearchParams(location.search).get("pane");
let which = NAMES.includes(asked) ? asked : "left";
let shown = "";
let newest = -1e9;

document.querySelector("header").prepend(navigation("live"));
dress();
await speak(looks.language || "en");

const link = connect({
  panes: [which],
  large: true,
  onBundle: async ({ state, panes }) => {
    sign(state);
    if (!looks.language && document.documentElement.lang !== state.language) {
      await speak(state.language);
      names();
    }
    for (const pane of panes) {
      if (pane.name !== which) continue;
      newest = performance.now() - pane.age_ms;
      const url = URL.createObjectURL(pane.blob);
      $("view").src = url;
      URL.revokeObjectURL(shown);
      shown = url;
    }
  },
  onLost: () => sign(NOTHING),
});

function sign(state) {
  $("live-sign").className = state.colour;
  put($("instruction"), text(`instruction.${state.instruction}`));
  put($("mm"), state.nearest_mm == null ? "" : amount(state.nearest_mm, "mm"));
}

setInterval(() => {
  const old = performance.now() - newest > 1000;
  $("view").hidden = old; // an old picture must not be taken for what is there now
  $("none").hidden = !old;
}, 250);

function names() {
  $("which").replaceChildren(...NAMES.map((name) => new Option(text(`pane.${name}`), name, name === which, name === which)));
  $("view").alt = text(`pane.${which}`);
}

$("which").addEventListener("change", () => {
  which = $("which").value;
  newest = -1e9;
  names();
  link.look({ panes: [which] });
});
$("full").addEventListener("click", () => $("view").requestFullscreen());
names();
sign(NOTHING);
stopKeys(link.push);
stopButton($("stop"), link.push);
