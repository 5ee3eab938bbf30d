// Rate over time and intervals of a topic, and the histogram of one of its fields.
import { markRaw } from "vue";

const WORDS = { count: "Count", mean: "Mean", median: "Median", deviation: "Standard deviation", min: "Minimum", max: "Maximum" };

export default {
  template: `
    <div class="rv-statistics" @dragover.prevent @drop.prevent="drop">
      <div class="rv-tools" role="toolbar" aria-label="Statistics">
        <select v-model="topic" aria-label="Topic" @change="choose('')"><option value="" disabled>Choose a topic</option>
          <option v-for="(type, name) in topics" :key="name" :value="name">{{ name }}</option></select>
        <select v-if="topic" v-model="field" aria-label="Field" @change="choose(field)" @pointerdown="fieldsOf" @focus="fieldsOf"><option value="">No field</option>
          <option v-for="path in [...new Set([...paths, field])].filter(Boolean)" :key="path">{{ path }}</option></select>
        <span class="rv-fault" role="status">{{ fault }}</span>
      </div>
      <div v-for="one in charts" :key="one.title" class="rv-pane">
        <div class="rv-legend"><b>{{ one.title }}</b><span v-for="(value, name) in one.summary" :key="name">{{ words[name] }} <b>{{ shown(value) }}</b></span></div>
        <div class="rv-chart" role="img" :aria-label="one.title"><div :ref="(element) => (elements[one.title] = element)"></div></div>
      </div>
    </div>`,
  props: { state: Object, readOnly: Boolean },
  data() {
    const { topic, field } = this.state;
    return { topic: typeof topic === "string" ? topic : "", field: typeof field === "string" ? field : "", topics: {}, paths: [], fault: "", charts: [], words: WORDS };
  },
  created() {
    Object.assign(this, { elements: markRaw({}), drawn: markRaw(new Map()), number: 0 });
  },
  async mounted() {
    this.tools = markRaw(await import(`${rv.root}/parts/plot_chart.js`));
    if (this.isGone) return;
    this.live = rv.live("/live/plots", { open: () => this.ask(), message: (data) => this.take(data) });
    this.themed = new MutationObserver(() => this.draw());
    this.themed.observe(document.body, { attributeFilter: ["class"] });
  },
  beforeUnmount() {
    this.isGone = true;
    this.live?.close();
    this.themed?.disconnect();
    this.drawn.forEach((chart) => chart.close());
  },
  methods: {
    ask() {
      const { topic, field } = this;
      if (!topic) return;
      this.asked = [["Messages per second", "rates", topic], ["Intervals, s", "intervals", topic]];
      if (field) this.asked.push([field, "histogram", `${topic}:${field}`]);
      this.charts = this.asked.map(([title]) => ({ title, summary: {} }));
      const views = this.asked.map(([, kind, name]) => ({ [kind]: name }));
      this.live.send({ number: ++this.number, views, from: null, to: null, columns: 600 });
    },
    choose(field) {
      if (!field) this.paths = [];
      this.field = field;
      rv.keep(this.$el, { topic: this.topic, field: field || undefined });
      this.ask();
    },
    fieldsOf() {
      if (!this.paths.length) this.live.send({ fields: this.topic });
    },
    take(data) {
      if (data.topics) this.topics = data.topics;
      else if (data.fields === this.topic) this.paths = data.paths ?? [];
      if (!(data instanceof ArrayBuffer)) return;
      const { header, rows } = this.tools.unpacked(data);
      if (header.number !== this.number) return;
      this.fault = header.error;
      Object.assign(this.charts[header.view], { summary: header.summary ?? {}, unit: header.unit, rows: markRaw(rows), width: header.width });
      this.draw();
    },
    async draw() {
      await this.$nextTick();
      for (const [title, chart] of this.drawn) {
        if (this.charts.some((one) => one.title === title)) continue;
        chart.close();
        this.drawn.delete(title);
      }
      for (const { title, rows, width, unit } of this.charts) {
        if (!rows || this.isGone) continue;
        if (!this.drawn.has(title)) this.drawn.set(title, new this.tools.BarChart(this.elements[title]));
        this.drawn.get(title).draw(rows, width, width === 3 && title === this.field ? unit : "");
      }
    },
    shown(value) {
      return Number(value.toPrecision(6)).toString();
    },
    drop(event) {
      const [topic, path] = rv.dropped(event, this.topics);
      if (!topic) return;
      this.topic = topic;
      this.choose(path);
    },
  },
};
