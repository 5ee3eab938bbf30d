// F6 gives the focus to the next part of the page, with Shift to the one before: a panel, the buttons
// of panels, the timeline. Among the buttons of panels, in menus and in lists arrow keys move it.
{
  const FOCUSABLE = "a[href], button:enabled, input:enabled, select:enabled, summary, textarea:enabled, [tabindex='0']";
  const isSeen = (element) => element.getClientRects().length > 0;
  const firstOf = (region) => [...region.querySelectorAll(FOCUSABLE)].find(isSeen);
  const regions = () => [...document.querySelectorAll(".rv-panel, .rv-rail, .rv-timeline")].filter((one) => isSeen(one) && firstOf(one));

  const next = (all, at, by) => all[(Math.max(at, by < 0 ? 0 : -1) + by + all.length) % all.length];
  const jump = (by) => {
    const all = regions();
    firstOf(next(all, all.findIndex((one) => one.contains(document.activeElement)), by))?.focus();
  };
  const step = (list, by) => {
    const all = [...list.querySelectorAll(FOCUSABLE)].filter(isSeen);
    if (all.length) next(all, all.indexOf(document.activeElement), by).focus();
  };
  document.addEventListener("keydown", (event) => {
    const list = event.target.closest?.(".rv-rail, .q-menu");
    const by = { ArrowUp: -1, ArrowDown: 1, ...(list?.matches(".rv-rail") && { ArrowLeft: -1, ArrowRight: 1 }) }[event.key];
    if (event.key === "F6" && !event.ctrlKey && !event.altKey) jump(event.shiftKey ? -1 : 1);
    else if (list && by && !event.target.matches("select, textarea, [type=range], [type=number]")) step(list, by);
    else return;
    event.preventDefault();
    event.stopImmediatePropagation(); // the timeline's arrow keys
  }, true);
}
