// Histogram and line profile.
const INKS = { "": "#dee2e6", R: "#ff6b6b", G: "#69db7c", B: "#4dabf7", A: "#868e96",
  0: "#ff6b6b", 1: "#69db7c", 2: "#4dabf7", 3: "#868e96" };
function sheet(canvas) {  // a context in pixels of the screen, cleared
  const scale = window.devicePixelRatio || 1;
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  canvas.width = width * scale;
  canvas.height = height * scale;
  const context = canvas.getContext("2d");
  context.scale(scale, scale);
  return { context, width, height };
}
function drawHistogram(canvas, picture) {
  const { context, width, height } = sheet(canvas);
  const { low, high, all } = picture.bins();
  const names = picture.names();
  let most = 1;
  for (const bins of all) for (let i = 1; i < bins.length - 1; i++) most = Math.max(most, bins[i]);
  context.globalCompositeOperation = "lighter";
  all.forEach((bins, channel) => {
    context.fillStyle = INKS[names[channel]];
    context.globalAlpha = all.length > 1 ? 0.6 : 0.9;
    const wide = width / bins.length;
    bins.forEach((count, i) => {
      const tall = Math.min(1, count / most) * height;
      context.fillRect(i * wide, height - tall, Math.max(wide, 1), tall);
    });
  });
  return `${written(low)} to ${written(high)}`;
}
function samples(picture, line) {  // values along a line, one a pixel
  const [[x0, y0], [x1, y1]] = line;
  const count = Math.max(2, Math.ceil(Math.hypot(x1 - x0, y1 - y0)) + 1);
  const found = [];
  for (let i = 0; i < count; i++) {
    const x = Math.floor(x0 + (x1 - x0) * i / (count - 1));
    const y = Math.floor(y0 + (y1 - y0) * i / (count - 1));
    if (x >= 0 && y >= 0 && x < picture.width && y < picture.height) found.push(picture.at(x, y));
  }
  return found;
}
function drawProfile(canvas, picture, line) {
  const { context, width, height } = sheet(canvas);
  const found = samples(picture, line);
  const all = found.flat().filter((value) => !picture.isNone(value));
  let [low, high] = picture.measured ? [Infinity, -Infinity] : [0, picture.full];
  if (picture.measured) for (const v of all) { low = Math.min(low, v); high = Math.max(high, v); }
  picture.names().slice(0, picture.channels).forEach((name, channel) => {
    context.strokeStyle = INKS[name];
    context.beginPath();
    found.forEach((values, i) => {
      const x = i * width / Math.max(1, found.length - 1);
      const y = height - 2 - (values[channel] - low) / Math.max(high - low, 1e-12) * (height - 4);
      if (picture.isNone(values[channel])) context.moveTo(x, height); else context.lineTo(x, y);
    });
    context.stroke();
  });
  return `${found.length} pixels, ${all.length ? `${written(low)} to ${written(high)}` : "no values"}`;
}
