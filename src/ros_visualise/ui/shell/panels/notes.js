// Notes: written as text, shown as Markdown; a time such as 1:23.5 in them is a button that goes there.
const WAIT_MS = 600;
const INLINE = /(`[^`]+`)|(\*\*[^*]+\*\*)|(\*[^*\s][^*]*\*)|(\b(?:\d+:)?\d{1,3}:[0-5]\d(?:\.\d+)?\b)/g;

const seconds = (time) => time.split(":").reduce((sum, part) => 60 * sum + Number(part), 0);

// A line as pieces: [kind, text].
function pieces(line) {
  const found = [];
  let from = 0;
  for (const match of line.matchAll(INLINE)) {
    if (match.index > from) found.push(["", line.slice(from, match.index)]);
    const [text, code, bold, italic] = match;
    found.push(code ? ["code", text.slice(1, -1)] : bold ? ["b", text.slice(2, -2)] : italic ? ["i", text.slice(1, -1)] : ["time", text]);
    from = match.index + text.length;
  }
  return [...found, ["", line.slice(from)]].filter(([, text]) => text);
}

// The blocks of a Markdown text: headings, lists, code and paragraphs.
function blocks(text) {
  const found = [];
  let code = null;
  for (const line of text.split("\n")) {
    const heading = /^(#{1,4}) +(.*)/.exec(line);
    const item = /^\s*([-*+]|\d+[.)]) +(.*)/.exec(line);
    if (line.startsWith("```")) {
      if (code === null) found.push({ tag: "pre", lines: (code = []) });
      else code = null;
    } else if (code) code.push([["", line + "\n"]]);
    else if (heading) found.push({ tag: "h" + (heading[1].length + 2), lines: [pieces(heading[2])] });
    else if (item) {
      const tag = /\d/.test(item[1]) ? "ol" : "ul";
      if (found.at(-1)?.tag !== tag) found.push({ tag, lines: [] });
      found.at(-1).lines.push(pieces(item[2]));
    } else if (!line.trim()) found.push({ tag: "" });
    else if (found.at(-1)?.tag === "p") found.at(-1).lines.push(pieces(line));
    else found.push({ tag: "p", lines: [pieces(line)] });
  }
  return found.filter(({ tag }) => tag);
}

const Inline = {
  props: { pieces: Array, readOnly: Boolean },
  template: `<template v-for="([kind, text], i) in pieces" :key="i"><button v-if="kind === 'time'" class="rv-link" :disabled="readOnly" title="Go there" @click="go(text)">{{ text }}</button>
    <component v-else-if="kind" :is="kind">{{ text }}</component><template v-else>{{ text }}</template></template>`,
  methods: { go: (text) => rv.clock.seek(seconds(text)) },
};

export default {
  components: { Inline },
  template: `
    <div class="rv-notes">
      <div class="rv-bar-top">
        <q-btn flat dense no-caps size="sm" :icon="isEdited ? 'visibility' : 'edit'" :label="isEdited ? 'Read' : 'Edit'" :disable="readOnly" @click="edit" />
        <q-btn v-if="isEdited" flat dense no-caps size="sm" icon="schedule" label="Time" title="Insert the current time" @mousedown.prevent @click="insert" />
        <span class="rv-space"></span><small :title="file && 'Saved beside the recording'">{{ isSaved ? file || "Not saved: no file" : "…" }}</small>
      </div>
      <textarea v-if="isEdited" ref="area" v-model="text" aria-label="Notes" maxlength="50000" placeholder="Text or Markdown" @input="write"></textarea>
      <div v-else class="rv-text" aria-label="Notes">
        <p v-if="!text" class="rv-note">No notes yet.</p>
        <component v-for="({ tag, lines }, i) in shown" :key="i" :is="tag">
          <template v-if="tag === 'ul' || tag === 'ol'"><li v-for="(line, j) in lines" :key="j"><Inline :pieces="line" :read-only="readOnly" /></li></template>
          <template v-else v-for="(line, j) in lines" :key="j"><br v-if="j && tag === 'p'"><Inline :pieces="line" :read-only="readOnly" /></template>
        </component>
      </div>
    </div>`,
  props: { state: Object, readOnly: Boolean },
  data: () => ({ text: "", file: "", isEdited: false, isSaved: true }),
  computed: { shown() { return blocks(this.text); } },
  mounted() {
    this.by = Math.random().toString(36).slice(2);
    this.socket = rv.live("/live/notes", { open: () => this.isSaved || this.send(), message: (all) => all.forEach(this.hear) });
  },
  beforeUnmount() {
    if (!this.isSaved) this.send();
    this.socket.close();
  },
  methods: {
    hear({ text, file, by }) {
      this.file = file;
      if (by === this.by) this.isSaved = text === this.text;
      else if (this.isSaved) this.text = text; // else ours comes after it
    },
    edit() {
      this.isEdited = !this.isEdited;
      if (this.isEdited) this.$nextTick(() => this.$refs.area.focus());
    },
    write() {
      this.isSaved = false;
      clearTimeout(this.waiting);
      this.waiting = setTimeout(this.send, WAIT_MS);
    },
    send() {
      clearTimeout(this.waiting);
      this.socket.send({ do: "write", text: this.text, by: this.by });
    },
    insert() {
      const { area } = this.$refs;
      const at = rv.clock.state.position ?? 0;
      const time = `${rv.asClock(at)} `;
      area.setRangeText(time, area.selectionStart, area.selectionEnd, "end");
      this.text = area.value;
      this.write();
    },
  },
};
