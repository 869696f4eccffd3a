"""Style of the page on screen and on paper: Okabe and Ito's colours, always together with a shape."""

from __future__ import annotations

BLUE, SKY, ORANGE, VERMILION, YELLOW, PURPLE, GREEN = (
    *("#0072B2", "#56B4E9", "#E69F00", "#D55E00", "#F0E442", "#CC79A7", "#009E73"),
)
INK, GREY = "#111", "#6b6f76"
ERROR = "#0b6e99"
"""Ellipses of predicted errors."""

STATES = {
    "RUNNING": (SKY, INK),
    "PAUSED": (YELLOW, INK),
    "HELD": (VERMILION, "#fff"),
    "HOMING": (PURPLE, INK),
}
"""Background and text of each state of a run."""

ANSWERS = {"yes": BLUE, "no": "#B34700", "unknown": "#5b5b5b"}
"""Background of the verdict; white text on each has a contrast of at least 4.5:1."""

STYLE = """
:root { color-scheme: light; }
* { box-sizing: border-box; -webkit-print-color-adjust: exact; print-color-adjust: exact; }
body { font: 14px/1.4 system-ui, 'DejaVu Sans', Helvetica, Arial, sans-serif; color: #111; background: #fff;
  max-width: 1180px; margin: 0 auto; padding: 20px; }
h1 { font-size: 20px; margin: 0 0 12px; } h2 { font-size: 16px; margin: 24px 0 8px; }
h1 small { font-weight: normal; color: #5a5e66; font-size: 13px; }
.band { color: #fff; border-radius: 6px; padding: 12px 16px; font-size: 17px; margin-bottom: 12px; }
.tiles { display: flex; flex-wrap: wrap; gap: 8px; margin-bottom: 12px; }
.tile { border: 1px solid #c9ccd2; border-radius: 6px; padding: 8px 12px; min-width: 130px; }
.tile b { display: block; font-size: 21px; line-height: 1.2; } .tile small { color: #5a5e66; }
.states { display: flex; height: 18px; font-size: 11px; overflow: hidden; border-radius: 3px; }
.states div { overflow: hidden; white-space: nowrap; padding: 1px 3px; border-right: 1px solid #fff; }
.legend { font-size: 12px; color: #333; margin: 6px 0 10px; }
.legend svg { vertical-align: -2px; margin: 0 4px 0 12px; }
svg.plan { width: 100%; max-height: 760px; display: block; }
table { border-collapse: collapse; font-size: 13px; }
th { text-align: left; border-bottom: 1.5px solid #888; } td { border-bottom: 1px solid #dcdee2; }
th, td { padding: 3px 8px; vertical-align: top; } .number { text-align: right; white-space: nowrap; }
tr.missing td { background: #fde8dc; font-weight: 600; }
.columns { display: flex; flex-wrap: wrap; gap: 0 40px; align-items: flex-start; }
.bar { width: 130px; height: 9px; background: #e8e9ec; position: relative; margin-top: 5px; }
.bar div { height: 100%; }
.bar i { position: absolute; top: -2px; bottom: -2px; width: 2px; background: #111; }
.scroll { overflow-x: auto; }
.plots figure, .columns section { max-width: 100%; overflow-x: auto; }
.plots { display: flex; flex-wrap: wrap; gap: 16px; }
figure { margin: 0; } figcaption { font-size: 12px; color: #333; }
ul { margin: 0; padding-left: 20px; } code { font-size: 12px; word-break: break-all; }
@page { size: A4; margin: 12mm 12mm 15mm;
  @bottom-right { content: counter(page) " / " counter(pages); font: 10px sans-serif; } }
@media print { body { max-width: none; padding: 0; font-size: 10.5px; } table { font-size: 9.5px; }
  h2 { break-after: avoid; } tr, .tile, .band, figure, svg.plan { break-inside: avoid; }
  thead { display: table-header-group; }
  .run { break-before: page; } .run:first-of-type { break-before: auto; }
  svg.plan { max-height: 170mm; min-width: 0 !important; } small { font-size: 9.6px !important; }
  .scroll, .columns section { overflow: visible; } code { font-size: 9.5px; }
  .band { font-size: 13px; padding: 8px 12px; } .tile { min-width: 0; padding: 4px 8px; }
  .tile b { font-size: 14px; } .plots svg { width: 88mm; height: auto; } .plots { gap: 3mm; }
  .columns { gap: 0 8mm; } .bar { width: 90px; } h2 { font-size: 13px; margin: 12px 0 4px; } }
"""
