"""The page's style, where it differs from viser's."""

_SHEET = ".mantine-Paper-root:has(> div > .mantine-ScrollArea-root)"
_BODY = '[style*="grid-template-rows: 1fr"]'
"""The sheet on a phone, and in it the elements of the main panel, beside the windows."""

STYLE = f"""<style>
/* Scroll bars lie over what they scroll: thin ones beside it. */
.mantine-ScrollArea-root {{ --scrollarea-scrollbar-size: 8px !important; }}
[data-dock-region] .mantine-ScrollArea-root {{ container-type: size; }}
.rv-message {{ position: fixed; bottom: 1em; left: 1em; z-index: 100; max-width: 19em;
  margin: 0; padding: .4em .6em; border-left: 3px solid #fa5252;
  background: #3b2424; font-size: .8rem; overflow-wrap: anywhere; }}
.rv-message div + div {{ margin-top: .4em; padding-top: .4em; border-top: 1px solid #8883; }}
.rv-text {{ padding: 0 .8em .5em; font-size: .8rem; line-height: 1.45;
  container-type: inline-size; overflow-wrap: anywhere; }}
.rv-text p {{ margin: .4em 0; }}
/* A formula has lines of some 45 letters; where there is little room they are smaller. */
.rv-text pre {{ margin: .4em 0; padding: .4em .6em; background: #8882; overflow-x: auto;
  font-size: clamp(9px, 3.5cqi, 13px); }}
/* Windows share a column evenly, however often it was halved; where it is too low it scrolls. */
[data-dock-region="right"] [data-dock-scroll]:has(> [style*="flex: 0.25 "])
  > :is([style*="flex: 0.5 "], [style*="flex: 0.25 "]):has(> [data-dock-leaf]) {{
  flex-grow: .35 !important; }}
[data-dock-region="right"] [data-dock-scroll] > div:has(> [data-dock-leaf]) {{
  min-height: max(180px, calc((100vh - 50px) / 4)) !important; }}
[data-dock-region="right"] [data-dock-scroll] > div:has(> [data-dock-leaf]):has(.rv-text) {{
  min-height: 330px !important; }}
.rv-note {{ padding: 0 .8em .5em; font-size: .75rem; opacity: .65; overflow-wrap: anywhere; }}
.rv-upload {{ text-decoration: underline; cursor: pointer; }}
.rv-swatch {{ position: relative; height: 0; }}
.rv-swatch i {{ position: absolute; right: 1em; top: .55em; width: 2.6em; height: .45em;
  border-radius: .2em; }}
.rv-place {{ opacity: 1; font-variant-numeric: tabular-nums; }}
.rv-status {{ padding: .2em .8em .4em; font-size: .85rem; overflow-wrap: anywhere; }}
.rv-status.rv-failed {{ color: #ff8787; }}
.rv-pad {{ display: grid; grid-template-columns: repeat(3, 1fr); gap: 4px;
  padding: .3em .8em .5em; }}
.rv-pad button {{ padding: .45em .2em; border: 1px solid #8886; border-radius: 4px; color: inherit;
  background: #8882; font: inherit; font-size: .8rem; touch-action: none; user-select: none;
  -webkit-user-select: none; cursor: pointer; }}
.rv-pad button:last-child {{ grid-column: 1 / -1; }}
.rv-pad button.rv-held {{ background: #228be6; color: #fff; }}
.rv-pad kbd {{ margin-left: .5em; opacity: .5; font-size: .65rem; }}
/* On a phone all is in one sheet: playback, then the windows, then the folders. */
@media (max-width: 36em) {{
  {_SHEET} {{ width: 100% !important; max-height: var(--rv-sheet) !important; }}
  {_SHEET} div:has(> div > {_BODY}) {{ width: 100% !important; }}
  div:has(> {_BODY}) {{ display: flex; flex-direction: column; padding-bottom: .8em; }}
  div:has(> {_BODY}) > .mantine-Divider-root {{ margin-bottom: .5em; }}
  {_BODY}, {_BODY} > div, {_BODY} > div > div, {_BODY} > div > div > div, {_BODY} + div {{
    display: contents !important; }}
  {_BODY} + div > * {{ order: 1; }}
  {_BODY} > div > div > div > .mantine-Paper-root {{ order: 2; margin: .8em .8em 0; }}
}}
</style>"""

IMAGES_ALONE = """<style>
:root { --rv-sheet: 100dvh; }
/* Docked windows meet: viser keeps 120 pixels of the 3D scene free between them. */
@media (min-width: 37em) {
  [data-dock-root] { width: calc(100% + 116px) !important; }
  [data-dock-region="right"] { right: 116px !important; }
}
/* With images only, it does not matter how the 3D scene is drawn. */
#webgl-software-rendering { display: none; }
</style>"""
"""Beside `STYLE`, where nothing is drawn in 3D."""
