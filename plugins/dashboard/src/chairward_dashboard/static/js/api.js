// Requests of set-up pages. What is refused comes as an Error with the chair's own sentence.

import { has, text } from "./texts.js";

async function ask(path, options) {
  let answer;
  try {
    answer = await fetch(path, options);
  } catch {
    throw new Error(text("no_link"));
  }
  const data = await answer.json().catch(() => ({}));
  if (answer.ok) return data;
  const why = data.why ?? `${answer.status} ${answer.statusText}`;
  throw new Error(has(why) ? text(why) : why);
}

export const get = (path) => ask(path, {});
export const post = (path, data) => ask(path, { method: "POST", body: data instanceof Blob ? data : JSON.stringify(data) });
