// This device's microphone: its level, so many seconds of it, or one word after the other, as wav files of 16 bit.

import { text } from "./texts.js";

const KEPT_S = 0.3;
const QUIET_S = 0.45;
const ABOVE_ROOM = 4;
const LONGEST_S = 3.5;

/** Opens the microphone; onLevel(dBFS) ten times a second. Raises with a sentence where there is none. */
export async function open(onLevel) {
  if (!navigator.mediaDevices) throw new Error(text("words.insecure"));
  let stream;
  try {
    stream = await navigator.mediaDevices.getUserMedia({ audio: { echoCancellation: false, noiseSuppression: false, autoGainControl: false } });
  } catch {
    throw new Error(text("words.refused"));
  }
  const context = new AudioContext();
  await context.resume();
  await context.audioWorklet.addModule("/static/js/tap.js");
  const tap = new AudioWorkletNode(context, "tap", { numberOfOutputs: 0 });
  context.createMediaStreamSource(stream).connect(tap);
  const rate = context.sampleRate;
  let onBlock = () => {};
  let power = 0;
  let count = 0;
  tap.port.onmessage = ({ data }) => {
    for (const value of data) power += value * value;
    count += data.length;
    if (count >= rate / 10) {
      onLevel(10 * Math.log10(power / count + 1e-12));
      power = count = 0;
    }
    onBlock(data);
  };
  return {
    /** That many seconds from now on, as a wav file. */
    record: (seconds) => new Promise((done) => {
      const blocks = [];
      let size = 0;
      onBlock = (block) => {
        blocks.push(block);
        size += block.length;
        if (size < seconds * rate) return;
        onBlock = () => {};
        done(wav(blocks, rate));
      };
    }),
    /** onWord(wav) for each sound that stands out of the room, until stopped. */
    listen: (onWord) => { onBlock = words(rate, onWord); },
    stop: () => { onBlock = () => {}; },
    close: () => {
      onBlock = () => {};
      for (const track of stream.getTracks()) track.stop();
      context.close();
    },
  };
}

/** Cuts a stream into sounds: louder than the room, ended by a pause. */
function words(rate, onWord) {
  let room = null;
  let blocks = [];
  let seconds = 0;
  let quiet = 0;
  let inside = false;
  return (block) => {
    let power = 0;
    for (const value of block) power += value * value;
    const level = Math.sqrt(power / block.length) + 1e-6;
    const length = block.length / rate;
    room = room === null ? level : Math.min(level, room * (1 + 0.5 * length));
    const loud = level > ABOVE_ROOM * room + 0.002;
    blocks.push(block);
    seconds += length;
    quiet = loud ? 0 : quiet + length;
    if (loud) inside = true;
    if (!inside) {
      while (seconds > KEPT_S) seconds -= blocks.shift().length / rate;
    } else if (quiet > QUIET_S || seconds > LONGEST_S) {
      onWord(wav(blocks, rate));
      blocks = [];
      seconds = quiet = 0;
      inside = false;
    }
  };
}

function wav(blocks, rate) {
  const size = blocks.reduce((sum, block) => sum + block.length, 0);
  const view = new DataView(new ArrayBuffer(44 + 2 * size));
  const write = (at, letters) => [...letters].forEach((letter, i) => view.setUint8(at + i, letter.charCodeAt(0)));
  write(0, "RIFF");
  view.setUint32(4, 36 + 2 * size, true);
  write(8, "WAVEfmt ");
  for (const [at, value, bytes] of [[16, 16, 4], [20, 1, 2], [22, 1, 2], [24, rate, 4], [28, 2 * rate, 4], [32, 2, 2], [34, 16, 2]]) {
    if (bytes === 4) view.setUint32(at, value, true);
    else view.setUint16(at, value, true);
  }
  write(36, "data");
  view.setUint32(40, 2 * size, true);
  let at = 44;
  for (const block of blocks) {
    for (const value of block) {
      view.setInt16(at, Math.max(-1, Math.min(1, value)) * 32767, true);
      at += 2;
    }
  }
  return new Blob([view], { type: "audio/wav" });
}
