// The numbers of topics to choose from or to drag: found by words, arrays folded.
const MOST = 300; // lines
const FOLDED = 4; // elements from which on an array is one line

// Paths of a topic as lines: elements of an array, or the same field of them, are one.
function folded(paths) {
  const groups = new Map();
  for (const path of paths) {
    const key = path.replace(/\[\d+\]/, "[…]");
    groups.set(key, [...(groups.get(key) ?? []), path]);
  }
  return [...groups].flatMap(([key, all]) => (all.length > FOLDED ? [{ label: key, all }] : all.map((path) => ({ label: path, all: [path] }))));
}

export default {
  template: `
    <div class="rv-fields">
      <input ref="words" type="search" v-model="words" placeholder="Find a field" aria-label="Find a field" @focus="$emit('want')">
      <div class="rv-field-lines" role="tree" aria-label="Fields">
        <button v-for="line in lines" :key="line.key" role="treeitem" :class="{ 'rv-field': !line.topic, 'rv-on': chosen.includes(line.name) }"
          :aria-expanded="line.name ? undefined : String(!!opened[line.key])" :title="line.title" :draggable="true" @dragstart="drag($event, line)"
          @click="press(line)">{{ line.text }} <small>{{ line.note }}</small></button>
        <p v-if="!lines.length">{{ Object.keys(topics).length ? "Nothing found" : "No topics" }}</p>
      </div>
    </div>`,
  props: { topics: Object, fields: Object, chosen: Array, start: String },
  emits: ["want", "choose", "ready"],
  data() {
    return { words: this.start ?? "", opened: {} };
  },
  computed: {
    lines() {
      const found = [];
      const words = this.words.toLowerCase().split(/\s+/).filter(Boolean);
      const fits = (text) => words.every((word) => text.toLowerCase().includes(word));
      for (const [topic, type] of Object.entries(this.topics)) {
        const { paths, error } = this.fields[topic] ?? {};
        const inside = [];
        if (this.opened[topic] || words.length)
          for (const { label, all } of folded(paths ?? [])) {
            const key = `${topic}:${label}`;
            if (all.length > 1) {
              const some = words.length && !fits(key) ? all.filter((path) => fits(`${topic}:${path}`)) : all;
              if (!some.length) continue;
              inside.push({ key, text: label, note: all.length, title: "Show its elements" });
              if (this.opened[key] || some.length < all.length) inside.push(...some.map((path) => this.line(topic, path, "  ")));
            } else if (fits(key)) inside.push(this.line(topic, label));
          }
        if (!inside.length && !fits(topic)) continue;
        const note = this.opened[topic] && error ? error : type.split("/").at(-1);
        found.push({ key: topic, topic, text: topic, note, title: type }, ...inside);
        if (found.length > MOST) return found.slice(0, MOST);
      }
      return found;
    },
  },
  watch: {
    words() { this.$emit("want"); },
  },
  mounted() {
    this.$emit("ready");
    this.focus();
  },
  methods: {
    focus() {
      this.$refs.words.focus();
    },
    line(topic, path, space = "") {
      const { paths, units } = this.fields[topic];
      const name = `${topic}:${path}`;
      return { key: name, name, text: space + path, note: units?.[paths.indexOf(path)], title: "Click to plot, or drag to a pane" };
    },
    press(line) {
      if (line.name) return this.$emit("choose", line.name);
      if (line.topic) this.$emit("want", line.topic);
      this.opened[line.key] = !this.opened[line.key];
    },
    drag(event, line) {
      event.dataTransfer.setData("text/rv-topic", (line.name ?? line.key).replace(/\[…\].*/, "").replace(/:(?=[^:]*$)/, "."));
    },
  },
};
