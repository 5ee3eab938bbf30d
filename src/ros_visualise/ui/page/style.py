"""How the page looks beyond what viser does by itself."""

STYLE = """<style>
/* An image fills its window's width; in a docked window it also stays in view as a whole. */
img[src^="blob:"] { width: 100%; object-fit: contain; }
[data-dock-region] .mantine-ScrollArea-root { container-type: size; }
[data-dock-region] img[src^="blob:"] { max-height: max(120px, calc(100cqh - 110px)) !important; }
/* With images only, it does not matter how the 3D scene is drawn. */
#webgl-software-rendering { display: none; }
.rv-caption { display: flex; justify-content: space-between; gap: 1em; padding: 0 .6em .4em;
  font-size: .75rem; opacity: .65; }
.rv-message { margin: 0 .6em .5em; padding: .4em .6em; border-left: 3px solid #fa5252;
  background: #fa525222; font-size: .8rem; overflow-wrap: anywhere; }
.rv-note { padding: 0 .6em .4em; font-size: .75rem; opacity: .65; overflow-wrap: anywhere; }
table.rv-topics { width: calc(100% - 1.2em); margin: 0 .6em .4em; border-collapse: collapse;
  font-size: .75rem; font-variant-numeric: tabular-nums; }
table.rv-topics th { font-weight: 500; opacity: .65; text-align: right; }
table.rv-topics td { text-align: right; padding: .15em 0 .15em .5em; border-top: 1px solid #8883;
  white-space: nowrap; vertical-align: top; }
table.rv-topics :is(th, td):first-child { text-align: left; padding-left: 0; white-space: normal;
  overflow-wrap: anywhere; }
table.rv-topics small { display: block; opacity: .55; font-size: .65rem; }
svg.rv-graph { display: block; width: calc(100% - 1.2em); max-width: 26em; margin: 0 auto .4em;
  font-family: inherit; }
</style>"""
