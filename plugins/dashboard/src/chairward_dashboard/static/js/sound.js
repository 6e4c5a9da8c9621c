// Tones, vibration and spoken reasons: heard, warning, stop, call for help. Only when switched on, but help always sounds.

import { looks } from "./looks.js";
import { reason } from "./sign.js";
import { language, text, told } from "./texts.js";

const TONES = { heard: [[880, 0.08]], warn: [[660, 0.1], [0, 0.06], [660, 0.1]], stop: [[330, 0.18], [0, 0.05], [220, 0.3]], help: [[990, 0.2], [660, 0.2], [990, 0.2], [660, 0.2], [990, 0.2], [660, 0.2]] };
const SHAKES = { warn: [80], stop: [200, 80, 200], help: [400, 100, 400, 100, 400] };
const NOT_AGAIN_MS = 4000;
let context = null;
let before = {};
let spoken = { words: "", at: -NOT_AGAIN_MS };
let speaking = false;

/** What has changed since the last state, as sound; say() tells the chair that it speaks. */
export function sounds(state, say) {
  if (state.help && !before.help) sound("help", text("help.called"), say);
  else if (state.colour === "stop" && before.colour && before.colour !== "stop") sound("stop", why(state), say);
  else if (state.colour === "warn" && before.colour !== "warn") sound("warn", text(`instruction.${state.instruction}`), say);
  else if (state.heard && (!before.heard || state.heard.age_ms < before.heard.age_ms)) sound("heard", "", say);
  before = state;
}

function why(state) {
  const first = (state.reasons ?? []).find(({ rule }) => rule !== "latch");
  return [text(`instruction.${state.instruction}`), state.latch ? told(state.latch) : "", !state.latch && first ? reason({ ...first, source: "" }) : ""].filter(Boolean).join(". ");
}

function sound(name, sentence, say) {
  const loud = looks.sound || name === "help";
  if (loud) play(name);
  if (loud && SHAKES[name]) navigator.vibrate?.(SHAKES[name]);
  if (looks.speak && sentence) speak(sentence.replace(/[\u2066\u2069]/g, ""), say);
}

function play(name) {
  context ??= new AudioContext();
  let at = context.currentTime;
  for (const [hz, seconds] of TONES[name]) {
    if (hz) {
      const oscillator = new OscillatorNode(context, { frequency: hz });
      const gain = new GainNode(context, { gain: 0.2 });
      oscillator.connect(gain).connect(context.destination);
      oscillator.start(at);
      oscillator.stop(at + seconds);
    }
    at += seconds;
  }
}

/** One sentence at a time, none twice within 4 s; what comes too late to be of use is not said at all. */
async function speak(words, say) {
  const asked = performance.now();
  if (speaking || (words === spoken.words && asked - spoken.at < NOT_AGAIN_MS)) return;
  speaking = true;
  try {
    const answer = await fetch(`/api/say?${new URLSearchParams({ language, text: words.slice(0, 240) })}`);
    if (!answer.ok) return;
    context ??= new AudioContext();
    const sound = await context.decodeAudioData(await answer.arrayBuffer());
    if (performance.now() - asked > 2000 || context.state !== "running") return;
    spoken = { words, at: asked };
    say({ t: "speaks", ms: Math.min(15000, Math.ceil(sound.duration * 1000) + 200) });
    const node = new AudioBufferSourceNode(context, { buffer: sound });
    node.connect(context.destination);
    node.start();
    await new Promise((ended) => { node.onended = ended; setTimeout(ended, 15000); });
  } catch (error) {
    console.info(`not spoken: ${error.message}`);
  } finally {
    speaking = false;
  }
}
