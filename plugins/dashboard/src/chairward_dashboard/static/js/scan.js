// One-switch scanning: the focus walks over the buttons that do something now; the switch types Enter on the right one.

import { looks } from "./looks.js";
import { number, text } from "./texts.js";

const PACES_S = [0, 1, 1.5, 2, 3, 5];
let timer = 0;

export function offer(select) {
  select.replaceChildren(...PACES_S.map((s) => new Option(s ? text("scan.pace", { s: number(s) }) : text("scan.off"), String(s))));
  select.value = String(looks.scan);
}

export function walk(what = "#controls button") {
  clearInterval(timer);
  const pace = Number(looks.scan);
  if (!pace) return;
  timer = setInterval(() => {
    const buttons = [...document.querySelectorAll(what)].filter((button) => button.offsetParent && button.getAttribute("aria-disabled") !== "true");
    buttons[(buttons.indexOf(document.activeElement) + 1) % buttons.length]?.focus();
  }, pace * 1000);
}
