// A recording as people see it: the waveform above, the mel spectrum below (low tones at the bottom).

const INK = getComputedStyle(document.documentElement);

export function drawWave(canvas, wave) {
  canvas.width = wave.length;
  canvas.height = 64;
  const context = canvas.getContext("2d");
  context.fillStyle = INK.getPropertyValue("--accent");
  const loudest = Math.max(0.05, ...wave.flat().map(Math.abs));
  wave.forEach(([low, high], x) => {
    const top = 32 - 31 * (high / loudest);
    const bottom = 32 - 31 * (low / loudest);
    context.fillRect(x, top, 1, Math.max(1, bottom - top));
  });
}

export function drawMel(canvas, mel) {
  const bands = mel[0]?.length ?? 1;
  canvas.width = Math.max(1, mel.length);
  canvas.height = bands;
  const context = canvas.getContext("2d");
  const image = context.createImageData(canvas.width, bands);
  mel.forEach((frame, x) => frame.forEach((shade, band) => {
    const at = 4 * ((bands - 1 - band) * canvas.width + x);
    const v = shade / 255;
    image.data[at] = 255 * Math.min(1, 1.5 * v * v);
    image.data[at + 1] = 255 * Math.min(1, 0.15 + 0.9 * v) * v;
    image.data[at + 2] = 255 * (0.25 + 0.35 * v) * (1 - 0.6 * v * v);
    image.data[at + 3] = 255;
  }));
  context.putImageData(image, 0, 0);
}
