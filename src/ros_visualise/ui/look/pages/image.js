// Which images are shown: the newest of a topic and, with it, that of another of the same stamp.
const $ = (id) => document.getElementById(id);
const NONE = "nothing";
const state = { one: null, other: null, held: false };
const stage = new Stage($("view"), tell);

function canvases() {
  const stretch = $("stretch").checked;
  const { one, other } = state;
  if (!other) return [{ picture: one, canvas: one.draw(stretch) }];
  if ($("mode").value === "wipe") {
    return [one, other].map((picture) => ({ picture, canvas: picture.draw(stretch) }));
  }
  if (one.width !== other.width || one.height !== other.height) {
    throw new Error("images of two sizes have no difference; take wipe");
  }
  return [{ picture: one, canvas: difference(one, other, stretch) }];
}
function show() {
  if (!state.one) return;
  say("");
  try { stage.show(canvases()); } catch (error) { say(error.message); }
  const { width, height, encoding, stamp, topic } = state.one;
  $("facts").textContent = `${width} × ${height} ${encoding}, ${Number(stamp) / 1e9} s`;
  $("range").textContent = drawHistogram($("histogram"), state.one);
  $("png").href = `?${new URLSearchParams({ ask: "png", topic, stamp })}`;
  tell();
}
function describe(picture, [x, y]) {
  const names = picture.names();
  const values = picture.at(x, y).map((value, i) => `${names[i] || ""} ${written(value)}`.trim());
  return `${picture.topic}\n${values.join("  ")}`;
}
function tell() {
  if (!state.one) return;
  const under = stage.under;
  const shown = [state.one, state.other].filter(Boolean);
  const inside = (picture) => under[0] < picture.width && under[1] < picture.height;
  $("value").textContent = under
    ? `x ${under[0]}, y ${under[1]}\n${shown.filter(inside).map((p) => describe(p, under)).join("\n")}`
    : "point at a pixel";
  $("along").hidden = !stage.line;
  if (stage.line) $("length").textContent = drawProfile($("profile"), state.one, stage.line);
}
function say(text) { $("said").textContent = text; }

async function fetchPicture(topic, values) {
  const answer = await ask("pixels", { topic, ...values });
  if (answer.status === 204) return null;
  return new Picture(topic, JSON.parse(answer.headers.get("X-Image")), await answer.arrayBuffer());
}
async function fetchPair(one, other) {  // of one stamp; nodes that are slow leave images out
  try {
    return [one, await fetchPicture(other, { stamp: one.stamp })];
  } catch {
    const beside = await fetchPicture(other, {});
    return [await fetchPicture(one.topic, { stamp: beside.stamp }), beside];
  }
}
async function update() {
  const topic = $("topic").value;
  const other = $("other").value === NONE ? "" : $("other").value;
  const same = state.one?.topic === topic;
  let one = await fetchPicture(topic, { after: same ? state.one.stamp : undefined }) || state.one;
  let beside = state.other;
  if (!other) beside = null;
  else if (one !== state.one || beside?.topic !== other) [one, beside] = await fetchPair(one, other);
  const isNew = one !== state.one;
  if (topic !== $("topic").value || state.held) return;
  const changed = isNew || beside !== state.other;
  Object.assign(state, { one, other: beside });
  if (changed) show();
}
async function keepFresh() {
  for (;;) {
    if (!state.held && !document.hidden) await update().catch((error) => say(error.message));
    await pause(150);
  }
}
function hold() {
  state.held = !state.held;
  $("hold").classList.toggle("on", state.held);
}
function drawLine() {
  stage.drawing = !stage.drawing;
  $("line").classList.toggle("on", stage.drawing);
}
function choose() {
  const other = $("other").value === NONE ? "" : $("other").value;
  $("modes").hidden = !other;
  document.title = $("topic").value;
  remember({ topic: $("topic").value, other });
  state.one = state.other = null;
  if (state.held) hold();
}
async function start() {
  addPages();
  const { images } = await (await ask("topics")).json();
  images.forEach((topic) => { $("topic").add(new Option(topic)); });
  [NONE, ...images].forEach((topic) => { $("other").add(new Option(topic)); });
  if (!images.length) return say("there are no images here");
  $("topic").value = images.includes(asked("topic")) ? asked("topic") : images[0];
  $("other").value = images.includes(asked("other")) ? asked("other") : NONE;
  choose();
  $("topic").onchange = $("other").onchange = choose;
  $("mode").onchange = $("stretch").onchange = show;
  $("hold").onclick = hold;
  $("line").onclick = drawLine;
  $("fit").onclick = () => stage.fit();
  $("one").onclick = () => stage.exact();
  const keys = { h: hold, l: drawLine, f: () => stage.fit(), 1: () => stage.exact() };
  window.onkeydown = (event) => event.target.tagName !== "SELECT" && keys[event.key]?.();
  await keepFresh();
}
start().catch((error) => say(error.message));
