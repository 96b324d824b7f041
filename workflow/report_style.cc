#include "workflow/report_style.h"

namespace roomtex {

const char kReportStyle[] = R"(
:root {
  --ground: #ffffff; --raised: #f3f5f8; --line: #d5dbe3; --text: #1a2027; --quiet: #566270;
  --good: #17693a; --warn: #8a5500; --bad: #a8201a; --accent: #1f5f99;
  color-scheme: light dark;
  font: 16px/1.5 system-ui, "Segoe UI", Roboto, "Helvetica Neue", "DejaVu Sans", Arial, sans-serif;
}
@media (prefers-color-scheme: dark) {
  :root {
    --ground: #16191f; --raised: #20252e; --line: #3a4250; --text: #edf0f5; --quiet: #aeb7c6;
    --good: #7ee787; --warn: #ffc46b; --bad: #ff9d90; --accent: #8fc7ff;
  }
}
* { box-sizing: border-box; }
body { margin: 0; background: var(--ground); color: var(--text); }
main { max-width: 1080px; margin: 0 auto; padding: 32px 24px 64px; }
h1 { font-size: 1.7rem; line-height: 1.25; margin: 4px 0 8px; }
h2 { font-size: 1.2rem; margin: 44px 0 10px; }
h3 { font-size: 1rem; margin: 18px 0 6px; }
p { margin: 0 0 10px; max-width: 76ch; }
.quiet { color: var(--quiet); }
.small { font-size: .875rem; }
header { border-left: 6px solid var(--accent); padding: 6px 0 6px 20px; }
header.trusted { border-color: var(--good); }
header.untrusted, header.unfinished { border-color: var(--warn); }
header.failed { border-color: var(--bad); }
header .state { font-weight: 650; margin: 0; }
header.trusted .state { color: var(--good); }
header.untrusted .state, header.unfinished .state { color: var(--warn); }
header.failed .state { color: var(--bad); }
dl.facts { display: grid; grid-template-columns: repeat(auto-fit, minmax(210px, 1fr)); gap: 1px;
  margin: 24px 0 0; background: var(--raised); border: 1px solid var(--line); border-radius: 8px; overflow: hidden; }
dl.facts div { padding: 10px 14px; box-shadow: 0 0 0 1px var(--line); }
dl.facts dt { color: var(--quiet); font-size: .875rem; }
dl.facts dd { margin: 0; font-weight: 600; }
.todo { background: var(--raised); border: 1px solid var(--line); border-radius: 8px; padding: 12px 16px; margin-top: 20px; }
.todo h2 { margin-top: 0; }
.todo li { margin-bottom: 8px; }
code, pre { font: .8125rem/1.5 ui-monospace, "SF Mono", Menlo, Consolas, "DejaVu Sans Mono", monospace; }
code { overflow-wrap: anywhere; }
pre { background: var(--raised); border: 1px solid var(--line); border-radius: 8px; padding: 10px 12px; margin: 6px 0;
  white-space: pre-wrap; overflow-wrap: anywhere; }
figure { margin: 0 0 18px; break-inside: avoid; }
figure img { display: block; width: 100%; height: auto; border-radius: 6px; background: #303030; }
figcaption { color: var(--quiet); font-size: .875rem; margin-top: 4px; }
.two { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(440px, 100%), 1fr)); gap: 0 20px; align-items: start; }
svg.plan { display: block; width: 100%; max-height: 640px; background: var(--raised); border: 1px solid var(--line); border-radius: 8px; }
svg.plan text { font: 600 15px system-ui, "DejaVu Sans", sans-serif; text-anchor: middle; dominant-baseline: central; fill: var(--text); }
svg .camera path { fill: var(--text); fill-opacity: .1; stroke: var(--text); stroke-opacity: .55; stroke-width: 1.2; }
svg .camera circle { fill: var(--text); stroke: var(--ground); stroke-width: 1.5; }
svg .camera text { paint-order: stroke; stroke: var(--ground); stroke-width: 4px; }
svg .place path { stroke: var(--text); stroke-width: 4; fill: none; }
svg .tip { fill: var(--text); }
svg .place circle { fill: var(--ground); stroke: var(--text); stroke-width: 3; }
svg.site .room { fill: none; stroke: var(--text); stroke-opacity: .6; stroke-width: 1.5; }
svg.site .room.doubted { stroke: var(--bad); stroke-opacity: 1; stroke-width: 3; stroke-dasharray: 9 6; }
svg.site .name text { paint-order: stroke; stroke: var(--ground); stroke-width: 5px; font-size: 18px; }
svg.site .door { fill: var(--ground); stroke: var(--text); stroke-width: 3; }
svg.site .door.doubted { stroke: var(--bad); }
.plans { display: flex; flex-wrap: wrap; align-items: flex-end; gap: 0 20px; }
.plans svg.plan { width: auto; max-width: 100%; height: auto; }
svg .scale path { stroke: var(--text); stroke-width: 3; }
.key { display: flex; flex-wrap: wrap; gap: 4px 18px; margin: 8px 0; font-size: .875rem; color: var(--quiet); }
.key i { display: inline-block; width: 14px; height: 14px; border-radius: 3px; margin-right: 6px; vertical-align: -2px; }
.ramp { display: inline-block; width: 110px; height: 12px; border-radius: 3px; margin: 0 8px; vertical-align: -1px;
  background: linear-gradient(90deg, #3b78b5, #c93535); }
.table { overflow-x: auto; }
table { border-collapse: collapse; width: 100%; font-size: .875rem; font-variant-numeric: tabular-nums; }
th { text-align: left; font-weight: 600; color: var(--quiet); border-bottom: 2px solid var(--line); padding: 6px 10px 6px 0; vertical-align: bottom; }
td { border-bottom: 1px solid var(--line); padding: 5px 10px 5px 0; vertical-align: top; }
td.n, th.n { text-align: right; white-space: nowrap; }
svg.map { display: block; background: var(--raised); border: 1px solid var(--line); }
td.state { font-weight: 600; white-space: nowrap; }
td.notes { min-width: 10rem; }
td.trusted { color: var(--good); }
td.untrusted, td.unfinished { color: var(--warn); }
td.failed { color: var(--bad); }
a { color: var(--accent); }
tr.out td { color: var(--bad); }
tr.best td { font-weight: 600; }
tr.sum td { font-weight: 600; border-bottom: 0; }
ul { padding-left: 22px; margin: 6px 0; }
@media (max-width: 640px) {
  main { padding: 18px 14px 48px; }
  h1 { font-size: 1.35rem; }
  header { padding-left: 14px; }
  dl.facts { grid-template-columns: 1fr 1fr; }
  dl.facts div { padding: 8px 10px; }
}
@media print {
  :root { --ground: #fff; --raised: #fff; --line: #c4c9d0; --text: #000; --quiet: #444; --good: #17693a; --warn: #8a5500;
    --bad: #a8201a; --accent: #1f5f99; font-size: 11pt; color-scheme: light; }
  @page { margin: 16mm 14mm; }
  * { print-color-adjust: exact; -webkit-print-color-adjust: exact; }
  main { max-width: none; padding: 0; }
  h2, h3, h2 + p, h3 + p { break-after: avoid; }
  h2 { margin-top: 26px; }
  tr, .todo, dl.facts div, pre { break-inside: avoid; }
  .table { overflow: visible; }
  table { font-size: 7.5pt; }
  th, td { padding-right: 6px; }
  figure { margin-bottom: 10px; }
  figure img { width: auto; max-width: 100%; max-height: 44mm; }
  .two figure img { max-height: none; }
  .two { grid-template-columns: 1fr 1fr; }
  svg.plan { max-height: 110mm; }
}
)";

}  // namespace roomtex
