// The log, the newest line last; lines of a level and worse, of a node, with these words.
const LEVELS = ["DEBUG", "INFO", "WARNING", "ERROR", "CRITICAL"];
const KEPT = 2000;
const SHOWN = 500;

export default {
  mixins: [rv.monitored("log", LEVELS, "INFO")],
  template: `
    <div class="rv-log">
      <div class="rv-tools" role="toolbar" aria-label="Log">
        <select v-model="level" aria-label="Level" title="Show this level and more severe ones" @change="keep"><option v-for="one in levels.slice(0, 4)" :key="one">{{ one }}</option></select>
        <select v-model="node" aria-label="Node" title="Show lines from this node" @change="keep"><option value="">All nodes</option><option v-for="one in nodes" :key="one">{{ one }}</option></select>
        <input v-model="words" type="search" placeholder="Search" aria-label="Search" @change="keep">
        <q-btn flat dense size="sm" icon="delete_sweep" aria-label="Clear" title="Clear" @click="lines = []" />
      </div>
      <div class="rv-rows" ref="rows" role="log" aria-label="Log" tabindex="0" @scroll="follows = $event.target.scrollHeight - $event.target.scrollTop - $event.target.clientHeight < 30">
        <div v-for="line in shown" :key="line.number" class="rv-logged" :class="'rv-' + line.level.toLowerCase()">
          <time :title="line.time + ' s'">{{ new Date(1000 * line.time).toLocaleTimeString() }}</time><small>{{ line.node }}</small><span>{{ line.text }}</span></div>
        <p v-if="!shown.length">No lines</p>
      </div>
    </div>`,
  data() {
    return { lines: [], node: String(this.state.node ?? ""), follows: true };
  },
  computed: {
    nodes() { return [...new Set([...this.lines.map((line) => line.node), this.node])].filter(Boolean).sort(); },
    shown() {
      const passes = ({ level, node, text }) => (!this.node || node === this.node) && this.passes(LEVELS.indexOf(level), `${node} ${text}`);
      return this.lines.filter(passes).slice(-SHOWN);
    },
  },
  watch: {
    async shown() {
      if (!this.follows) return;
      await this.$nextTick();
      this.$refs.rows.scrollTop = this.$refs.rows.scrollHeight;
    },
  },
  methods: {
    begin() {
      this.lines = [];
    },
    take({ lines }) {
      this.lines = [...this.lines, ...lines].slice(-KEPT);
    },
  },
};
