// The log of the nodes, the newest line last.
const LEVELS = ["DEBUG", "INFO", "WARNING", "ERROR", "CRITICAL"];
const lines = [];

function fits(line) {
  const words = $("search").value.toLowerCase();
  const loud = LEVELS.indexOf(line.level) >= LEVELS.indexOf($("level").value);
  return loud && `${line.node} ${line.text}`.toLowerCase().includes(words);
}
function row(line) {
  const made = element("div", "", `line ${line.level}`);
  made.append(
    element("span", new Date(1000 * line.time).toLocaleTimeString(), "dim number"),
    element("span", line.node, "dim"), element("span", line.text));
  return made;
}
function show() {
  const box = $("lines");
  const below = box.scrollHeight - box.scrollTop - box.clientHeight < 30;
  box.replaceChildren(...lines.filter(fits).map(row));
  if (below) box.scrollTop = box.scrollHeight;
}
async function start() {
  addPages();
  $("level").onchange = $("search").oninput = show;
  for (;;) {
    try {
      const after = lines.at(-1)?.number || 0;
      const { lines: more } = await (await ask("log", { after })).json();
      lines.push(...more);
      lines.splice(0, lines.length - 2000);
      if (more.length) show();
      $("error").textContent = "";
    } catch (error) { $("error").textContent = error.message; }
    await pause(1000);
  }
}
start();
