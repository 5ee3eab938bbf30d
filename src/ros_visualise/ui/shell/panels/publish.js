// A form with the fields of a type: its message is published once, or at a rate while the panel is there.
const SECOND_MS = 1000;

// The value of a text field: JSON for lists and numbers, else the text.
function valueOf(field, text) {
  if (field.type === "string" || field.type === "wstring") return text;
  if (/^[+-]?(nan|inf)$/i.test(text)) return text;
  return JSON.parse(text || (Array.isArray(field.value) ? "[]" : "0"));
}

export default {
  template: `
    <div class="rv-publish">
      <p v-if="!offer.allowed || readOnly" class="rv-note">{{ readOnly ? "This page is read-only." : offer.reason }}</p>
      <p v-else-if="!offer.any && !Object.keys(offer.topics).length" class="rv-note">No node in this graph accepts messages from outside.</p>
      <template v-else>
        <label class="rv-field">Topic<input v-model.trim="topic" :list="id + 'topics'" placeholder="/cmd_vel" aria-label="Topic" @change="choose"></label>
        <label class="rv-field">Type<input v-model.trim="type" :list="id + 'types'" placeholder="geometry_msgs/msg/Twist" aria-label="Type" @change="describe"></label>
        <datalist :id="id + 'topics'"><option v-for="(kind, name) in offer.topics" :key="name" :value="name">{{ kind }}</option></datalist>
        <datalist :id="id + 'types'"><option v-for="name in offer.types" :key="name" :value="name"></option></datalist>
        <div class="rv-values" role="group" aria-label="Values">
          <template v-for="line in lines" :key="line.path">
            <div v-if="line.field.fields" class="rv-part" :style="{ paddingLeft: line.depth + 'em' }" :title="line.field.type">{{ line.field.name }}</div>
            <label v-else class="rv-field" :style="{ paddingLeft: line.depth + 'em' }" :title="line.field.type">{{ line.field.name }}
              <input v-if="line.field.type === 'bool'" type="checkbox" :checked="values[line.path] ?? line.field.value" :aria-label="line.path" @change="set(line, $event.target.checked)">
              <input v-else :value="texts[line.path] ?? written(line.field.value)" :aria-label="line.path" :aria-invalid="line.path in faults" @input="type_(line, $event.target.value)">
            </label>
          </template>
        </div>
        <div class="rv-actions">
          <q-btn outline dense no-caps label="Publish once" :disable="!ready" @click="publish(0)" />
          <q-btn outline dense no-caps :label="isOn ? 'Stop' : 'Repeat'" :color="isOn ? 'negative' : undefined" :disable="!ready && !isOn" @click="isOn ? stop() : publish(rate)" />
          <label class="rv-rate">at <input type="number" min="0.1" max="50" step="any" v-model.number="rate" aria-label="Rate in Hz"> Hz</label>
          <q-btn flat dense no-caps label="Clear" title="Reset to default values" @click="clear" />
        </div>
        <p class="rv-problem" role="alert">{{ problem }}</p>
        <p class="rv-note" role="status">{{ count ? count + (count === 1 ? " message" : " messages") + " published" : "" }}</p>
      </template>
    </div>`,
  props: { state: Object, readOnly: Boolean },
  data() {
    const { topic, type, rate, values } = this.state;
    const id = "rv" + Math.random().toString(36).slice(2);
    return { id, topic: String(topic ?? ""), type: String(type ?? ""), rate: Number(rate) || 10, values: { ...values }, texts: {}, faults: {},
      fields: [], described: "", offer: { topics: {}, types: [], reason: "" }, problem: "", count: 0, isOn: false };
  },
  computed: {
    lines() {
      const found = [];
      const walk = (fields, before, depth) => fields.forEach((field) => {
        const path = before + field.name;
        found.push({ field, path, depth });
        if (field.fields) walk(field.fields, path + ".", depth + 1);
      });
      walk(this.fields, "", 0);
      return found;
    },
    ready() {
      return this.topic.startsWith("/") && this.described === this.type && !!this.type && !Object.keys(this.faults).length;
    },
  },
  mounted() {
    for (const [path, value] of Object.entries(this.values)) this.texts[path] = this.written(value);
    this.socket = rv.live("/live/publish", { open: () => this.type && this.describe(), message: (all) => all.forEach(this.hear), closed: () => (this.isOn = false) });
  },
  beforeUnmount() {
    this.socket.close(); // which ends the rate
  },
  methods: {
    hear(news) {
      if ("allowed" in news) this.offer = { topics: {}, types: [], ...news };
      else if (news.fields) {
        if (news.type === this.type) [this.fields, this.described, this.problem] = [news.fields, news.type, ""];
      } else if (news.panel === undefined || news.panel === this.id) {
        if (news.problem) [this.problem, this.isOn] = [news.problem, false];
        else [this.count, this.problem] = [news.count, ""];
      }
    },
    written: (value) => (Array.isArray(value) ? JSON.stringify(value) : String(value)),
    choose() {
      if (this.offer.topics[this.topic]) this.type = this.offer.topics[this.topic];
      this.describe();
    },
    describe() {
      if (this.type !== this.described) [this.fields, this.described] = [[], ""];
      if (this.type) this.socket.send({ do: "describe", type: this.type, topic: this.topic });
      this.keep();
    },
    type_(line, text) {
      this.texts[line.path] = text;
      try {
        this.set(line, valueOf(line.field, text));
        delete this.faults[line.path];
      } catch {
        this.faults[line.path] = true;
      }
    },
    set(line, value) {
      this.values[line.path] = value;
      if (this.isOn) this.publish(this.rate);
      this.keep();
    },
    keep() {
      clearTimeout(this.keeping);
      this.keeping = setTimeout(() => rv.keep(this.$el, { topic: this.topic, type: this.type, rate: this.rate, values: this.values }), SECOND_MS);
    },
    message() {
      const made = {};
      const paths = new Set(this.lines.filter(({ field }) => !field.fields).map(({ path }) => path));
      for (const [path, value] of Object.entries(this.values)) {
        if (!paths.has(path)) continue; // of another type
        const names = path.split(".");
        const last = names.pop();
        names.reduce((inside, name) => (inside[name] ??= {}), made)[last] = value;
      }
      return made;
    },
    publish(rate) {
      if (!this.ready) return;
      this.isOn = rate > 0;
      this.socket.send({ do: "publish", panel: this.id, topic: this.topic, type: this.type, values: this.message(), rate });
    },
    stop() {
      this.isOn = false;
      this.socket.send({ do: "stop", panel: this.id });
    },
    clear() {
      [this.values, this.texts, this.faults] = [{}, {}, {}];
      this.keep();
    },
  },
};
