// The worker of images.js: one WebSocket for all images of a page. The program hears of each image
// that was drawn, and sends no more than two ahead.
const RETRY_MS = 1000;
const panels = new Map(); // number -> {panel, canvas, context, size, images}
const waiting = new Map(); // panel -> the newest image that is not drawn yet
let address = "";
let socket = null;

function send(message) {
  if (socket?.readyState === WebSocket.OPEN) socket.send(JSON.stringify(message));
}

function tell() {
  const show = {};
  for (const { panel, size } of panels.values()) if (size) show[panel] = Math.max(size, show[panel] ?? 0);
  send({ show });
}

function connect() {
  socket = new WebSocket(address);
  socket.binaryType = "arraybuffer";
  socket.onopen = tell;
  socket.onclose = () => setTimeout(connect, RETRY_MS);
  socket.onmessage = ({ data }) => {
    const length = new DataView(data).getUint16(0, true);
    const panel = new TextDecoder().decode(new Uint8Array(data, 2, length));
    const isBusy = waiting.has(panel);
    waiting.set(panel, new Uint8Array(data, 2 + length));
    if (!isBusy) draw(panel);
  };
}

async function draw(panel) {
  for (let image; (image = waiting.get(panel)); ) {
    const bitmap = await createImageBitmap(new Blob([image], { type: "image/jpeg" })).catch(() => null);
    for (const [number, one] of bitmap ? panels : []) {
      if (one.panel !== panel) continue;
      const { canvas, context } = one;
      if (canvas.width !== bitmap.width || canvas.height !== bitmap.height)
        Object.assign(canvas, { width: bitmap.width, height: bitmap.height });
      context.drawImage(bitmap, 0, 0);
      postMessage({ number, width: bitmap.width, height: bitmap.height, images: ++one.images });
    }
    bitmap?.close();
    send({ got: panel });
    if (waiting.get(panel) === image) waiting.delete(panel);
  }
}

onmessage = ({ data }) => {
  if (data.address) {
    address = data.address;
    connect();
    return;
  }
  if (data.isGone) panels.delete(data.number);
  else if (data.canvas) panels.set(data.number, { ...data, context: data.canvas.getContext("2d"), size: 0, images: 0 });
  else if (panels.has(data.number)) panels.get(data.number).size = data.size;
  tell();
};
