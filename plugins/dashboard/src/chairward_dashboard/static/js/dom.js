// Small helpers to build pages. Texts only ever through textContent.

export const $ = (id) => document.getElementById(id);

/** An element: make("button", { type: "button", class: "plain", onclick }, "text", child, ...) */
export function make(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (value === true) element.setAttribute(name, "");
    else if (value !== false && value != null) element.setAttribute(name, value);
  }
  element.append(...children.filter((child) => child != null));
  return element;
}

export function put(element, words) {
  if (element.textContent !== words) element.textContent = words;
}

/** A button that is off can still be reached, and says so. */
export function disable(button, off) {
  const value = String(Boolean(off));
  if (button.getAttribute("aria-disabled") !== value) button.setAttribute("aria-disabled", value);
}

export const isOff = (button) => button.getAttribute("aria-disabled") === "true";

export function list(parent, lines) {
  while (parent.children.length > lines.length) parent.lastElementChild.remove();
  lines.forEach((line, i) => put(parent.children[i] ?? parent.appendChild(document.createElement("li")), line));
}

export function bar(element, value, least, most, warn, words) {
  const part = Math.min(1, Math.max(0, (value - least) / (most - least)));
  element.firstElementChild.style.width = `${(100 * part).toFixed(1)}%`;
  element.setAttribute("aria-valuemax", most);
  element.setAttribute("aria-valuenow", Math.min(most, Math.max(least, value)).toFixed(1));
  element.setAttribute("aria-valuetext", words);
  element.classList.toggle("warn", warn);
}

/** Ask once more by the button itself: the second press within five seconds does it. question(): the words to ask with. */
export function twice(button, question, action) {
  let words = null;
  let timer = 0;
  const rest = () => {
    clearTimeout(timer);
    put(button, words);
    words = null;
  };
  button.addEventListener("click", () => {
    if (isOff(button)) return;
    if (words !== null) {
      rest();
      action();
      return;
    }
    words = button.textContent;
    put(button, question());
    timer = setTimeout(rest, 5000);
  });
  return button;
}
