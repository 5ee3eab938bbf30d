// The newest image of a topic and, to compare, another topic's of the same stamp.
const NONE = "None";
const state = { one: null, other: null, alone: "", held: false };
const stage = new Stage($("view"), describePointer);

function canvases() {
  const stretch = $("stretch").checked;
  const { one, other } = state;
  if (!other) return [{ picture: one, canvas: one.draw(stretch) }];
  if ($("mode").value === "wipe") {
    return [one, other].map((picture) => ({ picture, canvas: picture.draw(stretch) }));
  }
  const apart = difference(one, other);
  return [{ picture: apart, canvas: apart.draw(stretch) }];
}
function show() {
  if (!state.one) return;
  report(state.alone);
  try { stage.show(canvases()); } catch (error) { report(error.message); }
  const { width, height, encoding, stamp } = state.one;
  $("facts").textContent = `${width} × ${height} ${encoding}, ${Number(stamp) / 1e9} s${later()}`;
  $("range").textContent = drawHistogram($("histogram"), seen());
  describePointer();
}
const seen = () => stage.layers[0]?.picture || state.one;
function later() {  // how far the stamps are apart, where none is the same
  const apart = state.other ? Number(BigInt(state.other.stamp) - BigInt(state.one.stamp)) / 1e6 : 0;
  return apart ? `; the other ${Math.abs(apart)} ms ${apart > 0 ? "later" : "earlier"}` : "";
}
async function savePng() {  // a difference is made here: it is saved as it is shown
  if (seen() !== state.one)
    return stage.layers[0].canvas.toBlob((data) => save(data, "difference.png"));
  const { topic, stamp } = state.one;
  const answer = await ask("png", { topic, stamp });
  const [, name] = answer.headers.get("Content-Disposition").match(/filename="(.*)"/);
  return save(await answer.blob(), name);
}
function save(data, name) {
  const link = Object.assign(element("a"), { href: URL.createObjectURL(data), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 60_000);
}
function describe(picture, [x, y]) {
  const names = picture.names();
  const values = picture.at(x, y).map((value, i) => `${names[i] || ""} ${written(value)}`.trim());
  return `${picture.topic}\n${values.join("  ")}`;
}
function describePointer() {
  if (!state.one) return;
  const under = stage.under;
  const shown = [...new Set([state.one, state.other, seen()])].filter(Boolean);
  const inside = (picture) => under[0] < picture.width && under[1] < picture.height;
  $("value").textContent = under
    ? `x ${under[0]}, y ${under[1]}\n${shown.filter(inside).map((p) => describe(p, under)).join("\n")}`
    : "Hover over a pixel";
  $("along").hidden = !stage.line;
  if (stage.line) $("length").textContent = drawProfile($("profile"), seen(), stage.line);
}
function report(text) { $("error").textContent = text; }

async function fetchPicture(topic, values) {
  const answer = await ask("pixels", { topic, ...values });
  if (answer.status === 204) return null;
  return new Picture(topic, JSON.parse(answer.headers.get("X-Image")), await answer.arrayBuffer());
}
const fetchAt = (topic, { stamp }) => fetchPicture(topic, { stamp }).catch(() => null);
async function fetchPair(one, other) {  // of one stamp; nodes that are slow leave images out
  const isApart = state.other?.topic === other && state.other.stamp !== state.one.stamp;
  if (!isApart) {
    const beside = await fetchAt(other, one);
    if (beside) return [one, beside];
    const newest = await fetchPicture(other, {});
    const same = await fetchAt(one.topic, newest);
    if (same) return [same, newest];
  }  // else the nearest, as of two cameras
  return [one, await fetchPicture(other, { stamp: one.stamp, near: 1 })];
}
async function update() {
  const topic = $("topic").value;
  const other = $("other").value === NONE ? "" : $("other").value;
  const same = state.one?.topic === topic;
  let one = await fetchPicture(topic, { after: same ? state.one.stamp : undefined }) || state.one;
  let beside = state.other;
  let alone = "";
  if (!other) beside = null;
  else if (one !== state.one || beside?.topic !== other || beside.stamp !== one.stamp) {
    try { [one, beside] = await fetchPair(one, other); } catch (error) {
      [beside, alone] = [null, `${other}: ${error.message}`];
    }
  }
  if (topic !== $("topic").value || state.held) return;
  if (beside?.topic === state.other?.topic && beside?.stamp === state.other?.stamp) beside = state.other;
  const changed = one !== state.one || beside !== state.other || alone !== state.alone;
  Object.assign(state, { one, other: beside, alone });
  if (changed) show();
}
async function keepFresh() {
  for (;;) {
    if (!state.held && !document.hidden) await update().catch((error) => report(error.message));
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
  if (!images.length) return report("no image topics");
  $("topic").value = images.includes(parameter("topic")) ? parameter("topic") : images[0];
  $("other").value = images.includes(parameter("other")) ? parameter("other") : NONE;
  choose();
  $("topic").onchange = $("other").onchange = choose;
  $("mode").onchange = $("stretch").onchange = show;
  $("hold").onclick = hold;
  $("line").onclick = drawLine;
  $("png").onclick = () => state.one && savePng().catch((error) => report(error.message));
  $("fit").onclick = () => stage.fit();
  $("one").onclick = () => stage.exact();
  const keys = { h: hold, l: drawLine, f: () => stage.fit(), 1: () => stage.exact() };
  window.onkeydown = (event) => event.target.tagName !== "SELECT" && keys[event.key]?.();
  await keepFresh();
}
start().catch((error) => report(error.message));
