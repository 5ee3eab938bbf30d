// An edge that is dragged, or moved by the arrow keys, to widen the element after it.
const LEAST = 180;
const STEP = 20;

export default {
  template: `<div class="rv-edge" role="separator" aria-orientation="vertical" tabindex="0" aria-label="Panel width"
    @pointerdown="grab" @keydown.left.stop.prevent="widen(${STEP})" @keydown.right.stop.prevent="widen(-${STEP})"></div>`,
  methods: {
    widen(pixels) {
      const { nextElementSibling: after, parentElement: both } = this.$el;
      const most = both.clientWidth - LEAST;
      after.style.width = `${Math.max(LEAST, Math.min(after.clientWidth + pixels, most))}px`;
    },
    grab(event) {
      event.preventDefault();
      this.$el.setPointerCapture(event.pointerId);
      let from = event.clientX;
      this.$el.onpointermove = ({ clientX }) => {
        this.widen(from - clientX);
        from = clientX;
      };
      this.$el.onpointerup = this.$el.onpointercancel = () => (this.$el.onpointermove = null);
    },
  },
};
