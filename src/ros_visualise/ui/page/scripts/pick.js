// Choosing a pixel: a click on an image with <i data-pick="node"> over it is sent as
// "NODE ACROSS DOWN", fractions of the image's width and height. The image is as wide and as high as
// fits into its canvas, in the middle.
document.addEventListener("click", ({ target, clientX, clientY }) => {
  const over = target.closest?.("[data-pick]");
  for (const image of over ? document.querySelectorAll("[data-images]") : []) {
    const box = image.firstChild.getBoundingClientRect();
    const size = [Number(image.dataset.width), Number(image.dataset.height)];
    const scale = Math.min(box.width / size[0], box.height / size[1]);
    const [width, height] = size.map((side) => scale * side);
    const across = (clientX - box.left - (box.width - width) / 2) / width;
    const down = (clientY - box.top - (box.height - height) / 2) / height;
    if (Math.min(across, down) >= 0 && Math.max(across, down) < 1)
      rv.send("pick", [over.dataset.pick, across.toFixed(5), down.toFixed(5)].join(" "));
  }
});
