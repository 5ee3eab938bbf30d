// The newest status of each name, the worst first; a click shows its values.
const LEVELS = ["OK", "WARN", "ERROR", "STALE"];
const STALE_S = 5;

export default {
  mixins: [rv.monitored("diagnostics", LEVELS, "OK")],
  template: `
    <div class="rv-diagnostics">
      <div class="rv-tools" role="toolbar" aria-label="Diagnostics">
        <select v-model="level" aria-label="Level" title="Show this level and more severe ones" @change="keep"><option v-for="one in levels.slice(0, 3)" :key="one">{{ one }}</option></select>
        <input v-model="words" type="search" placeholder="Search" aria-label="Search" @change="keep">
        <span>{{ counts }}</span>
      </div>
      <div class="rv-rows">
        <details v-for="one in shown" :key="one.name" :class="'rv-' + levels[one.rank].toLowerCase()" :open="opened[one.name]" @toggle="opened[one.name] = $event.target.open">
          <summary><b>{{ levels[one.rank] }}</b> {{ one.name }} <small>{{ one.message }}</small></summary>
          <table><tr v-for="[name, value] in one.values" :key="name"><th scope="row">{{ name }}</th><td>{{ value }}</td></tr></table>
        </details>
        <p v-if="!shown.length">{{ statuses.length ? "Nothing found" : "No diagnostics yet" }}</p>
      </div>
    </div>`,
  data: () => ({ statuses: [], isLive: false, opened: {} }),
  computed: {
    ranked() {
      const rank = ({ level, age }) => (this.isLive && age > STALE_S ? LEVELS.length - 1 : Math.min(Math.max(level, 0), 3));
      return this.statuses.map((one) => ({ ...one, rank: rank(one) })).sort((a, b) => b.rank - a.rank || a.name.localeCompare(b.name));
    },
    shown() {
      return this.ranked.filter((one) => this.passes(one.rank, `${one.name} ${one.message}`));
    },
    counts() {
      const number = (rank) => this.ranked.filter((one) => one.rank === rank).length;
      return LEVELS.map((name, rank) => [name, number(rank)]).filter(([, count]) => count).map((one) => one.join(" ")).join(", ");
    },
  },
  methods: {
    take({ statuses, live }) {
      [this.statuses, this.isLive] = [statuses, live];
    },
  },
};
