// Small pictures of an image's values: a histogram, and the values along a line.
import { written } from "./stage.js";

const INKS = { "": "currentColor", R: "#fa5252", G: "#40c057", B: "#339af0", A: "#868e96", 0: "#fa5252", 1: "#40c057", 2: "#339af0", 3: "#868e96" };
const ARRAYS = {
  uint8: Uint8Array, int8: Int8Array, uint16: Uint16Array, int16: Int16Array,
  int32: Int32Array, float32: Float32Array, float64: Float64Array,
};

export const valuesOf = ({ dtype, body }) => new ARRAYS[dtype](body);

// The values of a pixel as people read them; depth in metres.
export function described(values, { names, metres }) {
  return Array.from(values, (value, i) => {
    const isKnown = Number.isFinite(value) && value !== 0;
    const depth = metres && isKnown ? `${metres === 1 ? "" : ` (${value})`} m` : "";
    return `${names[i] ?? ""} ${written(depth ? value * metres : value)}${depth}`.trim();
  }).join(" ");
}

function sheet(canvas) {
  const ratio = devicePixelRatio || 1;
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  Object.assign(canvas, { width: width * ratio, height: height * ratio });
  const context = canvas.getContext("2d");
  context.scale(ratio, ratio);
  return { context, width, height, ink: getComputedStyle(canvas).color };
}

export function drawHistogram(canvas, { low, high, counts, names }) {
  const { context, width, height, ink } = sheet(canvas);
  const most = Math.max(1, ...counts.flatMap((one) => one.slice(1, -1)));
  counts.forEach((bins, channel) => {
    context.fillStyle = names[channel] === "" ? ink : INKS[names[channel]];
    context.globalAlpha = counts.length > 1 ? 0.6 : 0.9;
    const wide = width / bins.length;
    bins.forEach((count, i) => {
      const tall = Math.min(1, count / most) * height;
      context.fillRect(i * wide, height - tall, Math.max(wide, 1), tall);
    });
  });
  return `${written(low)} to ${written(high)}`;
}

export function drawLine(canvas, { names, at, length, ...answer }) {
  const { context, width, height, ink } = sheet(canvas);
  const values = valuesOf(answer);
  const known = Array.from(values).filter(Number.isFinite);
  const [low, high] = known.reduce(([a, b], value) => [Math.min(a, value), Math.max(b, value)], [Infinity, -Infinity]);
  names.forEach((name, channel) => {
    context.strokeStyle = name === "" ? ink : INKS[name];
    context.beginPath();
    at.forEach((place, i) => {
      const value = values[i * names.length + channel];
      const x = (place / Math.max(length, 1)) * width;
      const y = height - 2 - ((value - low) / Math.max(high - low, 1e-12)) * (height - 4);
      if (Number.isFinite(value)) context.lineTo(x, y);
    });
    context.stroke();
  });
  return `${length.toFixed(1)} pixels, ${known.length ? `${written(low)} to ${written(high)}` : "no values"}`;
}
