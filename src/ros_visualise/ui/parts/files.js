// Uploads files that are dropped anywhere on the page, or given to rv.upload: each over a connection of its
// own, in pieces. The first of several is opened once all are there.
(() => {
  const PIECE = 60_000;
  const MOST_WAITING = 4_000_000; // bytes that are sent ahead

  async function upload(file, opens) {
    const query = new URLSearchParams({ upload: file.name, size: file.size, open: opens });
    const socket = new WebSocket(`${location.origin.replace("http", "ws")}${rv.root}/?${query}`);
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

  rv.upload = async (files) => {
    const [first, ...others] = files;
    for (const file of others) await upload(file, "");
    if (first) await upload(first, first.name);
  };

  const isDropped = (event) => !rv.nodes.readOnly && event.dataTransfer?.types.includes("Files");
  window.addEventListener("dragover", (event) => isDropped(event) && event.preventDefault());
  window.addEventListener("drop", (event) => {
    if (!isDropped(event)) return;
    event.preventDefault();
    rv.upload([...event.dataTransfer.files]);
  });
})();
