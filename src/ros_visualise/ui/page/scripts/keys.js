// Keys of the timeline, which is in the page around this one. They come before viser's own.
window.addEventListener(
  "keydown",
  (event) => {
    if (parent === window || !parent.rvKey?.(event)) return;
    event.preventDefault();
    event.stopImmediatePropagation();
  },
  true,
);
