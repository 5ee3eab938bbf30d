// The stage: zoom, pan, wipe, the line, and the numbers of pixels that are large enough.
const NUMBERS_FROM = 30;  // pixels of the screen for one of the image
class Stage {
  constructor(canvas, changed) {
    this.canvas = canvas;
    this.changed = changed;  // called when the pointer or the line has moved
    this.scale = 0;  // 0: fit
    this.x = this.y = 0;  // of the image's corner on the screen
    this.share = 0.5;  // where the wipe is
    this.layers = [];
    this.line = null;
    this.drawing = false;
    this.pointers = new Map();
    canvas.addEventListener("pointerdown", (event) => this.down(event));
    canvas.addEventListener("pointermove", (event) => this.move(event));
    for (const name of ["pointerup", "pointercancel"]) {
      canvas.addEventListener(name, (event) => this.up(event));
    }
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.zoom(Math.exp(-event.deltaY / 400), event.offsetX, event.offsetY);
    }, { passive: false });
    canvas.addEventListener("dblclick", (event) => this.zoom(4, event.offsetX, event.offsetY));
    new ResizeObserver(() => this.draw()).observe(canvas);
  }
  get size() { return this.layers.length ? [this.layers[0].picture.width, this.layers[0].picture.height] : [1, 1]; }
  show(layers) {  // [{picture, canvas}], the second one right of the wipe
    this.layers = layers;
    this.draw();
  }
  fit() { this.scale = 0; this.draw(); }
  exact() {
    const [w, h] = this.size;
    this.scale = 1 / (window.devicePixelRatio || 1);
    this.x = (this.canvas.clientWidth - w * this.scale) / 2;
    this.y = (this.canvas.clientHeight - h * this.scale) / 2;
    this.draw();
  }
  place() {
    if (this.scale) return;
    const [w, h] = this.size;
    this.fitted = Math.min(this.canvas.clientWidth / w, this.canvas.clientHeight / h);
    this.x = (this.canvas.clientWidth - w * this.fitted) / 2;
    this.y = (this.canvas.clientHeight - h * this.fitted) / 2;
  }
  get now() { return this.scale || this.fitted; }
  zoom(by, x, y) {
    const before = this.now;
    const after = Math.min(200, Math.max(this.fitted * 0.5 || 0.01, before * by));
    this.x = x - (x - this.x) * after / before;
    this.y = y - (y - this.y) * after / before;
    this.scale = after;
    this.draw();
    this.changed();
  }
  pixel(x, y) { return [(x - this.x) / this.now, (y - this.y) / this.now]; }
  get under() {  // the pixel under the pointer, if there is one
    if (!this.at) return null;
    const [x, y] = this.pixel(...this.at).map(Math.floor);
    const [w, h] = this.size;
    return x >= 0 && y >= 0 && x < w && y < h ? [x, y] : null;
  }
  down(event) {
    this.canvas.setPointerCapture(event.pointerId);
    const place = [event.offsetX, event.offsetY];
    this.pointers.set(event.pointerId, place);
    this.at = place;
    const edge = this.canvas.clientWidth * this.share;
    this.wiping = this.layers.length > 1 && Math.abs(event.offsetX - edge) < 14;
    if (!this.wiping && (this.drawing || event.shiftKey)) {
      this.drags = true;
      this.line = [this.pixel(...place), this.pixel(...place)];
    }
    this.changed();
  }
  move(event) {
    const place = [event.offsetX, event.offsetY];
    const before = this.pointers.get(event.pointerId);
    this.at = place;
    if (before) {
      if (this.pointers.size > 1) this.pinch(event.pointerId, place);
      else if (this.wiping) this.share = Math.min(1, Math.max(0, place[0] / this.canvas.clientWidth));
      else if (this.drags) this.line[1] = this.pixel(...place);
      else {
        this.scale = this.now;
        this.x += place[0] - before[0];
        this.y += place[1] - before[1];
      }
      this.pointers.set(event.pointerId, place);
      this.draw();
    }
    this.changed();
  }
  pinch(id, place) {
    const [other] = [...this.pointers].filter(([one]) => one !== id).map(([, where]) => where);
    const before = this.pointers.get(id);
    const away = (p) => Math.hypot(p[0] - other[0], p[1] - other[1]) || 1;
    this.zoom(away(place) / away(before), other[0], other[1]);
  }
  up(event) {
    this.pointers.delete(event.pointerId);
    this.drags = this.wiping = false;
  }
  draw() {
    if (!this.layers.length) return;
    this.place();
    const { context, width, height } = sheet(this.canvas);
    context.imageSmoothingEnabled = this.now < 1;
    const [w, h] = this.size;
    this.layers.forEach(({ canvas }, number) => {
      context.save();
      if (number) {
        context.beginPath();
        context.rect(width * this.share, 0, width, height);
        context.clip();
      }
      context.drawImage(canvas, this.x, this.y, w * this.now, h * this.now);
      context.restore();
    });
    if (this.now >= NUMBERS_FROM) this.drawNumbers(context, width, height);
    if (this.layers.length > 1) this.stroke(context, [[width * this.share, 0], [width * this.share, height]]);
    if (this.line) {
      this.stroke(context, this.line.map(([x, y]) => [this.x + x * this.now, this.y + y * this.now]));
    }
  }
  stroke(context, places) {
    for (const [ink, wide] of [["#000a", 4], ["#fff", 1.5]]) {
      context.strokeStyle = ink;
      context.lineWidth = wide;
      context.beginPath();
      places.forEach((place) => context.lineTo(...place));
      context.stroke();
    }
  }
  drawNumbers(context, width, height) {
    const { picture } = this.layers[0];
    const [left, top] = this.pixel(0, 0).map((v) => Math.max(0, Math.floor(v)));
    const [right, bottom] = this.pixel(width, height).map(Math.ceil);
    context.textAlign = "center";
    context.textBaseline = "middle";
    for (let y = top; y < Math.min(bottom, picture.height); y++) {
      for (let x = left; x < Math.min(right, picture.width); x++) {
        this.drawNumber(context, picture, x, y);
      }
    }
  }
  drawNumber(context, picture, x, y) {
    const lines = picture.at(x, y).map(written);
    const longest = Math.max(...lines.map((line) => line.length));
    const size = Math.min(18, this.now / (lines.length + 0.4), 1.6 * this.now / longest);
    if (size < 6) return;
    context.font = `${size}px ui-monospace, monospace`;
    const middle = [this.x + (x + 0.5) * this.now, this.y + (y + 0.5) * this.now];
    lines.forEach((line, i) => {
      const down = middle[1] + (i - (lines.length - 1) / 2) * size;
      context.lineWidth = 3;
      context.strokeStyle = "#000b";
      context.strokeText(line, middle[0], down);
      context.fillStyle = "#fff";
      context.fillText(line, middle[0], down);
    });
  }
}
