// Short distinct tones (and vibration where there is one): heard, warning, stop. Only when switched on.

import { looks } from "./looks.js";

const TONES = { heard: [[880, 0.08]], warn: [[660, 0.1], [0, 0.06], [660, 0.1]], stop: [[330, 0.18], [0, 0.05], [220, 0.3]], help: [[990, 0.2], [660, 0.2], [990, 0.2], [660, 0.2]] };
let context = null;

export function play(name) {
  if (!looks.sound) return;
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
  if (name === "stop") navigator.vibrate?.([200, 80, 200]);
}
