// Diagnostics of the nodes, the worst first; opened entries stay open.
const LEVELS = ["OK", "WARN", "ERROR", "STALE"];
const STALE_S = 5;
const opened = new Set();
const shown = { statuses: [], live: false };

function levelOf(status) {  // stale: a live one without news
  return shown.live && status.age > STALE_S ? LEVELS.length - 1 : status.level;
}
function fits(status) {
  const words = $("search").value.toLowerCase();
  return levelOf(status) >= LEVELS.indexOf($("level").value)
    && `${status.name} ${status.message}`.toLowerCase().includes(words);
}
function row(status) {
  const level = LEVELS[levelOf(status)];
  const box = element("details", "", level);
  const head = element("summary");
  head.append(element("b", level), element("span", status.name), element("span", ` ${status.message}`, "dim"));
  const table = element("table", "", "number");
  for (const [name, value] of status.values) {
    const line = element("tr");
    line.append(element("td", name, "dim"), element("td", value));
    table.append(line);
  }
  box.append(head, table);
  box.open = opened.has(status.name);
  box.ontoggle = () => { if (box.open) opened.add(status.name); else opened.delete(status.name); };
  return box;
}
function show() {
  const counts = LEVELS.map((name, level) => [name, shown.statuses.filter((one) => levelOf(one) === level).length]);
  $("count").textContent = counts.filter(([, count]) => count).map((one) => one.join(" ")).join(", ");
  const rows = shown.statuses.filter(fits);
  rows.sort((one, other) => levelOf(other) - levelOf(one) || one.name.localeCompare(other.name));
  $("statuses").replaceChildren(...rows.map(row));
  if (!shown.statuses.length) $("statuses").append(element("div", "No diagnostics yet", "dim"));
}
async function start() {
  addPages();
  $("level").onchange = $("search").oninput = show;
  for (;;) {
    try {
      if (!document.hidden && !String(getSelection())) {
        Object.assign(shown, await (await ask("diagnostics")).json());
        show();
      }
      $("error").textContent = "";
    } catch (error) { $("error").textContent = error.message; }
    await pause(1000);
  }
}
start();
