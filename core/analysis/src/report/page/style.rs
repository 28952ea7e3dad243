//! How the page looks and how its pictures are zoomed.

pub(super) const STYLE: &str = "\
body{font:16px/1.5 system-ui,sans-serif;color:var(--ink);background:var(--paper);max-width:1100px;margin:0 auto;padding:1rem}\
h1{font-size:1.6rem;margin:.2rem 0}h2{font-size:1.2rem;margin:2rem 0 .4rem;border-bottom:1px solid var(--grid)}h3{font-size:1rem;margin:1rem 0 .2rem}\
p,ul{margin:.4rem 0}ul{padding-left:1.2rem}.muted{color:var(--muted);font-size:.9rem}.good{color:var(--good)}.bad{color:var(--bad)}\
.wide{overflow-x:auto}.wide svg.chart{min-width:620px;width:100%;display:block}\
table{border-collapse:collapse;font-variant-numeric:tabular-nums;font-size:.9rem}th,td{padding:.15rem .6rem;text-align:right;border-bottom:1px solid var(--grid);white-space:nowrap}\
th:first-child,td:first-child,.left{text-align:left}summary{cursor:pointer;font-weight:600;padding:.3rem 0}td.left{white-space:normal}\
th{white-space:normal;vertical-align:bottom}.verdicts{list-style:none;padding:0}.verdicts li{margin:.15rem 0}.at-large svg,.at-small svg{width:100%;display:block}.at-small,.more{display:none}\
.wide.scrolls{box-shadow:inset -10px 0 8px -8px var(--muted)}.wide.scrolls+.more{display:block}\
@media(max-width:600px){body{padding:.6rem}.at-large{display:none}.at-small{display:block}}\
.pair{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(100%,320px),1fr));gap:.6rem}.pair svg.chart{width:100%}\
@media print{body{max-width:none;font-size:11pt}.wide{overflow:visible}.wide svg.chart{min-width:0}table{font-size:7.5pt}th,td{padding:.1rem .3rem}svg,tr{break-inside:avoid}h2,h3,summary{break-after:avoid}.screen{display:none}}";

/// Zooming: dragging, the wheel about the pointer, double click for all. All charts of time move together. For print, all is unfolded.
pub(super) const SCRIPT: &str = r#"const wide=()=>document.querySelectorAll('.wide').forEach(w=>w.classList.toggle('scrolls',w.scrollWidth>w.clientWidth+1));
addEventListener('resize',wide);document.querySelectorAll('details').forEach(d=>d.addEventListener('toggle',wide));wide();addEventListener('beforeprint',()=>document.querySelectorAll('details').forEach(d=>{d.open=true}));(()=>{const all=[...document.querySelectorAll('svg.zoom')].map(s=>{const b=s.viewBox.baseVal;
return{s,w:b.width,h:b.height,x0:+s.dataset.x0,x1:+s.dataset.x1,g:s.parentNode.querySelector('g.ticks')}});if(!all.length)return;
let lo=Math.min(...all.map(c=>c.x0)),hi=Math.max(...all.map(c=>c.x1));const full=[lo,hi];
const nice=r=>{const p=10**Math.floor(Math.log10(r));return[1,2,5,10].map(n=>n*p).find(n=>n>=r)};
const draw=()=>all.forEach(c=>{const k=c.w/(c.x1-c.x0),x=(lo-c.x0)*k,w=(hi-lo)*k;c.s.setAttribute('viewBox',`${x} 0 ${w} ${c.h}`);
const st=nice((hi-lo)/3600/8),t=c.g.firstElementChild,y=t?t.getAttribute('y'):0;let o='';
for(let v=Math.ceil(lo/3600/st)*st;v<=hi/3600+1e-9;v+=st)o+=`<text x="${(62+(v*3600-lo)/(hi-lo)*c.w).toFixed(1)}" y="${y}" text-anchor="middle">${+v.toFixed(4)}</text>`;
if(o)c.g.innerHTML=o});let due=0;const later=()=>{if(!due){due=1;requestAnimationFrame(()=>{due=0;draw()})}};
const set=(a,b)=>{const w=Math.min(Math.max(b-a,300),full[1]-full[0]);lo=Math.min(Math.max(a,full[0]),full[1]-w);hi=lo+w;later()};
all.forEach(c=>{const p=c.s.parentNode,at=e=>{const r=p.getBoundingClientRect(),k=r.width/p.viewBox.baseVal.width;return lo+((e.clientX-r.left)/k-62)/c.w*(hi-lo)};
p.style.touchAction='pan-x pan-y';p.addEventListener('wheel',e=>{if(!e.ctrlKey&&!e.shiftKey)return;e.preventDefault();const m=at(e),f=e.deltaY+e.deltaX>0?1.25:.8;set(m-(m-lo)*f,m+(hi-m)*f)},{passive:false});
let from=null;p.addEventListener('pointerdown',e=>{if(e.pointerType!=='touch'){from=at(e);e.preventDefault()}});
p.addEventListener('pointerup',e=>{if(from===null)return;const to=at(e);if(Math.abs(to-from)>(hi-lo)/100)set(Math.min(from,to),Math.max(from,to));from=null});
p.addEventListener('dblclick',()=>set(...full))})})();"#;
