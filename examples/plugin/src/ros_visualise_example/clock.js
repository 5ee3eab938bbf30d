// The time of this browser, ten times a second.
export default {
  template: `<div style="font-size: 3rem; text-align: center">{{ time }}</div>`,
  props: { state: Object, readOnly: Boolean },
  data: () => ({ time: "" }),
  mounted() {
    this.timer = setInterval(() => (this.time = new Date().toISOString().slice(11, 21)), 100);
  },
  beforeUnmount() {
    clearInterval(this.timer);
  },
};
