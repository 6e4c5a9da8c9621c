// The four pictures. Newest only: a picture that is still being decoded is never waited for by the next.

import { looks } from "./looks.js";
import { amount, text } from "./texts.js";

export const NAMES = ["left", "right", "obstacle", "disparity"];
const OLD_MS = 1000;
const figures = new Map();

export function build(parent) {
  parent.replaceChildren();
  for (const name of NAMES) {
    const figure = document.createElement("figure");
    const canvas = document.createElement("canvas");
    canvas.setAttribute("role", "img");
    canvas.width = 320;
    canvas.height = 240;
    const caption = document.createElement("figcaption");
    const title = document.createElement("span");
    const age = document.createElement("span");
    caption.append(title, age);
    const legend = document.createElement("canvas");
    legend.className = "legend";
    legend.width = 256;
    legend.height = 1;
    legend.hidden = true;
    legend.setAttribute("aria-hidden", "true");
    figure.append(canvas, caption, legend);
    parent.append(figure);
    figures.set(name, { figure, canvas, title, age, legend, busy: false, at: -OLD_MS });
  }
  name();
}

/** Titles in the language of now, and the legend of the coloured disparity. */
export function name() {
  for (const [key, pane] of figures) {
    pane.title.textContent = text(`pane.${key}`);
    pane.canvas.setAttribute("aria-label", text(`pane.${key}`));
    pane.legend.hidden = !(key === "disparity" && looks.colour);
    if (!pane.legend.hidden) {
      const strip = new Uint8ClampedArray(256 * 4).map((_, i) => (i % 4 === 3 ? 255 : i >> 2));
      const context = pane.legend.getContext("2d");
      context.putImageData(colourful(new ImageData(strip, 256, 1)), 0, 0);
      pane.title.textContent = text("pane.disparity.colour");
    }
  }
}

export async function show(panes) {
  const now = performance.now();
  for (const { name: key, blob, age_ms: age } of panes) {
    const pane = figures.get(key);
    if (!pane || pane.busy) continue;
    pane.busy = true;
    pane.at = now - age;
    draw(pane, key, blob).finally(() => { pane.busy = false; });
  }
  for (const pane of figures.values()) {
    const age = now - pane.at;
    pane.figure.classList.toggle("old", age > OLD_MS);
    pane.age.textContent = age > OLD_MS ? text("pane.old") : amount(Math.round(age), "ms");
  }
}

async function draw(pane, key, blob) {
  const picture = await createImageBitmap(blob);
  if (pane.canvas.width !== picture.width || pane.canvas.height !== picture.height) {
    pane.canvas.width = picture.width;
    pane.canvas.height = picture.height;
  }
  const context = pane.canvas.getContext("2d", { willReadFrequently: key === "disparity" });
  context.drawImage(picture, 0, 0);
  picture.close();
  if (key === "disparity" && looks.colour) {
    const image = context.getImageData(0, 0, pane.canvas.width, pane.canvas.height);
    context.putImageData(colourful(image), 0, 0);
  }
}

/** Far blue, middle green, near red; black (not known) stays black. Brightness rises too. */
function colourful(image) {
  const data = image.data;
  for (let i = 0; i < data.length; i += 4) {
    const v = data[i] / 255;
    if (v < 0.02) continue;
    data[i] = 255 * Math.min(1, Math.max(0, 2 * v - 0.6) + 0.2 * v);
    data[i + 1] = 255 * Math.min(1, 0.3 + 0.9 * (1 - Math.abs(2 * v - 1)));
    data[i + 2] = 255 * Math.max(0, 0.9 - 1.4 * v);
  }
  return image;
}
