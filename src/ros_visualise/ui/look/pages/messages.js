// The newest message of a topic as a tree; opened branches stay open as values change.
const opened = new Set();
let held = false;

function branch(name, value, path, depth) {
  if (value === null || typeof value !== "object") {
    const line = element("div", "", "leaf number");
    line.append(element("span", name, "name"), element("span", String(value)));
    return line;
  }
  const list = Array.isArray(value) ? value : value.first;
  const plain = list && list.every((one) => typeof one !== "object");
  if (plain) {
    const more = Array.isArray(value) ? "" : `, ... of ${value.length}`;
    return branch(name, `[${list.join(", ")}${more}]`, path, depth);
  }
  const entries = list ? list.map((one, i) => [`[${i}]`, one]) : Object.entries(value);
  const box = element("details");
  const folded = depth > 1 && entries.length > 12;
  box.open = opened.has(path) || (!folded && !opened.has(`-${path}`));
  const count = list ? ` ${value.length} items` : "";
  const head = element("summary", name, "name");
  head.append(element("span", count, "dim"));
  box.append(head);
  box.ontoggle = () => { opened.delete(path); opened.delete(`-${path}`); opened.add(box.open ? path : `-${path}`); };
  if (box.open) entries.forEach(([key, one]) => box.append(branch(key, one, `${path}.${key}`, depth + 1)));
  else box.addEventListener("toggle", () => update().catch(() => {}), { once: true });
  return box;
}
async function update() {
  const topic = $("topic").value;
  const { message } = await (await ask("message", { topic })).json();
  if (topic !== $("topic").value || held) return;
  $("error").textContent = "";
  const entries = Object.entries(message);
  $("tree").replaceChildren(...entries.map(([key, one]) => branch(key, one, `${topic} ${key}`, 1)));
}
async function start() {
  addPages();
  const { topics } = await (await ask("topics")).json();
  for (const topic of Object.keys(topics)) $("topic").add(new Option(topic));
  if (parameter("topic") in topics) $("topic").value = parameter("topic");
  const choose = () => {
    remember({ topic: $("topic").value });
    $("type").textContent = topics[$("topic").value];
    $("tree").replaceChildren();
  };
  $("topic").onchange = choose;
  $("hold").onclick = () => $("hold").classList.toggle("on", held = !held);
  choose();
  for (;;) {
    const selecting = String(getSelection());
    if (!held && !document.hidden && !selecting) {
      await update().catch((error) => { $("error").textContent = error.message; });
    }
    await pause(250);
  }
}
start().catch((error) => { $("error").textContent = error.message; });
