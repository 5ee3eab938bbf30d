// Images that come live, for all panels of a page: a worker receives, decodes and draws them.
const ANSWER_MS = 20_000;
const worker = new Worker(new URL("images_worker.js", import.meta.url));
const panels = new Map(); // number -> its callback
const asked = new Map(); // number -> how to answer
let count = 0;

class Images extends EventTarget {
  topics = null; // those of the graph: [{topic, clouds, boxes, picks}]; null until they are known

  // A canvas on which images are drawn; `drawn(key, facts)` is called for each.
  attach(canvas, drawn) {
    const panel = ++count;
    const offscreen = canvas.transferControlToOffscreen();
    panels.set(panel, drawn);
    worker.postMessage({ panel, canvas: offscreen }, [offscreen]);
    return {
      show: (views) => worker.postMessage({ panel, views }),
      draw: (layout) => worker.postMessage({ panel, layout }),
      close() {
        panels.delete(panel);
        worker.postMessage({ panel, isGone: true });
      },
    };
  }

  // Values of the image of a view: "part", "line", "histogram", "png"; or "pick" a pixel.
  ask(key, what, at = []) {
    const number = ++count;
    worker.postMessage({ send: { ask: number, key, what, at } });
    return new Promise((resolve, reject) => {
      asked.set(number, { resolve, reject });
      setTimeout(() => asked.delete(number) && reject(new Error("no answer")), ANSWER_MS);
    });
  }
}

export const images = new Images();

worker.onmessage = ({ data }) => {
  if (data.topics) {
    images.topics = data.topics;
    images.dispatchEvent(new Event("topics"));
  } else if (data.isLost) {
    for (const { reject } of asked.values()) reject(new Error("connection lost"));
    asked.clear();
  } else if ("answer" in data) {
    const { resolve, reject } = asked.get(data.answer) ?? {};
    asked.delete(data.answer);
    if (data.problem) reject?.(new Error(data.problem));
    else resolve?.(data);
  } else panels.get(data.panel)?.(data.key, data.facts);
};
worker.postMessage({ address: `${location.origin.replace("http", "ws")}${rv.root}/live/images` });
