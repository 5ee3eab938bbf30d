// Panes of curves over the same time. Samples come in binary over /live/plots, as many as are wide
// pixels; ECharts draws them. What is shown and how is in the page's address.
import { defineAsyncComponent, markRaw } from "vue";

const PAUSE_MS = 50; // between requests for what is shown
const VALUES_MS = 100; // and for values at the cursor
const LASTS = [10, 30, 60, 300];
const ELEMENTS = 32; // of an array that is dropped
const NUMBERS = /(orientation|rotation|quaternion|(^|[.:])q)\.[xyzw]$/;
const KINDS = { time: "curve", xy: "xy", spectrum: "spectrum" };

let count = 0;

const isText = (one) => typeof one === "string" && one.length < 600;
const formula = (name) => (name.startsWith("=") ? name.slice(1) : `"${name}"`);
const isRange = (range) => Array.isArray(range) && range.length === 2 && range.every((end) => end >= 0 && end <= 100) && range[0] < range[1];

// Rows with a number in each at first, but none after it.
const isEmpty = (rows, width) => rows.length > 0 && rows.every((value, i) => i % width === 0 || Number.isNaN(value));

function paneOf(given) {
  const { kind, curves, own, x, y, xs } = given ?? {};
  return {
    id: ++count,
    kind: Object.hasOwn(KINDS, kind ?? "") && (kind !== "xy" || isText(x)) ? kind : "time",
    curves: (Array.isArray(curves) ? curves : []).filter(isText).slice(0, ELEMENTS),
    own: own === true,
    against: isText(x) ? x : "",
    x: isRange(xs) ? xs : null,
    y: isRange(y) ? y : null,
  };
}

function written({ kind, curves, own, against, x, y }) {
  const all = { kind: kind === "time" ? undefined : kind, curves, own: own || undefined, x: kind === "xy" ? against : undefined };
  return { ...all, xs: x ?? undefined, y: y ?? undefined };
}

// A function that is called at most every so often, with the last call kept.
function paced(act, pause) {
  let timer = null;
  let isWaiting = false;
  return () => {
    isWaiting = true;
    if (timer) return;
    const run = () => {
      timer = isWaiting ? setTimeout(run, pause) : null;
      if (isWaiting) act();
      isWaiting = false;
    };
    run();
  };
}

export default {
  components: { FieldList: defineAsyncComponent(() => import(`${rv.root}/parts/field_list.js`)) },
  template: `
    <div class="rv-plots" @dragover.prevent @drop.prevent="drop($event)">
      <div class="rv-tools" role="toolbar" aria-label="Plot">
        <q-btn flat dense icon="add" aria-label="Add curves" title="Add curves">
          <q-menu ref="menu" v-model="isAdding" no-focus :transition-duration="0" @show="$refs.list?.focus()"><field-list ref="list" @ready="$refs.menu.updatePosition()" :topics="topics" :fields="fields" :chosen="names" :start="sought" @want="want" @choose="toggle" /></q-menu>
        </q-btn>
        <q-btn flat dense icon="functions" aria-label="Add an expression" title="Add a curve computed from others" @click="edit(null)" />
        <q-btn flat dense icon="horizontal_split" aria-label="Add a pane" title="Add a pane" @click="change(() => panes.push(paneOf()))" />
        <q-btn flat dense icon="fit_screen" aria-label="Fit" title="Show the whole time range (double click)" @click="fit" />
        <q-btn flat dense icon="download" aria-label="Save" title="Save what is shown">
          <q-menu auto-close><q-list dense>
            <q-item v-for="(act, kind) in savers" :key="kind" clickable @click="act"><q-item-section>{{ kind }}</q-item-section></q-item>
          </q-list></q-menu>
        </q-btn>
        <select v-if="isLive" v-model.number="last" aria-label="Time range" title="Time range" @change="keep(), request()">
          <option :value="0">All</option><option v-for="one in lasts" :key="one" :value="one">Last {{ one }} s</option>
        </select>
        <q-circular-progress v-if="share < 1" :value="100 * share" size="18px" :title="'Reading the recording: ' + Math.round(100 * share) + ' %'" />
        <span class="rv-fault" role="status">{{ fault }}</span>
      </div>
      <q-dialog v-model="isEditing" aria-label="Expression"><q-card class="rv-expression"><q-card-section>
        <q-input v-model="text" autofocus autogrow label="Expression" :placeholder="'derivative(&quot;/odom:pose.pose.position.x&quot;)'" @keydown.enter.prevent="apply" />
        <small>Curves in quotes: "/topic:field". {{ functions.join(", ") }}, + - * / ** %</small></q-card-section>
        <q-card-actions align="right"><q-btn flat v-close-popup label="Cancel" /><q-btn flat color="primary" label="Plot" @click="apply" /></q-card-actions>
      </q-card></q-dialog>
      <div v-for="(pane, i) in panes" :key="pane.id" class="rv-pane" @dragover.prevent @drop.prevent.stop="drop($event, pane)">
        <div class="rv-legend">
          <span v-for="name in pane.curves" :key="name" class="rv-curve" draggable="true" :title="errors[pane.id + name] || name" @dragstart="drag($event, name)">
            <i :style="{ background: ink(name) }"></i><span :class="{ 'rv-fault': errors[pane.id + name] }">{{ name }}</span>
            <b>{{ shown(name) }}</b>
            <button :aria-label="'Curve ' + name" title="Compute, move or remove">⋮
              <q-menu auto-close><q-list dense>
                <q-item v-for="[words, act] in actsOf(pane, name)" :key="words" clickable @click="act"><q-item-section>{{ words }}</q-item-section></q-item>
                <q-item v-for="other in names.filter((one) => one !== name)" :key="other" clickable @click="change(() => panes.push(paneOf({ kind: 'xy', curves: [name], x: other })))">
                  <q-item-section>Against {{ other }}</q-item-section></q-item>
              </q-list></q-menu>
            </button>
            <button :aria-label="'Remove ' + name" title="Remove" @click="remove(pane, name)">×</button>
          </span>
          <span v-if="pane.kind === 'xy'">against {{ pane.against }}</span>
          <span v-else-if="!pane.curves.length">{{ hint }}
            <button v-for="[topic, curves] in proposed" :key="topic" class="rv-link" :title="curves.join('  ')" @click="change(() => pane.curves.push(...curves))">{{ topic }}</button></span>
          <span class="rv-space"></span>
          <q-btn v-if="pane.curves.length > 1" flat dense size="sm" icon="format_line_spacing" :color="pane.own ? 'primary' : undefined" :aria-pressed="String(pane.own)"
            aria-label="Separate scales" title="Give each curve its own scale" @click="change(() => (pane.own = !pane.own))" />
          <q-btn v-if="panes.length > 1" flat dense size="sm" icon="close" aria-label="Remove pane" title="Remove pane" @click="change(() => panes.splice(i, 1))" />
        </div>
        <div class="rv-chart" tabindex="0" role="img" :aria-label="'Plot of ' + pane.curves.join(', ')" @keydown="press">
          <div :ref="(element) => (elements[pane.id] = element)"></div>
          <u class="rv-now"></u><u class="rv-pointed"></u>
        </div>
      </div>
    </div>`,
  props: { state: Object, readOnly: Boolean, colors: Array, functions: Array, first: Object },
  data() {
    const { panes, curves, last } = this.state;
    const all = (Array.isArray(panes) ? panes.slice(0, 12) : []).map(paneOf);
    return {
      panes: all.length ? all : [paneOf({ curves })], last: LASTS.includes(last) ? last : 0, lasts: LASTS,
      topics: {}, fields: {}, values: {}, errors: {}, share: 1, fault: "", isLive: false, isDark: true, now: 0, tools: null,
      isAdding: false, sought: "", isEditing: false, text: "",
      savers: { CSV: () => this.saveCsv(), PNG: () => this.savePicture("png"), SVG: () => this.savePicture("svg") },
    };
  },
  computed: {
    names() { return [...new Set(this.panes.flatMap(({ curves, against }) => (against ? [...curves, against] : curves)))]; },
    hint() { return Object.keys(this.topics).length ? `Add curves with +, or drag fields here${this.proposed.length ? ", or begin with" : ""}` : ""; },
    proposed() {
      const found = Object.entries(this.topics).map(([topic, type]) => [topic, (this.first[type.split("/").at(-1)] ?? []).map((path) => `${topic}:${path}`)]);
      return found.filter(([, curves]) => curves.length).slice(0, 4);
    },
  },
  created() {
    Object.assign(this, { elements: markRaw({}), charts: markRaw(new Map()), found: markRaw(new Map()), paneOf, asked: [], number: 0, csv: [], wanted: [] });
    this.request = paced(() => this.send(), PAUSE_MS);
    this.askValues = paced(() => this.live?.send({ at: this.now, curves: this.names }), VALUES_MS);
    this.clock = (seconds) => this.tools?.clock(seconds) ?? "";
  },
  async mounted() {
    this.tools = markRaw(await import(`${rv.root}/parts/plot_chart.js`));
    if (this.isGone) return;
    this.window = this.tools.readable(this.state.window);
    this.live = rv.live("/live/plots", { open: () => this.request(), message: (data) => this.take(data), closed: () => (this.found = markRaw(new Map())) });
    this.moved = () => this.follow();
    rv.clock.addEventListener("change", this.moved);
    rv.cursor.addEventListener("move", this.moved);
    this.plotted = (event) => {
      if (event.defaultPrevented || !this.$el.offsetParent) return; // another plot has it, or this one is hidden
      event.preventDefault();
      if (!this.names.includes(event.detail)) this.add(event.detail, this.panes.find(({ curves }) => !curves.length));
    };
    document.addEventListener("rv-plot", this.plotted);
    this.themed = new MutationObserver(() => this.draw());
    this.themed.observe(document.body, { attributeFilter: ["class"] });
    this.sync();
    this.follow();
  },
  beforeUnmount() {
    this.isGone = true;
    this.live?.close();
    this.themed?.disconnect();
    rv.clock.removeEventListener("change", this.moved);
    rv.cursor.removeEventListener("move", this.moved);
    document.removeEventListener("rv-plot", this.plotted);
    this.charts.forEach((chart) => chart.close());
  },
  methods: {
    color(name) {
      this.inks ??= new Map();
      if (!this.inks.has(name)) this.inks.set(name, this.colors[this.inks.size % this.colors.length]);
      return this.inks.get(name);
    },
    ink(name) {
      return this.tools?.inked(this.color(name), this.isDark) ?? "";
    },
    shown(name) {
      const value = this.values[name];
      return value == null ? "" : Number(value.toPrecision(7)).toString();
    },
    // What a person did: kept in the address, and undone by Ctrl+Z.
    change(act) {
      const before = JSON.stringify(this.kept());
      act();
      const now = JSON.stringify(this.kept());
      rv.past.did({ undo: () => this.become(before), redo: () => this.become(now) });
      this.keep();
      this.sync();
    },
    kept() {
      return { panes: this.panes.map(written) };
    },
    become(text) {
      this.panes = JSON.parse(text).panes.map(paneOf);
      this.keep();
      this.sync();
    },
    keep() {
      rv.keep(this.$el, { ...this.kept(), window: this.window ?? undefined, last: this.last || undefined, curves: undefined });
    },
    // A chart for each pane, and samples for all of them.
    async sync() {
      await this.$nextTick();
      if (this.isGone || !this.tools) return;
      for (const [id, chart] of this.charts) {
        if (this.panes.some((pane) => pane.id === id)) continue;
        chart.close();
        this.charts.delete(id);
      }
      for (const pane of this.panes) {
        if (this.charts.has(pane.id)) continue;
        const on = {
          zoom: (kind, range) => this.zoom(pane, kind, range),
          seek: (time) => this.readOnly || this.seek(time),
          point: (time) => rv.cursor.move(time),
          fit: () => this.fit(),
          sized: () => { this.request(); this.draw(); },
        };
        this.charts.set(pane.id, new this.tools.PaneChart(this.elements[pane.id], on));
      }
      this.request();
      this.draw();
      this.askValues();
    },
    send() {
      if (this.isGone) return;
      const view = ({ kind, against }, name) => (kind === "xy" ? { x: against, y: name } : { [KINDS[kind]]: name });
      this.asked = this.panes.flatMap((pane) => pane.curves.map((name) => ({ pane, name, view: view(pane, name) })));
      const [from, to] = this.window ?? [null, null];
      const columns = Math.max(16, ...[...this.charts.values()].map(({ element }) => element.clientWidth));
      const last = this.isLive && this.last && !this.window ? this.last : null;
      this.live.send({ number: ++this.number, views: this.asked.map((one) => one.view), from, to, last, columns });
    },
    take(data) {
      if (data instanceof ArrayBuffer) return this.takeSamples(data);
      if (data.topics) this.topics = data.topics;
      else if (data.fields) {
        this.fields = { ...this.fields, [data.fields]: data };
        if (data.error) setTimeout(() => delete this.fields[data.fields], 3000); // asked again
        this.wanted = this.wanted.filter((topic) => topic !== data.fields);
        this.want();
      } else if (data.values) this.values = Object.fromEntries(this.names.map((name, i) => [name, data.values[i]]));
      else if (typeof data.csv === "string") this.takeTable(data.csv);
    },
    // Go to a time; one of a live source is counted from the present.
    seek(time) {
      const { live, position } = rv.clock.state;
      rv.clock.seek(Math.max(live ? time + position - (this.present() ?? this.extent()[1]) : time, 0));
    },
    // The time that is shown, on the line of the curves; null for the present of a live source.
    present() {
      const { live, past, position, stamp } = rv.clock.state;
      return live ? (past ? stamp - this.origin : null) : position;
    },
    takeSamples(data) {
      const { header, rows } = this.tools.unpacked(data);
      if (header.number !== this.number) return;
      const { pane, name } = this.asked[header.view];
      this.origin = header.origin;
      this.found.set(pane.id + name, { ...header, rows });
      const error = header.error || (isEmpty(rows, header.width) && header.share !== 0 ? `${name}: no finite numbers` : "");
      if ((this.errors[pane.id + name] ?? "") !== error) this.errors[pane.id + name] = error;
      const there = this.asked.map((one) => this.found.get(one.pane.id + one.name));
      this.share = Math.min(1, ...there.map((one) => one?.share ?? 1));
      this.fault = this.asked.map((one) => this.errors[one.pane.id + one.name]).find(Boolean) ?? "";
      this.draw();
      this.askValues();
    },
    draw() {
      this.drawing ??= requestAnimationFrame(() => {
        this.drawing = null;
        if (!this.isGone) this.drawNow();
      });
    },
    drawNow() {
      const isDark = (this.isDark = document.body.classList.contains("body--dark"));
      const extent = this.extent();
      const all = this.panes.map((pane) => {
        const curves = pane.curves.map((name) => ({ unit: "", width: 2, rows: new Float64Array(), ...this.found.get(pane.id + name), name, color: this.color(name) }));
        return { pane, curves, extent, window: this.window ?? extent, marks: rv.clock.state.marks ?? [], x: pane.kind === "xy" ? pane.against : "Hz", isDark };
      });
      const axes = Math.max(1, ...all.map(({ pane, curves }) => this.tools.axesOf(pane, curves).length));
      for (const one of all) this.charts.get(one.pane.id)?.draw({ ...one, axes });
      this.follow();
    },
    extent() {
      const spans = [...this.found.values()].map(({ span }) => span).filter(Boolean);
      const { duration } = rv.clock.state;
      if (!this.isLive) spans.push([0, duration ?? 0]);
      const [from, to] = [Math.min(...spans.map(([first]) => first)), Math.max(...spans.map(([, last]) => last))];
      if (!spans.length || !(to > from)) return [spans.length ? from : 0, (spans.length ? from : 0) + 1];
      return [this.isLive && this.last ? to - this.last : from, to];
    },
    // The cursor and the present time, in all panes; and marks of the timeline.
    follow() {
      const { live, duration, marks = [] } = rv.clock.state;
      if (this.marked !== String(marks)) {
        this.marked = String(marks);
        this.draw();
      }
      const isLive = live === true || duration == null; // it grows
      if (isLive !== this.isLive) {
        this.isLive = isLive;
        this.request();
      }
      const present = this.present();
      for (const [id, chart] of this.charts) {
        const [, now, pointed] = chart.element.parentElement.children;
        for (const [line, time] of [[now, present], [pointed, rv.cursor.at]]) {
          const place = time == null ? null : chart.placeOf(time);
          line.style.display = place ? "block" : "none";
          if (place) line.style.transform = `translate(${place[0]}px, ${place[1] ?? 0}px)`;
          line.classList.toggle("rv-dot", place?.length === 2);
        }
      }
      const at = rv.cursor.at ?? present ?? this.extent()[1];
      if (at === this.now) return;
      this.now = at;
      if (this.names.length) this.askValues();
    },
    zoom(pane, kind, range) {
      if (kind === "time") this.window = this.tools.readable(range);
      else pane[kind] = range[0] <= 0 && range[1] >= 100 ? null : range;
      const [first, last] = this.extent();
      if (kind === "time" && this.window && this.window[0] <= first && this.window[1] >= last) this.window = null;
      this.keep();
      this.request();
      this.draw();
    },
    fit() {
      this.window = null;
      for (const pane of this.panes) pane.x = pane.y = null;
      this.keep();
      this.request();
      this.draw();
    },
    press(event) {
      const [from, to] = this.window ?? this.extent();
      const by = { "+": [0.25, -0.25], "-": [-0.5, 0.5], PageUp: [-0.5, -0.5], PageDown: [0.5, 0.5] }[event.key];
      if (event.key === "f") this.fit();
      else if (by) this.zoom(null, "time", [from + by[0] * (to - from), to + by[1] * (to - from)]);
      else return;
      event.preventDefault();
      event.stopPropagation();
    },
    // Fields are asked for one after another: of one topic now, and of all others when words are typed.
    want(topic) {
      const unknown = Object.keys(this.topics).filter((one) => !this.fields[one] && !this.wanted.includes(one));
      if (topic) this.wanted = [topic, ...this.wanted.filter((one) => one !== topic)];
      else this.wanted.push(...unknown);
      const next = this.wanted.find((one) => !this.fields[one]);
      if (next && next !== this.asking) this.live.send({ fields: (this.asking = next) });
    },
    toggle(name) {
      const there = this.panes.find(({ curves }) => curves.includes(name));
      if (there) this.remove(there, name);
      else this.add(name, this.panes.findLast(({ kind }) => kind === "time"));
    },
    add(name, pane) {
      this.change(() => {
        if (!pane) this.panes.push(paneOf({ curves: [name] }));
        else if (!pane.curves.includes(name)) pane.curves.push(name);
      });
    },
    remove(pane, name) {
      this.change(() => (pane.curves = pane.curves.filter((one) => one !== name)));
    },
    actsOf(pane, name) {
      const own = formula(name);
      const also = (text) => () => this.add(`=${text}`, pane.kind === "time" ? pane : null);
      const angles = NUMBERS.test(name) ? ["roll", "pitch", "yaw"].map((one) => [one[0].toUpperCase() + one.slice(1), also(`${one}("${name.slice(0, -2)}")`)]) : [];
      const apart = (kind) => () => this.change(() => this.panes.push(paneOf({ kind, curves: [name] })));
      return [
        ["Derivative", also(`derivative(${own})`)],
        ["Integral", also(`integral(${own})`)],
        ["Moving average, 1 s", also(`mean(${own}, 1)`)],
        ["Unwrap angle", also(`unwrap(${own})`)],
        ...angles,
        ["Spectrum", apart("spectrum")],
        ["Show in a new pane", apart("time")],
        ["Edit as expression", () => this.edit(name, pane)],
      ];
    },
    edit(name, pane = null) {
      Object.assign(this, { isEditing: true, text: name ? formula(name) : "" });
      this.edited = { name, pane };
    },
    apply() {
      const made = `=${this.text.trim()}`;
      const { name, pane } = this.edited;
      this.isEditing = false;
      if (made === "=") return;
      if (name) this.change(() => (pane.curves = [...new Set(pane.curves.map((one) => (one === name ? made : one)))]));
      else this.add(made, this.panes.findLast(({ kind }) => kind === "time"));
    },
    drag(event, name) {
      event.dataTransfer.setData("text/rv-topic", name.startsWith("=") ? name : name.replace(/:(?=[^:]*$)/, "."));
    },
    // A field, an array or a topic: their numbers, or those of the topic to choose from.
    async drop(event, pane = null) {
      const text = event.dataTransfer.getData("text/rv-topic");
      const to = pane ?? null;
      if (text.startsWith("=")) return this.add(text, to);
      const [topic, path] = rv.dropped(event, this.topics);
      if (!topic) return;
      if (!path) return Object.assign(this, { sought: topic, isAdding: true });
      const paths = await this.pathsOf(topic);
      const inside = paths.includes(path) ? [path] : paths.filter((one) => one.startsWith(path) && ".[".includes(one[path.length]));
      if (!inside.length) return this.add(`${topic}:${path}`, to);
      this.change(() => {
        const there = to ?? (this.panes.push(paneOf()), this.panes.at(-1));
        there.curves = [...new Set([...there.curves, ...inside.slice(0, ELEMENTS).map((one) => `${topic}:${one}`)])];
      });
    },
    async pathsOf(topic) {
      this.want(topic);
      for (let i = 0; i < 40 && !this.fields[topic]; i++) await new Promise((done) => setTimeout(done, 50));
      return this.fields[topic]?.paths ?? [];
    },
    saveCsv() {
      const [from, to] = this.window ?? [null, null];
      this.csv = [];
      this.live.send({ csv: this.names, from, to });
    },
    takeTable(piece) {
      if (piece) return this.csv.push(piece);
      this.save(new Blob(this.csv, { type: "text/csv" }), "csv");
      this.csv = [];
    },
    async savePicture(kind) {
      const charts = this.panes.filter(({ curves }) => curves.length).map(({ id }) => this.charts.get(id));
      if (!charts.length) return;
      const svg = this.tools.svgOf(charts, 900, Math.max(220, Math.round(600 / charts.length)));
      this.save(kind === "svg" ? new Blob([svg], { type: "image/svg+xml" }) : await this.tools.pngOf(svg), kind);
    },
    save(data, kind) {
      const link = Object.assign(document.createElement("a"), { href: URL.createObjectURL(data), download: `plot.${kind}` });
      link.click();
      setTimeout(() => URL.revokeObjectURL(link.href), 60_000);
    },
  },
};
