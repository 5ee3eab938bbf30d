// Search: pages that answer a question come before those that merely contain its words.
var Scorer = {
  folders: [
    ["howto/index", -9], ["tutorials/index", -9], ["reference/index", -9], ["howto/", 9], ["tutorials/", 8],
    ["generated/benchmarks", -9], ["generated/contributing", -9], ["changes", -20],
    ["generated/gallery/", 0], ["generated/lessons/", 2], ["generated/training", 0],
    ["reference/", 4], ["generated/", 4], ["explanation/", 2],
  ],
  score: ([page, title, , , score]) => {
    const query = new URLSearchParams(window.location.search).get("q") || "";
    const words = query.toLowerCase().split(/[^\p{L}\d_]+/u).filter((word) => word.length > 2);
    const said = words.map((word) => {
      const [stem] = word.match(/^.+?(?=(e?s|ing)?$)/);
      const found = title.toLowerCase().match(new RegExp(`${stem}(e?s|ing)?(\\p{L}?)`, "u"));
      return found ? (found[2] ? 0.5 : 1) : 0;
    });
    const [, more] = Scorer.folders.find(([folder]) => page.startsWith(folder)) ?? ["", 0];
    return score + more + (20 * said.reduce((sum, one) => sum + one, 0)) / Math.max(words.length, 1);
  },
  objNameMatch: 11,
  objPartialMatch: 6,
  objPrio: { 0: 15, 1: 5, 2: -5 },
  objPrioDefault: 0,
  title: 15,
  partialTitle: 7,
  term: 5,
  partialTerm: 2,
};
