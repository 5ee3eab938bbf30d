// Queries to the program, with a header that no other site can send; and what all pages use.
const $ = (id) => document.getElementById(id);
async function ask(what, values = {}) {
  const query = new URLSearchParams({ ask: what });
  for (const [name, value] of Object.entries(values)) {
    for (const one of [value].flat()) if (one !== undefined && one !== null) query.append(name, one);
  }
  const answer = await fetch(`?${query}`, { headers: { "X-Ros-Visualise": "1" } });
  if (!answer.ok) {
    const body = await answer.json().catch(() => ({}));
    throw new Error(body.error || `the program replied with status ${answer.status}`);
  }
  return answer;
}
const parameter = (name) => new URLSearchParams(location.search).get(name) || "";
const remember = (values) => {
  const query = new URLSearchParams(location.search);
  for (const [name, value] of Object.entries(values)) {
    if (value) query.set(name, value); else query.delete(name);
  }
  history.replaceState(null, "", `?${query}`);
};
const element = (name, text = "", classes = "") => {
  const made = document.createElement(name);
  made.textContent = text;
  made.className = classes;
  return made;
};
const pause = (ms) => new Promise((done) => setTimeout(done, ms));
function addPages() {
  const nav = document.querySelector("nav");
  const here = parameter("look");
  for (const page of ["plots", "messages", "log", "diagnostics"]) {
    const link = element("a", page[0].toUpperCase() + page.slice(1), page === here ? "here" : "");
    link.href = `?look=${page}`;
    nav.append(link);
  }
}
