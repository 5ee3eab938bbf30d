// An image as it came: its values, and what of them is shown.
const ARRAYS = {
  uint8: Uint8Array, int8: Int8Array, uint16: Uint16Array, int16: Int16Array,
  int32: Int32Array, float32: Float32Array, float64: Float64Array,
};
class Picture {
  constructor(topic, facts, buffer) {
    Object.assign(this, facts);
    this.topic = topic;
    this.values = new ARRAYS[facts.dtype](buffer);
    const order = /^bgr/.test(facts.encoding) ? [2, 1, 0] : [0, 1, 2];
    this.order = this.channels >= 3 ? order : [0, 0, 0];
    this.full = { uint8: 255, uint16: 65535 }[facts.dtype] || 1;
  }
  at(x, y) {  // all channels of a pixel, as they came
    const start = (y * this.width + x) * this.channels;
    return Array.from(this.values.subarray(start, start + this.channels));
  }
  names() {
    if (this.measured || this.channels < 3) return this.channels > 1 ? ["0", "1", "2", "3"] : [""];
    return this.encoding.startsWith("bgr") ? ["B", "G", "R", "A"] : ["R", "G", "B", "A"];
  }
  isNone(value) {  // zero and NaN are not measurements
    return !Number.isFinite(value) || (this.measured && value === 0);
  }
  range() {  // from where to where the values go, without the outermost two percent
    if (this.limits) return this.limits;
    const step = Math.max(1, Math.floor(this.values.length / 40000));
    const some = [];
    for (let i = 0; i < this.values.length; i += step) {
      if (!this.isNone(this.values[i])) some.push(this.values[i]);
    }
    some.sort((a, b) => a - b);
    const pick = (share) => some[Math.min(some.length - 1, Math.floor(share * some.length))] ?? 0;
    return this.limits = [pick(0.02), pick(0.98)];
  }
  draw(stretch) {  // a canvas of the image's size; each way is drawn once
    this.drawn ||= {};
    if (this.drawn[stretch]) return this.drawn[stretch];
    const canvas = document.createElement("canvas");
    canvas.width = this.width;
    canvas.height = this.height;
    const context = canvas.getContext("2d");
    const data = context.createImageData(this.width, this.height);
    this.paint(data.data, stretch);
    context.putImageData(data, 0, 0);
    return this.drawn[stretch] = canvas;
  }
  paint(out, stretch) {
    const [low, high] = stretch || this.measured ? this.range() : [0, this.full];
    const scale = 255 / Math.max(high - low, 1e-12);
    const { values, channels, order } = this;
    const colored = this.measured && channels === 1;
    for (let from = 0, to = 0; from < values.length; from += channels, to += 4) {
      out[to + 3] = 255;
      if (colored) {
        if (!this.isNone(values[from])) turbo((values[from] - low) * scale / 255, out, to);
        continue;
      }
      for (let k = 0; k < 3; k++) out[to + k] = (values[from + order[k]] - low) * scale + 0.5;
    }
  }
  bins(count = 256) {  // for each channel how many values are in each part of the range
    if (this.counted) return this.counted;
    let [low, high] = [0, this.full];
    if (this.measured) {
      [low, high] = [Infinity, -Infinity];
      for (const value of this.values) {
        if (this.isNone(value)) continue;
        if (value < low) low = value;
        if (value > high) high = value;
      }
      if (low > high) [low, high] = [0, 1];
    }
    const all = Array.from({ length: this.channels }, () => new Float64Array(count));
    const scale = count / Math.max(high - low + (this.dtype.includes("int") ? 1 : 1e-12), 1e-12);
    for (let i = 0; i < this.values.length; i++) {
      const value = this.values[i];
      if (!this.isNone(value)) {
        all[i % this.channels][Math.min(count - 1, Math.floor((value - low) * scale))]++;
      }
    }
    return this.counted = { low, high, all };
  }
}
// Turbo, an improved rainbow (A. Mikhailov, 2019), by its polynomial.
function turbo(x, out, to) {
  x = Math.min(1, Math.max(0, x));
  const poly = (c) => c.reduceRight((sum, one) => sum * x + one, 0);
  out[to] = 255 * poly([0.13572138, 4.6153926, -42.66032258, 132.13108234, -152.94239396, 59.28637943]);
  out[to + 1] = 255 * poly([0.09140261, 2.19418839, 4.84296658, -14.18503333, 4.27729857, 2.82956604]);
  out[to + 2] = 255 * poly([0.1066733, 12.64194608, -60.58204836, 110.36276771, -89.90310912, 27.34824973]);
}
function difference(one, other) {  // a picture of the values' difference; of unlike ones, of what is shown
  if (one.width !== other.width || one.height !== other.height) {
    throw new Error("the images differ in size; choose Wipe");
  }
  if (one.measured !== other.measured) {
    throw new Error("measurements and gray levels cannot be subtracted; choose Wipe");
  }
  const alike = one.channels === other.channels && one.dtype === other.dtype;
  return alike ? subtract(one, other) : subtract(asShown(one), asShown(other));
}
function subtract(one, other) {
  const { width, height, channels, dtype, encoding, measured, stamp } = one;
  const made = one.values.slice();
  const turned = channels >= 3 && one.order[0] !== other.order[0];  // RGB and BGR
  for (let i = 0; i < made.length; i++) {
    const channel = i % channels;
    const value = other.values[turned && channel < 3 ? i - channel + 2 - channel : i];
    const none = one.isNone(made[i]) || other.isNone(value);
    made[i] = none ? NaN : Math.abs(made[i] - value);  // of whole numbers NaN is 0
  }
  return new Picture("difference", { width, height, channels, dtype, encoding, measured, stamp }, made.buffer);
}
function asShown(picture) {
  const { width, height, stamp } = picture;
  const { data } = picture.draw(false).getContext("2d").getImageData(0, 0, width, height);
  const facts = { width, height, channels: 4, dtype: "uint8", encoding: "rgba8", measured: false, stamp };
  return new Picture(picture.topic, facts, new Uint8Array(data).buffer);
}
const written = (value) => Number.isInteger(value) || !Number.isFinite(value)
  ? String(value) : value.toPrecision(5);
