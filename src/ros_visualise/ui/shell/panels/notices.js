// Warnings and rejections, the newest first; they appear for a while on the page too.
export default {
  template: `
    <div class="rv-notices" role="log" aria-label="Notices">
      <p v-if="!lines.length" class="rv-note">No warnings.</p>
      <p v-for="[number, time, level, text, times] in lines" :key="number" :class="{ 'rv-failed': level !== 'warning' }">
        <time :title="new Date(1000 * time).toISOString()">{{ new Date(1000 * time).toLocaleTimeString() }}</time> {{ text }}<small v-if="times > 1"> ({{ times }} times)</small></p>
    </div>`,
  props: { state: Object, readOnly: Boolean },
  data: () => ({ lines: [] }),
  mounted() {
    this.follow = () => (this.lines = [...rv.nodes.notices].reverse());
    rv.nodes.addEventListener("change", this.follow);
    this.follow();
  },
  beforeUnmount() {
    rv.nodes.removeEventListener("change", this.follow);
  },
};
