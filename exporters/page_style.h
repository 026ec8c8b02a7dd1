// How pages of report_html.h look.
#pragma once

namespace relief {

inline constexpr const char* kPageStyle = R"(
:root{color-scheme:light dark;--ink:#1f2328;--dim:#59636e;--page:#fff;--panel:#f6f8fa;--line:#d1d9e0;--bar:#0072b2}
@media(prefers-color-scheme:dark){
:root{--ink:#e6e9ed;--dim:#9aa4af;--page:#14171b;--panel:#1d2126;--line:#3a414a;--bar:#56b4e9}}
*{box-sizing:border-box}
body{font:15px/1.45 system-ui,sans-serif;max-width:1320px;margin:2em auto;padding:0 1em;color:var(--ink);background:var(--page)}
h1{font-size:26px;margin:0 0 .3em;overflow-wrap:break-word}
h2{font-size:20px;margin:2em 0 .6em;padding-bottom:.2em;border-bottom:1px solid var(--line)}
h3{font-size:15px;margin:1.2em 0 .4em}
table{border-collapse:collapse;margin:1em 0;font-size:13px}
th,td{border:1px solid var(--line);padding:2px 8px;text-align:left}
td{overflow-wrap:anywhere}
th{background:var(--panel)}
td.n{text-align:right;font-variant-numeric:tabular-nums;white-space:nowrap}
td:first-child{min-width:10em}
.scroll{overflow-x:auto}
.row{display:flex;flex-wrap:wrap;gap:12px;align-items:flex-start}
figure{margin:0;width:min-content}
figcaption{font-size:12px;color:var(--dim)}
svg.plot{max-width:100%;height:auto;background:var(--panel);color:var(--ink);font-family:system-ui,sans-serif;border-radius:6px}
svg.plot text{fill:var(--ink)}
svg.plot .grid{stroke:var(--line)}
svg.plot .axis{stroke:var(--ink)}
svg.plot .guide{stroke:var(--dim);fill:none;stroke-width:1.4;stroke-dasharray:6 4}
.cards{display:grid;grid-template-columns:repeat(auto-fit,minmax(150px,1fr));gap:10px;margin:1em 0}
.card{background:var(--panel);border-radius:6px;padding:8px 12px}
.card b{display:block;font-size:20px;font-weight:600;font-variant-numeric:tabular-nums}
.card span{font-size:12px;color:var(--dim)}
.note{font-size:12px;color:var(--dim);margin:.4em 0}
.stage{position:relative;--wipe:50%;width:min(100%,max(var(--width),640px),calc(80vh*var(--aspect)));
aspect-ratio:var(--aspect);margin:0 auto;background:#000;overflow:hidden;touch-action:pan-y;user-select:none}
.stage canvas{position:absolute;inset:0;width:100%;height:100%}
.stage canvas.second{clip-path:inset(0 0 0 var(--wipe))}
.stage .divider{position:absolute;top:0;bottom:0;left:var(--wipe);width:2px;margin-left:-1px;background:#fff;box-shadow:0 0 3px #000;cursor:ew-resize}
.stage .tag{position:absolute;bottom:8px;left:8px;max-width:45%;padding:1px 8px;border-radius:4px;font-size:12px;color:#fff;background:#000a;
overflow:hidden;text-overflow:ellipsis;white-space:nowrap;pointer-events:none}
.stage .right{left:auto;right:8px}
.controls{display:flex;flex-wrap:wrap;gap:6px 14px;align-items:center;margin-top:10px;font-size:13px}
.controls label{display:flex;gap:8px;align-items:center}
.controls input{width:220px}
.controls .stops{width:6em;font-variant-numeric:tabular-nums}
.controls .probe{font-variant-numeric:tabular-nums;color:var(--dim)}
.maps{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(100%,520px),1fr));gap:20px}
.maps figure{width:auto;min-width:0}
.map img{display:block;width:100%;height:auto;image-rendering:pixelated}
.map .scale{height:12px;margin-top:6px}
.map .ticks{position:relative;height:18px;font-size:11px;font-variant-numeric:tabular-nums}
.map .ticks span{position:absolute;top:2px;white-space:nowrap}
.map .unit{font-size:11px;text-align:center}
.halves{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(100%,520px),1fr));gap:8px 32px}
.bars{display:grid;grid-template-columns:minmax(9em,max-content) 1fr max-content;gap:4px 12px;align-items:center;font-size:13px}
.bars .bar{height:14px;background:var(--panel);border-radius:3px;overflow:hidden}
.bars .bar div{height:100%;background:var(--bar)}
.bars .amount{text-align:right;font-variant-numeric:tabular-nums}
pre{background:var(--panel);border-radius:6px;padding:8px 12px;font-size:13px;white-space:pre-wrap;overflow-wrap:anywhere}
details{margin:.4em 0;font-size:14px}
summary{cursor:pointer}
details ul{margin:.3em 0;font-size:13px}
)";

}  // namespace relief
