// The instruction: colour, shape and words that always say the same; and reasons in the page's language.

import { has, number, text, told } from "./texts.js";

export const SHAPES = {
  circle: "M50 10a40 40 0 1 0 .1 0zM30 52l14 14 28-32",
  up: "M50 90V14M20 44 50 12l30 32",
  left: "M88 82V60Q88 40 66 40H16M42 12 14 40l28 28",
  right: "M12 82V60Q12 40 34 40h50M58 12l28 28-28 28",
  octagon: "M33 8h34l25 25v34L67 92H33L8 67V33zM32 50h36",
};

export const NOTHING = { colour: "stop", shape: "octagon", instruction: "stop_now", news: false };

export function shape(svg, name) {
  const path = svg.firstElementChild;
  if (path.getAttribute("d") !== SHAPES[name]) path.setAttribute("d", SHAPES[name]);
}

export function reason({ rule, source, detail }) {
  const known = has(`rule.${rule}`) ? text(`rule.${rule}`) : rule;
  return [known, [source, told(detail)].filter(Boolean).join(": ")].filter(Boolean).join(" – ");
}

export const distance = (state) => (state.nearest_mm == null ? "–" : number(state.nearest_mm));
