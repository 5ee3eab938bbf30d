// Images that come live: each <div data-image="PANEL"> gets a canvas. A worker receives, decodes and
// draws, so that neither waits for what else the page does.
(() => {
  const root = location.pathname.replace(/\/(viser)?$/, "");
  const worker = new Worker(`${root}/parts/images_worker.js`);
  const shown = new Map(); // number -> its element
  let count = 0;

  const sized = new ResizeObserver((entries) => {
    for (const { target, contentRect } of entries) {
      const size = Math.ceil(Math.max(contentRect.width, contentRect.height) * devicePixelRatio);
      worker.postMessage({ number: Number(target.dataset.number), size });
    }
  });

  function attach(element) {
    const canvas = document.createElement("canvas");
    canvas.width = 16;
    canvas.height = 9;
    element.dataset.number = ++count;
    element.replaceChildren(canvas);
    shown.set(count, element);
    const offscreen = canvas.transferControlToOffscreen();
    worker.postMessage({ number: count, panel: element.dataset.image, canvas: offscreen }, [offscreen]);
    sized.observe(element);
  }

  function look() {
    for (const [number, element] of shown) {
      if (element.isConnected) continue;
      shown.delete(number);
      sized.unobserve(element);
      worker.postMessage({ number, isGone: true });
    }
    for (const element of document.querySelectorAll("[data-image]:not([data-number])")) attach(element);
  }

  worker.onmessage = ({ data: { number, width, height, images } }) => {
    const element = shown.get(number);
    if (element) Object.assign(element.dataset, { width, height, images });
  };
  const address = `${location.origin.replace("http", "ws")}${root}/live/images`;
  worker.postMessage({ address });
  const begin = () => {
    new MutationObserver(look).observe(document.body, { childList: true, subtree: true });
    look();
  };
  if (document.body) begin();
  else document.addEventListener("DOMContentLoaded", begin);
})();
