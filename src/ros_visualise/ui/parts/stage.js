// Where images are on a canvas: zoom, pan, cells side by side, the wipe, and what is drawn over them.
const NUMBERS_FROM = 30; // screen pixels for one of the image
const MOST = 200;
const LEAST = 0.5; // of the size that fits
const CLICK = 4; // pixels that a click may move
const HANDLE = 12;
const KEY_ZOOM = 1.25;
const KEY_PAN = 40; // pixels

export const written = (value) =>
  Number.isInteger(value) || !Number.isFinite(value) ? String(value) : value.toPrecision(5);

export class Stage {
  // `changed()` is called when the view has changed, `pointed()` when the pointer or the line has
  // moved, `picked(cell, across, down)` for a click.
  constructor(canvas, { changed, pointed, picked }) {
    Object.assign(this, { canvas, changed, pointed, picked });
    this.sizes = [[16, 9]]; // of the images, width and height
    this.names = []; // of the images, where they are written
    this.isWipe = false;
    this.view = null; // {zoom, x, y}: times what fits, and the image's point in the middle; null: fit
    this.share = 0.5; // where the wipe is
    this.line = null; // its ends in pixels of the image
    this.isDrawing = false;
    this.numbers = null; // values of a part of the first image
    this.pointers = new Map();
    for (const [name, handle] of [["pointerdown", "down"], ["pointermove", "move"], ["pointerup", "up"], ["pointercancel", "up"]])
      canvas.addEventListener(name, (event) => this[handle](event));
    canvas.addEventListener("pointerleave", () => { this.at = null; this.pointed(); });
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.zoom(Math.exp(-event.deltaY / 400), event.offsetX, event.offsetY);
    }, { passive: false });
    canvas.addEventListener("dblclick", () => this.fit());
    canvas.addEventListener("keydown", (event) => this.press(event));
  }
  get width() { return this.canvas.clientWidth || 1; }
  get height() { return this.canvas.clientHeight || 1; }
  // The cells in which images are shown, as many as images: those that make the images largest.
  get cells() {
    const { width, height } = this;
    if (this.isWipe || this.sizes.length < 2) return this.sizes.map(() => [0, 0, width, height]);
    const count = this.sizes.length;
    const [w, h] = this.sizes[0];
    const scale = (columns) => Math.min(width / columns / w, height / Math.ceil(count / columns) / h);
    const columns = Array.from({ length: count }, (_, i) => i + 1).reduce((best, one) => (scale(one) > scale(best) ? one : best));
    const [wide, high] = [width / columns, height / Math.ceil(count / columns)];
    return this.sizes.map((_, i) => [(i % columns) * wide, Math.floor(i / columns) * high, wide, high]);
  }
  // Screen pixels for one of the image in a cell, and where the image's corner is.
  place(number) {
    const [x, y, w, h] = this.cells[number];
    const [width, height] = this.sizes[number];
    const { zoom, x: across, y: down } = this.view ?? { zoom: 1, x: 0.5, y: 0.5 };
    const scale = Math.min(w / width, h / height) * zoom;
    return { scale, left: x + w / 2 - across * width * scale, top: y + h / 2 - down * height * scale };
  }
  cellAt(x, y) {
    if (this.isWipe && this.sizes.length > 1) return x < this.width * this.share ? 0 : 1;
    return Math.max(0, this.cells.findIndex(([left, top, w, h]) => x >= left && x < left + w && y >= top && y < top + h));
  }
  // A point of the screen in pixels of the image of a cell.
  pixel(x, y, number = this.cellAt(x, y)) {
    const { scale, left, top } = this.place(number);
    return [(x - left) / scale, (y - top) / scale];
  }
  // The pixel under the pointer and its cell, if there is one.
  get under() {
    if (!this.at) return null;
    const number = this.cellAt(...this.at);
    const [x, y] = this.pixel(...this.at, number).map(Math.floor);
    const [w, h] = this.sizes[number];
    return x >= 0 && y >= 0 && x < w && y < h ? { number, x, y } : null;
  }
  // Where each image is to be drawn, in pixels of the canvas: `place` is null while it just fits.
  layout(ratio) {
    const inPixels = (box) => box.map((value) => value * ratio);
    return this.cells.map(([x, y, w, h], number) => {
      const { scale, left, top } = this.place(number);
      const [width, height] = this.sizes[number];
      const from = this.isWipe && number ? this.width * this.share : x;
      const clip = inPixels([from, y, w - (from - x), h]);
      return { clip, cell: inPixels([x, y, w, h]), place: this.view && inPixels([left, top, width * scale, height * scale]) };
    });
  }
  // The part of an image that is seen: left, top, width, height in pixels.
  part(number = 0) {
    const [x, y, w, h] = this.cells[number];
    const [left, top] = this.pixel(x, y, number).map(Math.floor);
    const [right, bottom] = this.pixel(x + w, y + h, number).map(Math.ceil);
    const [width, height] = this.sizes[number];
    const from = [Math.max(0, left), Math.max(0, top)];
    return [...from, Math.min(right, width) - from[0], Math.min(bottom, height) - from[1]];
  }
  get showsNumbers() { return !this.isWipe && this.sizes.length === 1 && this.place(0).scale >= NUMBERS_FROM; }
  fit() { this.set(null); }
  exact() {
    const { scale } = this.place(0);
    this.zoom(1 / devicePixelRatio / scale, this.width / 2, this.height / 2);
  }
  set(view) {
    this.view = view && Math.abs(view.zoom - 1) < 1e-3 && view.x === 0.5 && view.y === 0.5 ? null : view;
    this.changed();
  }
  zoom(by, x, y) {
    const number = this.cellAt(x, y);
    const [left, top, w, h] = this.cells[number];
    const [width, height] = this.sizes[number];
    const { zoom } = this.view ?? { zoom: 1 };
    const { scale } = this.place(number);
    const after = Math.min((MOST / scale) * zoom, Math.max(LEAST, zoom * by));
    const [px, py] = this.pixel(x, y, number);
    const now = (scale * after) / zoom;
    this.set({ zoom: after, x: (px - (x - left - w / 2) / now) / width, y: (py - (y - top - h / 2) / now) / height });
    this.pointed();
  }
  pan(right, down) {
    const { scale } = this.place(0);
    const [width, height] = this.sizes[0];
    const { zoom, x, y } = this.view ?? { zoom: 1, x: 0.5, y: 0.5 };
    const within = (value) => Math.min(1, Math.max(0, value));
    this.set({ zoom, x: within(x - right / scale / width), y: within(y - down / scale / height) });
  }
  down(event) {
    if (event.button) return;
    this.canvas.setPointerCapture(event.pointerId);
    const place = [event.offsetX, event.offsetY];
    this.pointers.set(event.pointerId, place);
    this.at = this.from = place;
    this.isWiping = this.isWipe && this.sizes.length > 1 && Math.abs(place[0] - this.width * this.share) < HANDLE;
    this.isLining = !this.isWiping && (this.isDrawing || event.shiftKey);
    if (this.isLining) this.line = [this.pixel(...place, 0), this.pixel(...place, 0)];
    this.pointed();
  }
  move(event) {
    const place = [event.offsetX, event.offsetY];
    const before = this.pointers.get(event.pointerId);
    this.at = place;
    if (before) {
      if (this.from && Math.hypot(place[0] - this.from[0], place[1] - this.from[1]) > CLICK) this.from = null;
      if (this.pointers.size > 1) this.pinch(event.pointerId, place);
      else if (this.isWiping) this.wipe(place[0] / this.width);
      else if (this.isLining) this.line[1] = this.pixel(...place, 0);
      else if (!this.from) this.pan(place[0] - before[0], place[1] - before[1]);
      if (!this.from || this.isLining || this.isWiping) this.pointers.set(event.pointerId, place);
    }
    this.pointed();
  }
  up(event) {
    const isClick = this.from && this.pointers.size === 1 && !this.isLining && !this.isWiping && event.type === "pointerup";
    this.pointers.delete(event.pointerId);
    this.from = null;
    this.isLining = this.isWiping = false;
    if (isClick && this.under) {
      const { number } = this.under;
      const [x, y] = this.pixel(...this.at, number);
      this.picked(number, x / this.sizes[number][0], y / this.sizes[number][1]);
    }
  }
  wipe(share) {
    this.share = Math.min(1, Math.max(0, share));
    this.changed();
  }
  pinch(id, place) {
    const [other] = [...this.pointers].filter(([one]) => one !== id).map(([, where]) => where);
    const before = this.pointers.get(id);
    const away = (p) => Math.hypot(p[0] - other[0], p[1] - other[1]) || 1;
    this.from = null;
    this.zoom(away(place) / away(before), other[0], other[1]);
  }
  press(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const middle = [this.width / 2, this.height / 2];
    const moves = { ArrowLeft: [1, 0], ArrowRight: [-1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
    if (event.key === "+" || event.key === "=") this.zoom(KEY_ZOOM, ...middle);
    else if (event.key === "-") this.zoom(1 / KEY_ZOOM, ...middle);
    else if (event.key === "0") this.fit();
    else if (event.key === "1") this.exact();
    else if (moves && event.shiftKey && this.isWipe) this.wipe(this.share - 0.02 * moves[0]);
    else if (moves && this.view) this.pan(...moves.map((one) => one * KEY_PAN));
    else return;
    event.preventDefault();
    event.stopPropagation();
  }
  draw() {
    const ratio = devicePixelRatio || 1;
    const { canvas, width, height } = this;
    const context = canvas.getContext("2d");
    if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio))
      [canvas.width, canvas.height] = [width, height].map((side) => Math.round(side * ratio));
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, width, height);
    if (this.showsNumbers && this.numbers) this.drawNumbers(context);
    this.drawNames(context);
    if (this.isWipe && this.sizes.length > 1) {
      const x = width * this.share;
      this.stroke(context, [[x, 0], [x, height]]);
      this.stroke(context, [[x - 5, height / 2 - 6], [x - 10, height / 2], [x - 5, height / 2 + 6]]);
      this.stroke(context, [[x + 5, height / 2 - 6], [x + 10, height / 2], [x + 5, height / 2 + 6]]);
    }
    if (this.line) {
      const { scale, left, top } = this.place(0);
      this.stroke(context, this.line.map(([x, y]) => [left + x * scale, top + y * scale]));
    }
  }
  drawNames(context) {
    Object.assign(context, { font: "12px system-ui, sans-serif", textAlign: "left", textBaseline: "top", fillStyle: "#fff", strokeStyle: "#000b", lineWidth: 3 });
    this.names.slice(0, this.sizes.length).forEach((name, i) => {
      const [x, y] = this.cells[i];
      const left = this.isWipe && i ? this.width * this.share : x;
      context.strokeText(name, left + 6, y + 5);
      context.fillText(name, left + 6, y + 5);
    });
  }
  stroke(context, places) {
    for (const [ink, wide] of [["#000a", 4], ["#fff", 1.5]]) {
      Object.assign(context, { strokeStyle: ink, lineWidth: wide });
      context.beginPath();
      places.forEach((place) => context.lineTo(...place));
      context.stroke();
    }
  }
  drawNumbers(context) {
    const { x: left, y: top, width, height, values, names } = this.numbers;
    Object.assign(context, { textAlign: "center", textBaseline: "middle", lineWidth: 3, strokeStyle: "#000b", fillStyle: "#fff" });
    const place = this.place(0);
    for (let i = 0; i < width * height; i++) {
      const [x, y] = [left + (i % width), top + Math.floor(i / width)];
      const lines = Array.from(values.subarray(i * names.length, (i + 1) * names.length), written);
      const longest = Math.max(...lines.map((text) => text.length));
      const size = Math.min(18, place.scale / (lines.length + 0.4), (1.6 * place.scale) / longest);
      if (size < 6) return;
      context.font = `${size}px ui-monospace, monospace`;
      lines.forEach((text, n) => {
        const at = [place.left + (x + 0.5) * place.scale, place.top + (y + 0.5) * place.scale + (n - (lines.length - 1) / 2) * size];
        context.strokeText(text, ...at);
        context.fillText(text, ...at);
      });
    }
  }
}
