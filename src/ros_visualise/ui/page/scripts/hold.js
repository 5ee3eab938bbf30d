// Buttons that act while they are held, by hand or by their key: <button data-hold="forward" data-key="i">.
// While any is held, the page sends "PRESS NUMBER NAME ..." again and again. Everything is released
// when the tab loses the focus, is hidden or left.
(() => {
  const PERIOD_MS = 100;
  const held = new Map(); // pointer or key -> what it holds
  let press = "";
  let number = 0;
  let timer = null;

  function send() {
    const names = [...new Set(held.values())];
    rv.send("hold", [press, ++number, ...names].join(" "));
    for (const button of document.querySelectorAll("[data-hold]"))
      button.classList.toggle("rv-held", names.includes(button.dataset.hold));
  }

  function hold(what, name) {
    if (held.get(what) === name) return;
    if (held.size === 0) {
      press = Math.random().toString(36).slice(2);
      timer = setInterval(send, PERIOD_MS);
    }
    held.set(what, name);
    send();
  }

  function release(what) {
    if (!held.delete(what)) return;
    if (held.size === 0) clearInterval(timer);
    send();
  }

  function releaseAll() {
    for (const what of [...held.keys()]) release(what);
  }

  const isTyping = (target) => target.closest?.("input, textarea, select, [contenteditable]");

  document.addEventListener("pointerdown", (event) => {
    const button = event.target.closest?.("[data-hold]");
    if (!button || event.button !== 0) return;
    event.preventDefault();
    document.activeElement?.blur(); // else keys would still be typed into a field
    hold(event.pointerId, button.dataset.hold);
  });
  for (const end of ["pointerup", "pointercancel"])
    window.addEventListener(end, (event) => release(event.pointerId), true);
  document.addEventListener("contextmenu", (event) => {
    if (event.target.closest?.("[data-hold]")) event.preventDefault(); // a long touch is none
  });
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.altKey || event.metaKey || isTyping(event.target)) return;
    const button = document.querySelector(`[data-key="${CSS.escape(event.key.toLowerCase())}"]`);
    if (button) hold(event.code, button.dataset.hold);
  });
  window.addEventListener("keyup", (event) => release(event.code), true);
  window.addEventListener("blur", releaseAll);
  window.addEventListener("pagehide", releaseAll);
  document.addEventListener("visibilitychange", () => document.hidden && releaseAll());
})();
