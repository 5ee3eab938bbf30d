// Read-only (rv.isViewer): a badge says so, and all controls are disabled.
if (rv.isViewer) {
  const CONTROLS = [".mantine-Slider-root", ".mantine-Checkbox-root", ".mantine-Input-wrapper",
    ".mantine-Button-root", ".mantine-NumberInput-controls", "[data-pick]"];
  const BADGE = `position: fixed; z-index: 1000; top: 6px; left: 50%; transform: translateX(-50%);
    padding: .15em .9em; border-radius: 1em; background: #f08c00; color: #fff; pointer-events: none;
    font: 600 .85rem sans-serif`;

  const style = document.createElement("style");
  style.textContent = `:is(${CONTROLS}) { pointer-events: none !important; opacity: .65; }`;
  document.head.append(style);
  document.addEventListener("focusin", ({ target }) => target.closest(`:is(${CONTROLS})`) && target.blur());
  document.addEventListener("DOMContentLoaded", () => {
    const badge = document.createElement("div");
    badge.className = "rv-read-only";
    badge.style.cssText = BADGE;
    badge.textContent = "Read-only";
    document.body.append(badge);
  });
}
