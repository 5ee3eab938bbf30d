// A message as a tree, or the last messages as a table of some of their fields. Fields are dragged to
// plots and to the table.
const FOLDED = 12; // entries from which on what is inside others is folded
const COLUMNS = 6;

const brief = (value) => (typeof value === "number" ? Number(value.toPrecision(5)) : value);
const isLeaf = (value) => value === null || typeof value !== "object";

export default {
  template: `
    <div class="rv-messages" @dragover.prevent @drop.prevent="drop">
      <div class="rv-tools" role="toolbar" aria-label="Messages">
        <select v-model="topic" aria-label="Topic" @change="choose(topic)"><option value="" disabled>Choose a topic</option>
          <option v-for="(type, name) in topics" :key="name" :value="name">{{ name }}</option></select>
        <q-btn flat dense size="sm" icon="table_rows" :color="isTable ? 'primary' : undefined" :aria-pressed="String(isTable)" aria-label="Table" title="Table of the last messages" @click="isTable = !isTable; ask()" />
        <q-btn flat dense size="sm" icon="chevron_left" aria-label="Earlier message" title="Earlier message" :disable="!(news.number > news.first)" @click="go(news.number - 1)" />
        <q-btn flat dense size="sm" icon="chevron_right" aria-label="Later message" title="Later message" :disable="!(news.number < news.last)" @click="go(news.number + 1)" />
        <q-btn flat dense size="sm" icon="last_page" aria-label="Newest message" title="Follow the newest message" :color="number === null ? 'primary' : undefined" @click="go(null)" />
        <span v-if="news.stamp" :title="'Stamp ' + news.stamp + ' ns'">{{ timeOf(news.stamp) }}</span>
        <span class="rv-space"></span><small :title="topics[topic]">{{ (topics[topic] ?? "").split("/").at(-1) }}</small>
        <span class="rv-fault" role="status">{{ news.error }}</span>
      </div>
      <p v-if="topic && !news.message && !news.error">No message yet</p>
      <div v-if="isTable" class="rv-rows"><table>
        <thead><tr><th scope="col">Stamp</th><th v-for="path in columns" :key="path" scope="col">{{ path }}
          <button :aria-label="'Remove ' + path" title="Remove" @click="keepFields(columns.filter((one) => one !== path))">×</button></th></tr></thead>
        <tbody><tr v-for="[at, stamp, ...cells] in news.rows ?? []" :key="at" :class="{ 'rv-on': at === news.number }" @click="go(at)">
          <td :title="stamp + ' ns'">{{ timeOf(stamp) }}</td><td v-for="(cell, i) in cells" :key="i">{{ shown(cell) }}</td></tr></tbody>
      </table></div>
      <div v-else class="rv-rows" role="tree" :aria-label="'Message of ' + topic">
        <div v-for="line in lines" :key="line.path" class="rv-leaf" role="treeitem" :aria-expanded="line.inside ? String(line.isOpen) : undefined" draggable="true"
          :style="{ paddingLeft: 8 + 14 * line.depth + 'px' }" @dragstart="drag($event, line)">
          <button v-if="line.inside" @click="opened[line.path] = !line.isOpen">{{ line.isOpen ? "▾" : "▸" }} {{ line.name }} <small>{{ line.note }}</small></button>
          <template v-else><span>{{ line.name }}</span><b :title="line.value">{{ line.value }}</b>
            <button v-if="line.isNumber" class="rv-plot" :aria-label="'Plot ' + line.path" title="Plot" @click="plot(line.path)">↗</button></template>
        </div>
      </div>
    </div>`,
  props: { state: Object, readOnly: Boolean },
  data() {
    const { topic, fields } = this.state;
    const good = Array.isArray(fields) ? fields.filter((one) => typeof one === "string").slice(0, 30) : null;
    return { topic: typeof topic === "string" ? topic : "", topics: {}, fields: good, isTable: !!good, number: null, news: {}, opened: {}, timeOf: rv.asTime };
  },
  computed: {
    lines() {
      const found = [];
      const walk = (value, path, name, depth) => {
        const list = Array.isArray(value) ? value : value?.first;
        const isPlain = Array.isArray(list) && list.every(isLeaf);
        if (isLeaf(value)) return found.push({ path, name, depth, value: String(value), isNumber: typeof value === "number" });
        const entries = list ? list.map((one, i) => [`[${i}]`, one]) : Object.entries(value);
        const total = Array.isArray(value) ? value.length : value.length ?? entries.length;
        const isOpen = this.opened[path] ?? (!isPlain && (depth === 0 || entries.length <= FOLDED));
        const note = !list ? "" : isPlain && !isOpen ? `[${list.slice(0, 9).map(brief).join(", ")}${total > 9 ? `, … of ${total}` : ""}]` : `${total} items`;
        found.push({ path, name, depth, note, inside: true, isOpen });
        if (!isOpen) return;
        for (const [key, one] of entries) walk(one, list ? path + key : `${path}.${key}`, key, depth + 1);
        if (total > entries.length && list) found.push({ path: `${path}…`, name: `… of ${total}`, depth: depth + 1, value: "" });
      };
      for (const [name, value] of Object.entries(this.news.message ?? {})) walk(value, name, name, 0);
      return found;
    },
    numbers() { return this.lines.filter(({ isNumber, path }) => isNumber && !path.startsWith("header")).map(({ path }) => path); },
    columns() { return this.fields ?? this.numbers.slice(0, COLUMNS); },
  },
  watch: {
    columns(now, before) { if (this.isTable && String(now) !== String(before)) this.ask(); },
  },
  mounted() {
    this.live = rv.live("/live/messages", { open: () => this.ask(), message: (data) => this.take(data) });
    this.begun = () => this.$forceUpdate();
    rv.clock.addEventListener("begun", this.begun);
  },
  beforeUnmount() {
    this.live.close();
    rv.clock.removeEventListener("begun", this.begun);
  },
  methods: {
    ask() {
      this.live.send({ topic: this.topic, number: this.number, fields: this.isTable ? this.columns : null });
    },
    take(data) {
      if (data.topics) this.topics = data.topics;
      else if (data.topic === this.topic) this.news = { ...data, message: data.message ?? this.news.message };
    },
    choose(topic, fields = null) {
      Object.assign(this, { topic, fields, number: null, news: {}, opened: {} });
      rv.keep(this.$el, { topic, fields: fields ?? undefined });
      this.ask();
    },
    go(number) {
      this.number = number === this.news.last ? null : number;
      this.ask();
    },
    keepFields(fields) {
      this.fields = fields;
      rv.keep(this.$el, { fields });
      this.ask();
    },
    shown(cell) {
      return typeof cell === "number" ? Number(cell.toPrecision(9)).toString() : cell;
    },
    plot(path) {
      rv.open("plots", { curves: [`${this.topic}:${path}`] });
    },
    drag(event, { path }) {
      event.dataTransfer.setData("text/rv-topic", `${this.topic}.${path}`);
    },
    drop(event) {
      const [topic, path] = rv.dropped(event, this.topics);
      if (!topic) return;
      if (topic !== this.topic) this.choose(topic, path && this.isTable ? [path] : null);
      else if (path && this.isTable && !this.columns.includes(path)) this.keepFields([...this.columns, path]);
    },
  },
};
