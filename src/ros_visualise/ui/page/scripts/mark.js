// The keys [ and ]: viser's own commands have no such keys.
document.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.repeat) return; // on some keyboards they need Alt
  if (event.target.closest?.("input, textarea, select, [contenteditable]")) return;
  if (event.key === "[" || event.key === "]") rv.send("mark", event.key);
});
