// The worker of images.js: one WebSocket for all images of a page, which it decodes and draws, so that
// neither waits for what else the page does. The program hears of each image that was drawn, and sends
// no more than two ahead.
const RETRY_MS = 1000;
const KEPT = 4; // images of a topic that is compared, among which those of one stamp are looked for
const APART_MS = 500; // without a common stamp, the newest of each are drawn
const SMOOTH = 3; // pixels of the screen for one of the image, up to which they are blended
const panels = new Map(); // number -> {canvas, context, views, layout}
const images = new Map(); // key -> its newest images, the newest last: {facts, bitmap}
const waiting = new Map(); // key -> the newest image that is not decoded yet
let address = "";
let socket = null;

function send(message) {
  if (socket?.readyState === WebSocket.OPEN) socket.send(JSON.stringify(message));
}

// Ask for what all panels show; each has keys of its own.
function tell() {
  const show = Object.assign({}, ...[...panels.values()].map(({ views }) => views));
  for (const key of images.keys()) if (!(key in show)) forget(key);
  send({ show });
}

function forget(key) {
  for (const { bitmap } of images.get(key) ?? []) bitmap?.close();
  images.delete(key);
}

function connect() {
  socket = new WebSocket(address);
  socket.binaryType = "arraybuffer";
  socket.onopen = tell;
  socket.onclose = () => {
    postMessage({ isLost: true });
    setTimeout(connect, RETRY_MS);
  };
  socket.onmessage = ({ data }) => {
    if (typeof data === "string") return postMessage(JSON.parse(data));
    const length = new DataView(data).getUint32(0, true);
    const facts = JSON.parse(new TextDecoder().decode(new Uint8Array(data, 4, length)));
    if ("answer" in facts) {
      const body = data.slice(4 + length);
      return postMessage({ ...facts, body }, [body]);
    }
    const isBusy = waiting.has(facts.key);
    waiting.set(facts.key, { facts, jpeg: new Uint8Array(data, 4 + length) });
    if (!isBusy) decode(facts.key);
  };
}

async function decode(key) {
  for (let image; (image = waiting.get(key)); ) {
    const { facts, jpeg } = image;
    const bitmap = await createImageBitmap(new Blob([jpeg], { type: "image/jpeg" })).catch(() => null);
    if (facts.problem || bitmap) put(key, facts, bitmap);
    send({ got: key });
    if (waiting.get(key) === image) waiting.delete(key);
  }
}

function put(key, facts, bitmap) {
  const [number, panel] = [...panels].find(([, { views }]) => key in views) ?? [];
  if (!panel) return bitmap?.close();
  if (bitmap) {
    const kept = images.get(key) ?? [];
    images.set(key, kept);
    kept.push({ facts, bitmap });
    while (kept.length > (Object.keys(panel.views).length > 1 ? KEPT : 1)) kept.shift().bitmap.close();
    choose(panel);
    draw(panel);
  }
  postMessage({ panel: number, key, facts });
}

// Choose the images of a panel: of one stamp, or the newest of each where they have none in common.
function choose(panel) {
  const all = Object.keys(panel.views).map((key) => images.get(key) ?? []);
  const newest = all.map((kept) => kept.at(-1));
  if (all.length > 1 && newest.every(Boolean)) {
    const first = all[0].findLast(({ facts }) => all.every((kept) => kept.some((one) => one.facts.stamp === facts.stamp)));
    const isNewer = first && BigInt(first.facts.stamp) >= BigInt(panel.stamp ?? first.facts.stamp);
    const isSought = panel.matched && newest.every(({ facts }) => BigInt(facts.stamp) < BigInt(panel.stamp));
    if (first && (isNewer || isSought)) {
      panel.stamp = first.facts.stamp;
      panel.matched = performance.now();
      panel.chosen = all.map((kept) => kept.findLast((one) => one.facts.stamp === panel.stamp));
      return;
    }
    if (panel.matched && performance.now() - panel.matched < APART_MS) return;
    panel.stamp = undefined;
  }
  panel.chosen = newest;
}

function draw({ canvas, context, views, layout, chosen }) {
  if (!layout || !chosen) return;
  const { width, height, layers } = layout;
  if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
  else context.clearRect(0, 0, width, height);
  layers.forEach(({ key, clip, cell, place }) => {
    const image = chosen[Object.keys(views).indexOf(key)];
    if (!image || !images.get(key)?.includes(image)) return;
    const [x, y, w, h] = place ?? fitted(image.facts, cell);
    context.save();
    context.beginPath();
    context.rect(...clip);
    context.clip();
    context.imageSmoothingEnabled = w < SMOOTH * image.facts.width;
    context.drawImage(image.bitmap, x, y, w, h);
    context.restore();
  });
}

// The place of an image whose size was not known yet: as large as fits.
function fitted({ width, height }, [x, y, w, h]) {
  const scale = Math.min(w / width, h / height);
  return [x + (w - width * scale) / 2, y + (h - height * scale) / 2, width * scale, height * scale];
}

onmessage = ({ data }) => {
  const panel = panels.get(data.panel);
  if (data.address) {
    address = data.address;
    connect();
  } else if (data.canvas) {
    panels.set(data.panel, { canvas: data.canvas, context: data.canvas.getContext("2d"), views: {} });
  } else if (data.isGone) {
    panels.delete(data.panel);
    tell();
  } else if (data.send) {
    send(data.send);
  } else if (panel) {
    Object.assign(panel, { layout: data.layout ?? panel.layout, views: data.views ?? panel.views });
    if (data.views) {
      tell();
      choose(panel);
      Object.keys(panel.views).forEach((key, i) => {
        if (panel.chosen?.[i]) postMessage({ panel: data.panel, key, facts: panel.chosen[i].facts });
      });
    }
    draw(panel);
  }
};
