// Search: pages that answer a question come before those that merely contain its words.
var Scorer = {
  // Words of a question that say nothing about its answer.
  empty: new Set("any are can does for get has have how many may mean much should the what when where which who why you your".split(" ")),
  folders: [
    ["howto/index", -9], ["tutorials/index", -9], ["reference/index", -9], ["howto/", 9], ["tutorials/", 8],
    ["generated/benchmarks", -9], ["generated/contributing", -9], ["changes", -20],
    ["generated/gallery/", 0], ["generated/lessons/", 2], ["generated/training", 0],
    ["reference/", 4], ["generated/", 4], ["explanation/", 2],
  ],
  score: ([page, title, , , score]) => {
    const query = new URLSearchParams(window.location.search).get("q") || "";
    const words = query.toLowerCase().split(/[^\p{L}\d_]+/u).filter(Scorer.counts);
    const said = words.map((word) => {
      const [stem] = word.match(/^.+?(?=(e?s|ing)?$)/);
      const found = title.toLowerCase().match(new RegExp(`${stem}(e?s|ing)?(\\p{L}?)`, "u"));
      return found ? (found[2] ? 0.5 : 1) : 0;
    });
    const [, more] = Scorer.folders.find(([folder]) => page.startsWith(folder)) ?? ["", 0];
    return score + more + (20 * said.reduce((sum, one) => sum + one, 0)) / Math.max(words.length, 1);
  },
  counts: (word) => word.length > 2 && !Scorer.empty.has(word),
  objNameMatch: 11,
  objPartialMatch: 6,
  objPrio: { 0: 15, 1: 5, 2: -5 },
  objPrioDefault: 0,
  title: 15,
  partialTitle: 7,
  term: 5,
  partialTerm: 2,
};

// A page need not have all words of a question: it counts by the words that it has, rare ones most.
const pagesWith = Search.performTermsSearch;
Search.performTermsSearch = (terms, excluded) => {
  const asked = [...terms].filter(Scorer.counts);
  const found = asked.map((term) => pagesWith(new Set([term]), excluded));
  const rarity = found.map((pages) =>
    pages.length ? Math.log(1 + Search._index.docnames.length / pages.length) : 0,
  );
  const total = rarity.reduce((sum, one) => sum + one, 0);
  const ranked = new Map();
  found.forEach((pages, i) => {
    const share = rarity[i] / total;
    for (const page of pages) {
      const sum = ranked.get(page[0]) ?? { page, score: 0, share: 0 };
      ranked.set(page[0], { page, score: sum.score + share * page[4], share: sum.share + share });
    }
  });
  const best = Math.max(0, ...[...ranked.values()].map((one) => one.share));
  return [...ranked.values()]
    .filter((one) => one.share > 0.4 * best)
    .map(({ page, score, share }) => page.with(4, Math.round(score + 30 * share)));
};
