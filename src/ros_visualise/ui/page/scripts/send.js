// Sends texts to the program: rv.send("hold", "forward") sets the hidden element that Python made
// with `add_channel(..., "hold", ...)`. viser's own connection carries them, in the worker that is
// told the server's address first. rv.camera is the newest viewpoint that viser told of, and
// rv.isForeign says that another web site may have led here.
window.rv = (() => {
  const post = Worker.prototype.postMessage;
  let connection = null;
  Worker.prototype.postMessage = function (data, ...rest) {
    if (data?.type === "set_server") connection = this;
    if (data?.message?.type === "ViewerCameraMessage") rv.camera = data.message;
    return post.call(this, data, ...rest);
  };
  return {
    camera: null,
    isForeign: false,
    send(name, value) {
      const uuid = document.querySelector(`[data-channel="${name}"]`)?.dataset.uuid;
      if (!uuid || !connection) return;
      const message = { type: "GuiUpdateMessage", uuid, updates: { value } };
      post.call(connection, { type: "send", message });
    },
  };
})();
