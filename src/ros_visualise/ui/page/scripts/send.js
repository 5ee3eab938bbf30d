// Sends texts to the program: rv.send("hold", "forward") sets the hidden element that Python made
// with `add_channel(..., "hold", ...)`. viser's own connection carries them, in the worker that
// gets the server's address first. rv.isForeign is true if another web site may have led here, and
// rv.isViewer if this page is read-only: then only viewpoints are sent, as the program would drop
// all else.
window.rv = (() => {
  const post = Worker.prototype.postMessage;
  let connection = null;
  Worker.prototype.postMessage = function (data, ...rest) {
    if (data?.type === "set_server") connection = this;
    const isCamera = data?.message?.type === "ViewerCameraMessage";
    if (!isCamera && data?.type === "send" && rv.isViewer) return;
    return post.call(this, data, ...rest);
  };
  return {
    isForeign: false,
    isViewer: false,
    send(name, value) {
      if (rv.isViewer) return;
      const uuid = document.querySelector(`[data-channel="${name}"]`)?.dataset.uuid;
      if (!uuid || !connection) return;
      const message = { type: "GuiUpdateMessage", uuid, updates: { value } };
      post.call(connection, { type: "send", message });
    },
  };
})();
