// A picture of the server's, made anew every second.
const PERIOD_MS = 1000;

export default {
  template: `<div class="rv-picture"><div v-html="svg"></div><p v-if="reason">{{ reason }}</p></div>`,
  props: { state: Object, readOnly: Boolean, name: String },
  data: () => ({ svg: "", reason: "" }),
  mounted() {
    this.look();
  },
  beforeUnmount() {
    this.isGone = true;
    clearTimeout(this.waiting);
  },
  methods: {
    async look() {
      try {
        this.svg = (await rv.ask({ ask: this.name })).svg;
        this.reason = "";
      } catch (error) {
        this.reason = error.message;
      }
      if (!this.isGone) this.waiting = setTimeout(this.look, PERIOD_MS);
    },
  },
};
