// Uploads files that are dropped on the page or chosen by data-upload: each over a connection of its
// own, in pieces. The first of several is opened once all are there. Links with data-download fetch
// recordings, in pieces too, so that the server holds no whole file in memory.
(() => {
  const PIECE = 60_000;
  const MOST_WAITING = 4_000_000; // bytes that are sent ahead
  const DOWNLOAD = "application/octet-stream";

  async function upload(file, opens) {
    const values = { upload: file.name, size: file.size, open: opens };
    const address = new URL(location.href);
    address.protocol = address.protocol.replace("http", "ws");
    address.hash = "";
    address.search = new URLSearchParams(values);
    const socket = new WebSocket(address);
    const ended = new Promise((end) => (socket.onclose = socket.onerror = end));
    await Promise.race([new Promise((open) => (socket.onopen = open)), ended]);
    const isOpen = () => socket.readyState === WebSocket.OPEN;
    try {
      for (let at = 0; at < file.size && isOpen(); at += PIECE) {
        socket.send(await file.slice(at, at + PIECE).arrayBuffer());
        while (socket.bufferedAmount > MOST_WAITING && isOpen())
          await new Promise((wake) => setTimeout(wake, 20));
      }
    } catch {
      socket.close(); // unreadable, as a folder: the program reports the failure
    }
    await ended;
  }

  async function uploadAll(files) {
    const [first, ...others] = files;
    for (const file of others) await upload(file, "");
    if (first) await upload(first, first.name);
  }

  async function download(link) {
    const name = decodeURIComponent(link.dataset.download);
    const pieces = [];
    for (let at = 0, size = 1; at < size; at += pieces.at(-1).size) {
      const query = new URLSearchParams({ ask: "recorded", name, from: at });
      const answer = await fetch(`?${query}`, { headers: { "X-Ros-Visualise": "1" } });
      if (!answer.ok) return;
      size = Number(answer.headers.get("X-Size"));
      pieces.push(await answer.blob());
      link.textContent = `${name} (${Math.floor((100 * at) / size)} %)`;
    }
    link.textContent = name;
    const saved = document.createElement("a");
    saved.href = URL.createObjectURL(new Blob(pieces, { type: DOWNLOAD }));
    saved.download = name;
    saved.click();
    setTimeout(() => URL.revokeObjectURL(saved.href), 60_000);
  }

  const input = () => (rv.isViewer ? null : document.querySelector("input[data-upload]"));
  const isDropped = (event) => input() && event.dataTransfer?.types.includes("Files");

  window.addEventListener("dragover", (event) => isDropped(event) && event.preventDefault());
  window.addEventListener("drop", (event) => {
    if (!isDropped(event)) return;
    event.preventDefault();
    uploadAll([...event.dataTransfer.files]);
  });
  document.addEventListener("change", (event) => {
    if (!event.target.matches?.("input[data-upload]")) return;
    uploadAll([...event.target.files]);
    event.target.value = "";
  });
  document.addEventListener("click", (event) => {
    const link = event.target.closest?.("a[data-download]");
    if (!link) return;
    event.preventDefault();
    download(link);
  });
})();
