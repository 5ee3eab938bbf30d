// The table of topics: one line each, with rates and latencies over the last minute behind the
// figures; only the lines in view are in the document.
import { markRaw } from "vue";

const LINE = 22; // pixels
const MORE = 5; // lines beyond the edges
const KEPT = 60; // figures, of one second each
const COLUMNS = [
  { name: "Topic", hint: "", at: 0 },
  { name: "Hz", hint: "Rate according to the message stamps", at: 2 },
  { name: "Target", hint: "Requested rate, Hz", at: 4 },
  { name: "Dropped", hint: "Messages lost, not counting those that a node is set to skip", at: 5 },
  { name: "ms", hint: "Median latency from the source to the end of this node's processing", at: 7 },
];

export default {
  template: `
    <div class="rv-topics">
      <input type="search" v-model="words" placeholder="Find a topic" aria-label="Find a topic">
      <div class="rv-lines" ref="lines" role="table" aria-label="Topics" :aria-rowcount="found.length" tabindex="0"
        @scroll="top = $event.target.scrollTop">
        <div class="rv-line rv-head" role="row">
          <span v-for="column in columns" :key="column.name" role="columnheader" :aria-sort="sort === column.at ? (down ? 'descending' : 'ascending') : 'none'">
            <button :title="column.hint || null" @click="order(column.at)">{{ column.name }}</button></span>
        </div>
        <div :style="{ height: found.length * ${LINE} + 'px', position: 'relative' }">
          <div v-for="[row, number] in inView" :key="row[0]" class="rv-line" role="row" draggable="true"
            @dragstart="$event.dataTransfer.setData('text/rv-topic', row[0])" :style="{ top: number * ${LINE} + 'px' }">
            <span role="cell" :title="row[0] + '  ' + row[1]">{{ row[0] }} <small>{{ row[1] }}</small></span>
            <template v-if="row.length > 2">
              <span role="cell" :title="shown(row[3]) + ' per second'">{{ shown(row[2]) }}<svg viewBox="0 0 60 1" preserveAspectRatio="none"><polyline :points="line(row[0], 0)"/></svg></span>
              <span role="cell">{{ shown(row[4]) }}</span>
              <span role="cell" :title="row[6] || 'none'">{{ row[5] }}</span>
              <span role="cell">{{ shown(row[7]) }}<svg viewBox="0 0 60 1" preserveAspectRatio="none"><polyline :points="line(row[0], 1)"/></svg></span>
            </template>
            <span v-else role="cell" class="rv-wide">unsupported type</span>
          </div>
        </div>
      </div>
      <p v-for="line in lines">{{ line }}</p>
    </div>`,
  props: { state: Object, readOnly: Boolean },
  data() {
    return { rows: [], lines: [], words: "", sort: null, down: false, top: 0, height: 400, columns: COLUMNS };
  },
  computed: {
    found() {
      const words = this.words.toLowerCase().split(/\s+/);
      const rows = this.rows.filter(([name, kind]) => words.every((word) => `${name} ${kind}`.toLowerCase().includes(word)));
      if (this.sort === null) return rows;
      const value = (row) => row[this.sort] ?? -1;
      const order = (a, b) => (value(a) < value(b) ? -1 : value(a) > value(b) ? 1 : 0);
      return rows.sort((a, b) => (this.down ? order(b, a) : order(a, b)));
    },
    inView() {
      const from = Math.max(Math.floor(this.top / LINE) - MORE, 0);
      const until = Math.ceil((this.top + this.height) / LINE) + MORE;
      return this.found.slice(from, until).map((row, i) => [row, from + i]);
    },
  },
  created() {
    this.past = markRaw(new Map());
  },
  mounted() {
    this.live = rv.live("/live/topics", { message: (figures) => this.take(figures) });
    this.sized = new ResizeObserver(() => (this.height = this.$refs.lines.clientHeight));
    this.sized.observe(this.$refs.lines);
  },
  beforeUnmount() {
    this.live.close();
    this.sized.disconnect();
  },
  methods: {
    take({ rows, lines }) {
      const before = new Map(this.past);
      this.past.clear();
      for (const [name, , hz, , , , , ms] of rows) this.past.set(name, [...(before.get(name) ?? []), [hz, ms]].slice(-KEPT));
      Object.assign(this, { rows, lines });
    },
    // The points of a line over the last minute, in a box 60 wide and 1 high that begins at 0.
    line(name, which) {
      const values = (this.past.get(name) ?? []).map((one) => one[which]);
      const most = Math.max(...values);
      return most > 0 ? values.map((value, i) => `${KEPT - values.length + i},${1 - (value ?? 0) / most}`).join(" ") : "";
    },
    order(at) {
      this.down = this.sort === at ? !this.down : at > 0;
      this.sort = at;
    },
    shown(value) {
      return value == null ? "–" : value.toFixed(1);
    },
  },
};
