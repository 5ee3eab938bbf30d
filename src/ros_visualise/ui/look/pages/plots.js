// Numbers of any topics over the time that is played; a click goes there.
const NOTHING = "No topic has numbers to plot. A video has some only if it contains telemetry.";
const CHOOSE = "Choose a topic and some of its fields to plot them over the whole recording. Click the plot to seek.";
const MARGIN = { left: 62, right: 12, top: 10, bottom: 26 };
const state = {
  chosen: new URLSearchParams(location.search).getAll("field"),
  curves: [], position: 0, length: null, playing: false, plays: false, offers: true,
  from: 0, to: 0, fitted: true, pointer: null,
};
const color = (name) => COLORS[state.chosen.indexOf(name) % COLORS.length];

function span() {  // the seconds that are shown
  if (!state.fitted) return [state.from, state.to];
  const ends = (number) => state.curves.map((curve) => curve.times.at(number)).filter((time) => time !== undefined);
  const first = state.length === null ? Math.min(...ends(0)) : 0;  // what is live begins when it is looked at
  const last = Math.max(state.length ?? 0, state.position, ...ends(-1));
  const begin = Number.isFinite(first) ? first : 0;
  return [begin, Math.max(last, begin + 1)];
}
function area() {
  const { clientWidth: width, clientHeight: height } = $("plot");
  return { x: MARGIN.left, y: MARGIN.top, w: width - MARGIN.left - MARGIN.right,
    h: height - MARGIN.top - MARGIN.bottom };
}
const toX = (time) => area().x + (time - span()[0]) / (span()[1] - span()[0]) * area().w;
const toTime = (x) => span()[0] + (x - area().x) / area().w * (span()[1] - span()[0]);

function limits(curves) {
  let [low, high] = [Infinity, -Infinity];
  const [from, to] = span();
  for (const { times, values } of curves) {
    times.forEach((time, i) => {
      if (values[i] === null || time < from || time > to) return;
      low = Math.min(low, values[i]);
      high = Math.max(high, values[i]);
    });
  }
  if (low > high) [low, high] = [0, 1];
  const room = (high - low) * 0.05 || Math.abs(high) * 0.05 || 1;
  return [low - room, high + room];
}
function ticks(low, high, count) {
  const raw = (high - low) / count;
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((one) => one * power).find((one) => one >= raw);
  const found = [];
  for (let one = Math.ceil(low / step) * step; one <= high; one += step) found.push(one);
  return found.map((one) => Number(one.toPrecision(10)));
}
function draw() {
  const { context, width, height } = sheet($("plot"));
  const { x, y, w, h } = area();
  const shared = limits(state.curves);
  context.font = "11px system-ui, sans-serif";
  context.fillStyle = "#909296";
  context.strokeStyle = "#8883";
  context.beginPath();
  for (const time of ticks(...span(), Math.max(2, w / 110))) {
    context.moveTo(toX(time), y);
    context.lineTo(toX(time), y + h);
    context.textAlign = "center";
    context.fillText(`${time} s`, toX(time), height - 8);
  }
  if (!$("apart").checked) {
    for (const value of ticks(...shared, Math.max(2, h / 60))) {
      const up = y + h - (value - shared[0]) / (shared[1] - shared[0]) * h;
      context.moveTo(x, up);
      context.lineTo(x + w, up);
      context.textAlign = "right";
      context.fillText(String(value), x - 6, up + 4);
    }
  }
  context.stroke();
  context.save();
  context.beginPath();
  context.rect(x, y, w, h);
  context.clip();
  for (const curve of state.curves) {
    drawCurve(context, curve, $("apart").checked ? limits([curve]) : shared);
  }
  drawTime(context, state.position, "#fff", 1.5);
  if (state.pointer !== null) drawTime(context, state.pointer, "#fff6", 1);
  context.restore();
  drawLegend();
}
function drawCurve(context, { name, times, values }, [low, high]) {
  const { y, h } = area();
  context.strokeStyle = color(name);
  context.lineWidth = 1.5;
  context.beginPath();
  let pen = false;
  times.forEach((time, i) => {
    if (values[i] === null) { pen = false; return; }
    const place = [toX(time), y + h - (values[i] - low) / (high - low) * h];
    if (pen) context.lineTo(...place); else context.moveTo(...place);
    pen = true;
  });
  context.stroke();
  if (times.length === 1 && values[0] !== null) context.strokeRect(toX(times[0]) - 1, y + h / 2, 2, 2);
}
function drawTime(context, time, ink, wide) {
  const { y, h } = area();
  context.strokeStyle = ink;
  context.lineWidth = wide;
  context.beginPath();
  context.moveTo(toX(time), y);
  context.lineTo(toX(time), y + h);
  context.stroke();
}
function valueAt({ times, values }, time) {  // the last one until then
  let [low, high] = [0, times.length];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (times[middle] <= time) low = middle + 1; else high = middle;
  }
  return low ? values[low - 1] : null;
}
function drawLegend() {
  const time = state.pointer ?? state.position;
  const rows = state.chosen.map((name) => {
    const curve = state.curves.find((one) => one.name === name);
    const row = element("div");
    const mark = element("i");
    mark.style.background = color(name);
    const value = curve && valueAt(curve, time);
    const remove = element("button", "×");
    remove.title = "Remove";
    remove.onclick = () => choose(name, false);
    row.append(mark, element("span", name.replace(/[/_.:]/g, "$&\u200b")), element("b", value?.toPrecision(6) ?? "–", "number"), remove);
    return row;
  });
  $("hint").hidden = state.chosen.length > 0;
  $("hint").textContent = state.offers ? CHOOSE : NOTHING;
  if (rows.length) rows.push(element("div", `At ${time.toFixed(2)} s`, "dim number"));
  $("legend").replaceChildren(...rows);
}
function choose(name, on) {
  state.chosen = state.chosen.filter((one) => one !== name);
  if (on) state.chosen.push(name);
  const query = new URLSearchParams({ look: "plots" });
  state.chosen.forEach((one) => query.append("field", one));
  history.replaceState(null, "", `?${query}`);
  for (const box of $("fields").querySelectorAll("input")) box.checked = state.chosen.includes(box.value);
  update().catch(report);
}
async function fieldsOf(topic) {  // as soon as there is a message
  while (topic === $("topic").value) {
    try { return (await (await ask("fields", { topic })).json()).fields; } catch (error) {
      $("fields").replaceChildren(element("div", error.message, "dim"));
    }
    await pause(1000);
  }
}
async function offer() {
  const topic = $("topic").value;
  $("fields").replaceChildren(element("div", "Reading the fields...", "dim"));
  const fields = await fieldsOf(topic);
  if (topic !== $("topic").value) return;
  const rows = fields.map((path) => {
    const box = element("input");
    Object.assign(box, { type: "checkbox", value: `${topic}:${path}` });
    box.checked = state.chosen.includes(box.value);
    box.onchange = () => choose(box.value, box.checked);
    const row = element("label");
    row.append(box, element("span", path));
    return row;
  });
  $("fields").replaceChildren(...rows);
  filter();
}
function filter() {
  const words = $("search").value.toLowerCase().split(/\s+/);
  for (const row of $("fields").children) {
    row.hidden = !words.every((word) => row.textContent.toLowerCase().includes(word));
  }
}
async function update() {
  const [from, to] = state.fitted ? [0, 1e9] : [Math.max(0, state.from), Math.max(0, state.to)];
  const found = await (await ask("curves", { field: state.chosen, from, to })).json();
  Object.assign(state, found);
  const reading = state.curves.filter((curve) => curve.share !== null && curve.share < 1);
  $("reading").hidden = !reading.length;
  $("all").value = Math.min(1, ...reading.map((curve) => curve.share));
  $("play").textContent = state.playing ? "Pause" : "Play";
  report({ message: state.curves.map((curve) => curve.error).find(Boolean) || "" });
  draw();
}
function report(error) { $("error").textContent = error.message; }

async function play(values) {
  if (!state.plays) return;
  try { await ask("play", values); await update(); } catch (error) { report(error); }
}
function listen() {
  const canvas = $("plot");
  let start = null;
  canvas.onpointerdown = (event) => {
    canvas.setPointerCapture(event.pointerId);
    start = { x: event.offsetX, span: span(), moved: false };
  };
  canvas.onpointermove = (event) => {
    state.pointer = toTime(event.offsetX);
    if (start && Math.abs(event.offsetX - start.x) > 4) {
      start.moved = true;
      const shift = (start.x - event.offsetX) / area().w * (start.span[1] - start.span[0]);
      Object.assign(state, { fitted: false, from: start.span[0] + shift, to: start.span[1] + shift });
    }
    draw();
  };
  canvas.onpointerup = (event) => {
    if (start && !start.moved) play({ seek: Math.max(0, toTime(event.offsetX)).toFixed(6) });
    start = null;
  };
  canvas.onpointerleave = () => { state.pointer = null; draw(); };
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    const at = toTime(event.offsetX);
    const by = Math.exp(event.deltaY / 400);
    const [from, to] = span();
    Object.assign(state, { fitted: false, from: at - (at - from) * by, to: at + (to - at) * by });
    draw();
  }, { passive: false });
  new ResizeObserver(draw).observe(canvas);
}
async function start() {
  addPages();
  const { topics, plotted, plays } = await (await ask("topics")).json();
  Object.assign(state, { plays, offers: plotted.length > 0 });
  $("topic").hidden = $("search").hidden = $("expression").hidden = !state.offers;
  for (const topic of plotted) $("topic").add(new Option(`${topic} (${topics[topic]})`, topic));
  const first = state.chosen.find((name) => !name.startsWith("="))?.split(":").slice(0, -1).join(":");
  if (plotted.includes(first)) $("topic").value = first;
  $("topic").onchange = () => offer().catch(report);
  $("search").oninput = filter;
  $("expression").onchange = () => {
    const text = $("expression").value.trim();
    if (text && !state.chosen.includes(`=${text}`)) choose(`=${text}`, true);
    $("expression").value = "";
  };
  $("apart").onchange = draw;
  $("fit").onclick = () => { state.fitted = true; update().catch(report); };
  $("play").onclick = () => play({ toggle: 1 });
  $("play").hidden = !plays;
  window.onkeydown = (event) => {
    if (["search", "text"].includes(event.target.type)) return;
    if (event.key === " ") { event.preventDefault(); play({ toggle: 1 }); }
    if (event.key === "f") $("fit").click();
  };
  listen();
  if (plotted.length) offer().catch(report);
  for (;;) {
    if (!document.hidden) await update().catch(report);
    await pause(300);
  }
}
start().catch(report);
