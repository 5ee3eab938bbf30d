// Sends texts to the program: rv.send("hold", "forward") sets the hidden element that Python made
// with `add_channel(..., "hold", ...)`. viser's own connection carries them, in the worker that
// gets the server's address first. rv.camera is viser's newest viewpoint, rv.isForeign is true if
// another web site may have led here, and rv.isViewer if this page is read-only: then
// only viewpoints are sent, as the program would drop all else.
window.rv = (() => {
  const post = Worker.prototype.postMessage;
  let connection = null;
  Worker.prototype.postMessage = function (data, ...rest) {
    if (data?.type === "set_server") connection = this;
    if (data?.message?.type === "ViewerCameraMessage") rv.camera = data.message;
    else if (data?.type === "send" && rv.isViewer) return;
    return post.call(this, data, ...rest);
  };
  return {
    camera: null,
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
