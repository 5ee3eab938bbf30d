// One pane of a plot, drawn by ECharts: its ticks, its zoom, its way to SVG.
import { echarts } from "nicegui-echart";

const LEAST_S = 1e-6; // of the shown time
const AXES = 4; // that are shown
const FEW = 8; // pixels between samples that are marked
const STEPS = [5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200, 21600, 86400]; // of long times, seconds
const isCoarse = matchMedia("(pointer: coarse)").matches;

export function clock(seconds) {
  const whole = Math.floor((Math.abs(seconds) + 5e-10) / 60);
  const rest = Number(Math.max(Math.abs(seconds) - 60 * whole, 0).toFixed(9));
  const two = (value) => (value < 10 ? `0${value}` : String(value));
  const minutes = whole < 60 ? whole : `${Math.floor(whole / 60)}:${two(whole % 60)}`;
  return `${seconds < 0 ? "-" : ""}${minutes}:${two(rest)}`;
}

// A number at an axis, which ECharts has rounded to its step.
const written = (value) => (value && Math.abs(value) < 1e-3 ? Number(value.toPrecision(10)).toExponential() : String(value));

// A message in binary: its header, and rows of numbers.
export function unpacked(data) {
  const length = new DataView(data).getUint32(0, true);
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(data, 4, length)));
  return { header, rows: new Float64Array(data, 4 + length) };
}

// The window as it can be shown, within numbers that differ.
export function readable(window) {
  if (!Array.isArray(window) || window.length !== 2 || !window.every((end) => Number.isFinite(end) && Math.abs(end) < 1e9)) return null;
  const [from, to] = [Math.min(...window), Math.max(...window)];
  return to - from >= LEAST_S ? [from, to] : [from, from + LEAST_S];
}

// Pale colours are darkened on a light page.
export function inked(color, isDark) {
  if (isDark) return color;
  const parts = color.match(/\w\w/g).map((part) => Math.round(parseInt(part, 16) * 0.72));
  return `rgb(${parts})`;
}

// The units of the axes of a pane.
export function axesOf({ own }, curves) {
  const units = curves.map((one) => one.unit);
  return own ? units : [...new Set(units)];
}

// pane: {kind, own, y}; curves: [{name, color, unit, width, rows}]; extent, window: [from, to]; axes: those of the
// pane with the most, so that the same time is at the same place in all.
function optionOf({ pane, curves, extent, window, marks, x, isDark, axes: most }, width, height) {
  const isTime = pane.kind === "time";
  const ink = isDark ? "#ddd" : "#333";
  const line = isDark ? "#ffffff1c" : "#0000001c";
  const axes = axesOf(pane, curves);
  const colors = curves.map((one) => inked(one.color, isDark));
  const axisLabel = { color: ink, fontSize: 10, hideOverlap: true };
  const axisLine = { show: true, onZero: false, lineStyle: { color: line } };
  const yAxis = (axes.length ? axes : [""]).map((unit, i) => ({
    type: "value",
    scale: true,
    splitNumber: Math.max(1, Math.min(5, Math.floor(height / 32))),
    show: i < AXES,
    name: unit,
    nameGap: 5,
    nameTextStyle: { color: ink, fontSize: 10 },
    position: i % 2 ? "right" : "left",
    offset: 46 * Math.floor(i / 2),
    axisLabel: { ...axisLabel, formatter: written, color: pane.own ? colors[i] : ink },
    axisLine,
    splitLine: { show: i === 0, lineStyle: { color: line } },
  }));
  const shownAxes = Math.min(most, AXES);
  const parts = Math.max(2, Math.floor(width / 110));
  const [from, to] = window;
  const xAxis = {
    type: "value",
    interval: isTime && to - from > 60 ? STEPS.find((step) => step * parts >= to - from) : undefined,
    min: isTime ? extent[0] : undefined,
    max: isTime ? extent[1] : undefined,
    scale: true,
    name: isTime ? "" : x,
    nameLocation: "middle",
    nameGap: 20,
    nameTextStyle: { color: ink, fontSize: 10 },
    splitNumber: parts,
    axisLabel: isTime ? { ...axisLabel, formatter: clock, showMaxLabel: false } : { ...axisLabel, formatter: written },
    axisLine,
    splitLine: { lineStyle: { color: line } },
  };
  const [start, end] = pane.y ?? [0, 100];
  const inside = { type: "inside", filterMode: "none", throttle: 30, preventDefaultMouseMove: false };
  const move = isCoarse || "shift";
  const markLine = isTime && marks.length && {
    silent: true,
    symbol: "none",
    animation: false,
    lineStyle: { color: ink, type: "dashed" },
    label: { color: ink, fontSize: 10, formatter: ({ name }) => name, position: "insideEndTop" },
    data: marks.map(([at, name]) => ({ xAxis: at, name })),
  };
  return {
    animation: false,
    color: colors,
    grid: { left: 50 + 46 * Math.floor((shownAxes - 1) / 2), right: shownAxes > 1 ? 6 + 46 * Math.floor(shownAxes / 2) : 14, top: 18, bottom: isTime ? 20 : 34 },
    xAxis,
    yAxis,
    toolbox: { itemSize: 0, feature: { dataZoom: { yAxisIndex: "none", filterMode: "none", brushStyle: { color: "#4dabf733", borderWidth: 0 } } } },
    dataZoom: [
      { ...inside, id: "x", xAxisIndex: 0, zoomOnMouseWheel: true, moveOnMouseMove: move, minValueSpan: isTime ? LEAST_S : undefined,
        ...(isTime ? { rangeMode: ["value", "value"], startValue: window[0], endValue: window[1] } : { start: pane.x?.[0] ?? 0, end: pane.x?.[1] ?? 100 }) },
      { ...inside, id: "y", yAxisIndex: yAxis.map((_, i) => i), zoomOnMouseWheel: "ctrl", moveOnMouseMove: move === true ? false : move, start, end },
    ],
    series: curves.map(({ name, unit, rows, width: columns }, i) => ({
      type: "line",
      id: name,
      name: unit ? `${name} [${unit}]` : name,
      yAxisIndex: pane.own ? i : axes.indexOf(unit),
      data: rows,
      dimensions: ["x", "y", "t"].slice(0, columns),
      encode: { x: 0, y: 1 },
      showSymbol: isTime ? rows.length / columns < width / FEW : rows.length === columns,
      symbolSize: 4,
      lineStyle: { width: 1.5 },
      emphasis: { disabled: true },
      silent: true,
      markLine: i ? undefined : markLine || { data: [] },
    })),
  };
}

export class PaneChart {
  // on: {zoom(kind, range), seek(time), point(time or null), fit()}
  constructor(element, on) {
    this.element = element;
    this.on = on;
    this.chart = echarts.init(element);
    this.chart.on("datazoom", () => this.zoomed());
    const zr = this.chart.getZr();
    zr.on("mousemove", (event) => on.point(this.timeAt(event)));
    zr.on("globalout", () => on.point(null));
    zr.on("click", (event) => this.clicked(event));
    zr.on("dblclick", () => on.fit());
    // A drag with Shift moves what is shown; any other chooses a part of the time.
    element.addEventListener("pointerdown", ({ shiftKey }) => shiftKey && this.choose(false), true);
    element.addEventListener("pointerup", () => this.choose(true), true);
    this.sized = new ResizeObserver(() => {
      this.chart.resize();
      on.sized();
    });
    this.sized.observe(element);
  }
  close() {
    this.sized.disconnect();
    this.chart.dispose();
  }
  choose(isOn) {
    if (!isCoarse && this.shown?.pane.kind === "time") this.chart.dispatchAction({ type: "takeGlobalCursor", key: "dataZoomSelect", dataZoomSelectActive: isOn });
  }
  draw(shown) {
    this.shown = shown;
    const option = optionOf(shown, this.element.clientWidth, this.element.clientHeight);
    this.chart.setOption(option, { replaceMerge: ["series", "yAxis"] });
    if (!this.isChoosing) this.choose((this.isChoosing = true));
  }
  zoomed() {
    const [x, y] = this.chart.getOption().dataZoom;
    const isTime = this.shown.pane.kind === "time";
    const [start, end] = this.shown.pane.y ?? [0, 100];
    if (y.start !== start || y.end !== end) this.on.zoom("y", [y.start, y.end]);
    if (isTime) {
      const [from, to] = this.shown.window;
      if (x.startValue !== from || x.endValue !== to) this.on.zoom("time", [x.startValue, x.endValue]);
    } else if (x.start !== (this.shown.pane.x?.[0] ?? 0) || x.end !== (this.shown.pane.x?.[1] ?? 100)) this.on.zoom("x", [x.start, x.end]);
  }
  // By keys: {startValue, endValue} of the time.
  show([startValue, endValue]) {
    this.chart.dispatchAction({ type: "dataZoom", dataZoomId: "x", startValue, endValue });
  }
  rowAt({ offsetX, offsetY }) {
    let [found, least] = [null, 30];
    for (const { rows, width } of this.shown.curves) {
      for (let i = 0; i < rows.length; i += width) {
        const [x, y] = this.chart.convertToPixel({ gridIndex: 0 }, [rows[i], rows[i + 1]]);
        const away = Math.hypot(x - offsetX, y - offsetY);
        if (away < least) [found, least] = [rows[i + 2], away];
      }
    }
    return found;
  }
  timeAt(event) {
    const point = [event.offsetX, event.offsetY];
    if (this.shown?.pane.kind !== "time" || !this.chart.containPixel("grid", point)) return null;
    return this.chart.convertFromPixel({ xAxisIndex: 0 }, event.offsetX);
  }
  clicked(event) {
    const time = this.shown?.pane.kind === "xy" ? this.rowAt(event) : this.timeAt(event);
    if (time !== null && time !== undefined) this.on.seek(time);
  }
  // Where a time is in this pane, in pixels: [x] or, of one curve against another, [x, y]; or null.
  placeOf(time) {
    if (time === null || !this.shown?.curves.length) return null;
    if (this.shown.pane.kind === "time") {
      const x = this.chart.convertToPixel({ xAxisIndex: 0 }, time);
      return this.chart.containPixel("grid", [x, this.element.clientHeight / 2]) ? [x] : null;
    }
    const [{ rows, width }] = this.shown.curves;
    if (this.shown.pane.kind !== "xy" || !rows.length) return null;
    let at = 0;
    for (let i = 0; i < rows.length && rows[i + 2] <= time; i += width) at = i;
    return this.chart.convertToPixel({ gridIndex: 0 }, [rows[at], rows[at + 1]]);
  }
  // The pane alone, with the names of its curves, on a page of this colour.
  svg(width, height) {
    const page = echarts.init(null, null, { renderer: "svg", ssr: true, width, height });
    const option = optionOf({ ...this.shown, isDark: false }, width, height);
    option.grid.top = 40;
    page.setOption({ ...option, toolbox: undefined, legend: { top: 2, icon: "rect", itemHeight: 3, textStyle: { fontSize: 11 } } });
    const text = page.renderToSVGString();
    page.dispose();
    return text;
  }
}

// A histogram (rows of both edges of a bin and its count), or a line.
export class BarChart {
  constructor(element) {
    this.element = element;
    this.chart = echarts.init(element);
    this.sized = new ResizeObserver(() => this.chart.resize());
    this.sized.observe(element);
  }
  close() {
    this.sized.disconnect();
    this.chart.dispose();
  }
  draw(rows, width, unit) {
    const isDark = document.body.classList.contains("body--dark");
    const [ink, line] = [isDark ? "#ddd" : "#333", isDark ? "#ffffff1c" : "#0000001c"];
    const points = [];
    for (let i = 0; i < rows.length; i += width) points.push(...(width === 3 ? [[rows[i], rows[i + 2]], [rows[i + 1], rows[i + 2]]] : [[rows[i], rows[i + 1]]]));
    const axis = { type: "value", scale: true, axisLabel: { color: ink, fontSize: 10, hideOverlap: true }, splitLine: { lineStyle: { color: line } } };
    this.chart.setOption({
      animation: false,
      grid: { left: 50, right: 20, top: 10, bottom: 20 },
      xAxis: { ...axis, min: "dataMin", max: "dataMax", axisLabel: width === 3 ? { ...axis.axisLabel, formatter: `{value} ${unit}` } : { ...axis.axisLabel, formatter: clock } },
      yAxis: { ...axis, min: 0 },
      series: [{ type: "line", data: points, showSymbol: false, silent: true, lineStyle: { width: 1.5 }, color: "#4dabf7", areaStyle: width === 3 ? { opacity: 0.4 } : undefined }],
    });
  }
}

// Panes below one another in one picture.
export function svgOf(charts, width, height) {
  const parts = charts.map((chart, i) => chart.svg(width, height).replace("<svg ", `<svg y="${i * height}" `));
  const size = `width="${width}" height="${height * charts.length}"`;
  return `<svg xmlns="http://www.w3.org/2000/svg" ${size}><rect ${size} fill="white"/>${parts.join("")}</svg>`;
}

export async function pngOf(svg) {
  const picture = new Image();
  picture.src = URL.createObjectURL(new Blob([svg], { type: "image/svg+xml" }));
  await picture.decode();
  const canvas = Object.assign(document.createElement("canvas"), { width: 2 * picture.width, height: 2 * picture.height });
  canvas.getContext("2d").drawImage(picture, 0, 0, canvas.width, canvas.height);
  URL.revokeObjectURL(picture.src);
  return new Promise((done) => canvas.toBlob(done, "image/png"));
}
