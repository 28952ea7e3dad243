// One picture of curves over time, drawn by uPlot: its lines stand for the lowest, the highest and the last value of each stretch.

import uPlot from "uplot";
import { counts, max_age, ring } from "./store.js";
import { add_ticks, extremes, nothing } from "./stretches.js";
import { date, figure } from "./words.js";
import { hole, look, Past, shown } from "./view.js";

const COLOURS = ["ink", "paper", "line", "grid", "muted", "c1", "c2", "c3", "c4", "c5", "c6", "s1", "s2", "bad"];
/** How wide lines are, as in the report. */
const WIDTH = 1.3;
let colours = null;

/** The colours of the style sheet, light or dark. */
function theme() {
  if (!colours) {
    const style = getComputedStyle(document.documentElement);
    colours = Object.fromEntries(COLOURS.map((name) => [name, style.getPropertyValue(`--${name}`).trim()]));
  }
  return colours;
}

const all = new Set();
for (const query of ["(prefers-color-scheme: dark)", "print"]) {
  matchMedia(query).addEventListener("change", () => {
    colours = null;
    all.forEach((chart) => chart.draw());
  });
}

/** A picture of `lines`, each `{ channel, label, colour, dash }`, with a `band` about one and shades where one is not 0. */
export class Chart {
  constructor(element, { lines, band, shade, limit, unit, height }) {
    Object.assign(this, { element, lines, band, shade, limit, hidden: new Set(), at: null, has_band: false, drawn: null, moved: () => {} });
    const beside = [band?.lower, band?.upper, band?.of, band?.std_dev, shade].filter((name) => name && !lines.some((of) => of.channel === name));
    this.channels = [...lines.map((of) => of.channel), ...new Set(beside)];
    this.past = new Past(this.channels);
    this.curves = null;
    this.range = [0, 1];
    const axis = { stroke: () => theme().ink, grid: { stroke: () => theme().grid, width: 1 }, ticks: { show: false }, font: "12px system-ui, sans-serif" };
    const options = {
      width: Math.max(element.clientWidth, 200),
      height,
      legend: { show: false },
      cursor: { sync: { key: "time" }, drag: { x: true, y: false, setScale: false }, points: { show: false }, y: false },
      select: { show: true, left: 0, top: 0, width: 0, height: 0 },
      scales: { x: { time: true, auto: false }, y: { auto: false } },
      axes: [
        { ...axis, space: 76, values: (_, instants, __, ___, step) => times(instants, step) },
        { ...axis, size: 62, label: unit || undefined, labelSize: 18, labelGap: 0, labelFont: "12px system-ui, sans-serif", values: (_, ticks, __, ___, step) => ticks.map((of) => mark(of, step)) },
      ],
      series: [{}, ...lines.map((line) => ({ label: line.label, stroke: () => theme()[line.colour], width: WIDTH, dash: line.dash, cap: "round", points: { show: false }, paths: this.paths(line.channel) }))],
      hooks: {
        drawClear: [() => this.behind()],
        setSelect: [(plot) => this.selected(plot)],
        setCursor: [(plot) => this.pointed(plot)],
      },
    };
    this.plot = new uPlot(options, [[], ...lines.map(() => [])], element);
    all.add(this);
  }

  remove() {
    all.delete(this);
    this.plot.destroy();
  }

  resize(width, height) {
    if (width > 0 && (width !== this.plot.width || height !== this.plot.height)) this.plot.setSize({ width, height });
  }

  /** Draws what is known now: only what is new, where the rest stands as it would be drawn. */
  draw(anew = true) {
    const [from, to] = shown();
    const scale = this.plot.scales.x;
    if (!anew && this.curves && scale.min === from && scale.max === to && this.add(from, to)) return;
    this.curves = this.past.curves(from, to);
    const nths = this.lines.flatMap((line, nth) => (this.hidden.has(line.channel) ? [] : [nth]));
    const found = extremes(this.curves, nths, from, to);
    if (found) this.range = roomy(this.with_band(found), this.range);
    const data = [this.curves.time, ...this.lines.map((_, nth) => this.curves.last[nth])];
    this.plot.batch(() => {
      this.plot.setData(data, false);
      this.plot.setScale("x", { min: from, max: to });
      this.plot.setScale("y", { min: this.range[0], max: this.range[1] });
    });
    this.drawn = this.curves.time[this.curves.time.length - 1] ?? null;
  }

  /** Adds what came since the last picture, unless it goes beyond it. */
  add(from, to) {
    const newest = ring.last();
    if (this.drawn === null || newest < this.drawn) return false;
    const pixel = (to - from) / this.plot.over.clientWidth;
    if (newest - this.drawn < 0.7 * pixel) return true;
    const fresh = add_ticks(nothing(this.channels), ring, this.channels, this.drawn - 1e-6, to, 1e-6);
    const seen = this.lines.flatMap((line, nth) => (this.hidden.has(line.channel) ? [] : [nth]));
    const found = extremes(fresh, seen, from, to);
    if (found && (found[0] < this.range[0] || found[1] > this.range[1])) return false;
    this.behind({ ...fresh, step: 0 }, false);
    const { ctx, bbox } = this.plot;
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    ctx.lineWidth = WIDTH * uPlot.pxRatio;
    ctx.lineJoin = ctx.lineCap = "round";
    // As uPlot moves them.
    ctx.translate((ctx.lineWidth % 2) / 2, (ctx.lineWidth % 2) / 2);
    for (const nth of seen) {
      ctx.strokeStyle = theme()[this.lines[nth].colour];
      ctx.setLineDash((this.lines[nth].dash ?? []).map((of) => of * uPlot.pxRatio));
      ctx.stroke(this.trace(this.plot, { ...fresh, step: 0 }, nth, 0));
    }
    ctx.restore();
    this.drawn = newest;
    return true;
  }

  show(channel, is_shown) {
    if (is_shown) this.hidden.delete(channel);
    else this.hidden.add(channel);
    const nth = this.lines.findIndex((line) => line.channel === channel);
    this.plot.setSeries(nth + 1, { show: is_shown });
    this.draw();
  }

  nth(channel) {
    return this.channels.indexOf(channel);
  }

  /** How a line is drawn: from the lowest to the highest of each stretch, broken at holes. One point alone is a dot. */
  paths(channel) {
    return (plot) => ({ stroke: this.trace(plot, this.curves, this.nth(channel)), fill: null, clip: null, band: null, gaps: null, flags: 1 });
  }

  trace(plot, curves, nth, dot = 0.5) {
    const path = new Path2D();
    if (!curves) return path;
    const { time, step } = curves;
    const [lowest, highest, last] = [curves.lowest[nth], curves.highest[nth], curves.last[nth]];
    const [at_x, at_y] = [this.to_x(plot), this.to_y(plot)];
    const lasts = max_age(this.channels[nth]);
    const limit = Math.max(hole(step), lasts);
    let [y, before] = [null, -Infinity];
    for (let at = 0; at < time.length; at += 1) {
      if (lowest[at] === null) {
        if (lasts === 0) y = null;
        continue;
      }
      if (time[at] - before > limit) y = null;
      before = time[at];
      const x = at_x(time[at]);
      const ends = [at_y(lowest[at]), at_y(highest[at])];
      if (y !== null && Math.abs(ends[1] - y) < Math.abs(ends[0] - y)) ends.reverse();
      if (y === null) path.moveTo(x - dot, ends[0]);
      path.lineTo(x, ends[0]);
      if (ends[1] !== ends[0]) path.lineTo(x, ends[1]);
      y = last[at] === null ? ends[1] : at_y(last[at]);
      if (y !== ends[1]) path.lineTo(x, y);
      if (last[at] === null && lasts === 0) y = null;
    }
    return path;
  }

  to_x(plot) {
    const { left, width } = plot.bbox;
    const { min, max } = plot.scales.x;
    return (value) => left + ((value - min) / (max - min)) * width;
  }

  to_y(plot) {
    const { top, height } = plot.bbox;
    const { min, max } = plot.scales.y;
    return (value) => top + ((max - value) / (max - min)) * height;
  }

  /** What lies behind the lines: shades where the correction is held, and the band of uncertainty. */
  behind(curves = this.curves, is_whole = true) {
    const plot = this.plot;
    if (!plot || !curves?.time.length) return;
    const { ctx, bbox } = plot;
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    if (this.shade) this.shades(plot, ctx, curves);
    if (this.band) this.banded(plot, ctx, curves);
    if (is_whole && this.limit !== undefined) {
      const y = this.to_y(plot)(this.limit);
      ctx.strokeStyle = theme().bad;
      ctx.setLineDash([5, 4]);
      ctx.beginPath();
      ctx.moveTo(bbox.left, y);
      ctx.lineTo(bbox.left + bbox.width, y);
      ctx.stroke();
    }
    ctx.restore();
  }

  shades(plot, ctx, { time, last, step }) {
    const why = last[this.nth(this.shade)];
    const at_x = this.to_x(plot);
    const limit = hole(step);
    ctx.fillStyle = theme().s1;
    for (let at = 0; at < time.length; at += 1) {
      if (!why[at]) continue;
      const begun = at;
      while (at + 1 < time.length && why[at + 1] && time[at + 1] - time[at] <= limit) at += 1;
      const next = at + 1 < time.length && time[at + 1] - time[at] <= limit ? time[at + 1] : time[at];
      const x = at_x(time[begun]);
      ctx.fillRect(x, plot.bbox.top, Math.max(1, at_x(next) - x), plot.bbox.height);
    }
  }

  banded(plot, ctx, curves) {
    const { time, step } = curves;
    const [at_x, at_y, limit] = [this.to_x(plot), this.to_y(plot), hole(step)];
    const edge = this.edges(curves);
    ctx.fillStyle = theme().c2;
    ctx.globalAlpha = 0.16;
    let piece = [];
    const fill = () => {
      if (piece.length > 1) {
        ctx.beginPath();
        piece.forEach(([x, , upper], nth) => (nth ? ctx.lineTo(x, upper) : ctx.moveTo(x, upper)));
        piece.reverse().forEach(([x, lower]) => ctx.lineTo(x, lower));
        ctx.fill();
      }
      piece = [];
    };
    for (let at = 0; at < time.length; at += 1) {
      const found = edge(at);
      this.has_band ||= Boolean(found);
      if (!found || (at > 0 && time[at] - time[at - 1] > limit)) fill();
      if (found) piece.push([at_x(time[at]), at_y(found[0]), at_y(found[1])]);
    }
    fill();
    ctx.globalAlpha = 1;
  }

  /** Lower and upper edge of the band at a point: as given, or two standard deviations about the prediction. */
  edges({ lowest, highest, last }) {
    const { lower, upper, of, std_dev } = this.band;
    if (lower && upper) {
      const [low, high] = [lowest[this.nth(lower)], highest[this.nth(upper)]];
      return (at) => (low[at] === null || high[at] === null ? null : [low[at], high[at]]);
    }
    const [middle, wide] = [last[this.nth(of)], highest[this.nth(std_dev)]];
    return (at) => (middle[at] === null || wide[at] === null ? null : [middle[at] - 2 * wide[at], middle[at] + 2 * wide[at]]);
  }

  /** Limits that show the band too, but not for the price of the curves: a band may be endless. */
  with_band([low, high]) {
    if (!this.band) return [low, high];
    const edge = this.edges(this.curves);
    const most = high - low || Math.abs(high);
    let [lower, upper] = [low, high];
    for (let at = 0; at < this.curves.time.length; at += 1) {
      const found = edge(at);
      if (found) [lower, upper] = [Math.min(lower, found[0]), Math.max(upper, found[1])];
    }
    return [Math.max(lower, low - most), Math.min(upper, high + most)];
  }

  selected(plot) {
    if (plot.select.width < 4) return;
    const [from, to] = [plot.posToVal(plot.select.left, "x"), plot.posToVal(plot.select.left + plot.select.width, "x")];
    plot.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
    look(from, to);
  }

  pointed(plot) {
    const at = plot.cursor.idx ?? null;
    if (at === this.at) return;
    this.at = at;
    this.moved();
  }

  /** The instant and the values under the pointer, or those of the last tick. */
  read() {
    if (this.at === null || !this.curves) return { time: null, is_pointed: false, values: this.lines.map((line) => counts(line.channel)) };
    const { time, last } = this.curves;
    return { time: time[this.at], is_pointed: true, values: this.lines.map((_, nth) => last[nth][this.at] ?? null) };
  }
}

/** Instants as they stand below a picture, with the day where it changes. */
function times(instants, step) {
  let day = date(Date.now() / 1000);
  return instants.map((of) => {
    const [on, at] = [date(of), new Date(of * 1000).toTimeString().slice(0, step < 60 ? 8 : 5)];
    const fraction = step < 1 ? (of % 1).toFixed(step < 0.1 ? 2 : 1).slice(1) : "";
    const is_new = on !== day;
    day = on;
    return is_new ? `${at}${fraction}\n${on}` : at + fraction;
  });
}

/** A mark beside a picture, with as many decimals as tell it from the next. */
function mark(value, step) {
  const decimals = Math.max(0, Math.ceil(-Math.log10(step) - 1e-9));
  return Math.abs(value) >= 1e6 || decimals > 4 ? figure(value, 4) : value.toFixed(decimals).replace("-", "−");
}

/** Limits with room about what is drawn, which stay while they fit: a picture that shakes cannot be read. */
function roomy([low, high], [from, to]) {
  const size = high - low || Math.abs(high) || 1;
  const fits = low >= from && high <= to && size > 0.5 * (to - from);
  return fits ? [from, to] : [low - 0.12 * size, high + 0.12 * size];
}
