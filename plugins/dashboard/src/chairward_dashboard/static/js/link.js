// The one WebSocket: bundles in, small words out. A lost link is opened again; nothing is ever queued.

const BEAT_MS = 100;

/** onBundle({n, you, state, panes}) with panes = [{name, age_ms, blob}]; onLost() when there is no link. */
export function connect({ panes, large = false, controls = false, onBundle, onLost }) {
  let socket = null;
  let look = { panes, large };

  const say = (word) => {
    if (socket?.readyState === WebSocket.OPEN) socket.send(JSON.stringify(word));
  };

  const open = () => {
    socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/ws`);
    socket.binaryType = "arraybuffer";
    socket.onopen = () => {
      say({ t: "look", ...look });
      if (controls && !document.hidden) say({ t: "take" });
    };
    socket.onmessage = ({ data }) => {
      const bundle = unpack(data);
      say({ t: "got", n: bundle.n });
      onBundle(bundle);
    };
    socket.onclose = () => {
      onLost();
      setTimeout(open, 1000);
    };
  };

  setInterval(() => {
    if (controls && !document.hidden) say({ t: "beat", at_ms: performance.now() });
  }, BEAT_MS);
  document.addEventListener("visibilitychange", () => {
    if (!controls) return;
    say({ t: document.hidden ? "hidden" : "take" });
  });
  addEventListener("pagehide", () => socket?.close());
  open();

  return {
    say,
    push: (button) => say({ t: "push", button }),
    look: (wanted) => {
      look = { ...look, ...wanted };
      say({ t: "look", ...look });
    },
  };
}

function unpack(buffer) {
  const size = new DataView(buffer).getUint32(0);
  const head = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, size)));
  let at = 4 + size;
  for (const pane of head.panes) {
    pane.blob = new Blob([new Uint8Array(buffer, at, pane.bytes)], { type: "image/jpeg" });
    at += pane.bytes;
  }
  return head;
}

const isText = (element) => element.matches?.("textarea, input:not([type=checkbox], [type=radio], [type=file])");

/** Space and Escape always stop, wherever the focus is (but a space can be typed into a text); so does any button of a
 * gamepad or joystick. Enter presses what has the focus, boxes too. */
export function stopKeys(push) {
  const isStop = (event) => event.key === "Escape" || (event.key === " " && !isText(event.target));
  addEventListener("keydown", (event) => {
    if (event.key === "Enter" && event.target.matches?.("[type=checkbox], [type=radio], [type=file]")) event.target.click();
    if (!isStop(event)) return;
    if (!event.repeat) push("stop");
    if (event.key === " ") event.preventDefault();
  }, { capture: true });
  addEventListener("keyup", (event) => {
    if (event.key === " " && isStop(event)) event.preventDefault();
  }, { capture: true });
  let down = false;
  setInterval(() => {
    const now = [...(navigator.getGamepads?.() ?? [])].some((pad) => pad?.buttons.some((button) => button.pressed));
    if (now && !down) push("stop");
    down = now;
  }, 50);
}

/** A stop at the first touch, not at its end; and for switches and screen readers by a plain click. */
export function stopButton(button, push) {
  let at = -1000;
  const stop = () => {
    if (performance.now() - at > 300) push("stop");
    at = performance.now();
  };
  button.addEventListener("pointerdown", stop);
  button.addEventListener("click", stop);
}
