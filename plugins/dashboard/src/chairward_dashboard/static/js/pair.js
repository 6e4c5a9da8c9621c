import { dress, looks } from "./looks.js";
import { speak, text } from "./texts.js";

dress();
await speak(looks.language || navigator.language.slice(0, 2));
if (location.search === "?wrong") document.getElementById("wrong").textContent = text("pair.wrong");
