// Keeps the frame, which is outside of what NiceGUI makes, as large as this place, and gives it the keys.
export default {
  template: `<div class="rv-place"></div>`,
  mounted() {
    const frame = document.getElementById("rv-viser");
    this.sized = new ResizeObserver(([{ contentRect }]) => {
      frame.style.width = `${contentRect.width}px`;
      frame.style.height = `${contentRect.height}px`;
    });
    this.sized.observe(this.$el);
    const focus = () => frame.contentWindow.focus();
    frame.addEventListener("load", focus);
    focus();
  },
  beforeUnmount() {
    this.sized.disconnect();
  },
};
