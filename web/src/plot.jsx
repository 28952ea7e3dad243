// A chart with its legend, which is a table of values, and the keys and fingers that move it.

import { useEffect, useReducer, useRef } from "preact/hooks";
import { Chart } from "./chart.js";
import { draws, soon } from "./draws.js";
import { live, look, pan, shown, view, zoom } from "./view.js";
import { ABSENT, clock, figure, lasting } from "./words.js";

const KEYS = {
  ArrowLeft: () => pan(-0.2), ArrowRight: () => pan(0.2), PageUp: () => pan(-1), PageDown: () => pan(1),
  "+": () => zoom(0.5), "=": () => zoom(0.5), "-": () => zoom(2), End: () => live(), Home: () => live(86400),
};

/** Lines over time, with their values. */
export function Plot({ name, lines, band, shade, limit, unit, height = 240 }) {
  const place = useRef(null);
  const chart = useRef(null);
  const [, again] = useReducer((n) => n + 1, 0);
  const key = JSON.stringify([lines, band, shade, limit, unit, height]);
  useEffect(() => {
    const made = new Chart(place.current, { lines, band, shade, limit, unit, height });
    chart.current = made;
    made.moved = again;
    const stop = draws(made, place.current);
    const sizes = new ResizeObserver(() => {
      made.resize(place.current.clientWidth, height);
      soon();
    });
    sizes.observe(place.current);
    const let_go = moves(place.current, made);
    return () => {
      stop();
      sizes.disconnect();
      let_go();
      made.remove();
      chart.current = null;
    };
  }, [key]);
  const pressed = (event) => {
    if (event.ctrlKey || event.altKey || event.metaKey || !KEYS[event.key]) return;
    event.preventDefault();
    KEYS[event.key]();
  };
  const read = chart.current?.read() ?? { time: null, values: [] };
  const [from, to] = shown();
  const notes = [unit && `in ${unit}`, chart.current?.has_band && "shaded: uncertainty", shade && "shaded: held or limited", read.is_pointed && `at ${clock(read.time)}`];
  const when = view.live ? `the last ${lasting(view.span)}, live` : `from ${clock(from)} to ${clock(to)}`;
  const words = `${name}, ${when}. Arrow keys move it, plus and minus zoom, End shows what is live.`;
  return (
    <figure class="plot">
      <div class="picture" ref={place} tabIndex={0} role="application" aria-roledescription="chart" aria-label={words} onKeyDown={pressed} />
      <figcaption>
        <ul class="legend">
          {lines.map((line, nth) => (
            <li key={line.channel}>
              <button type="button" class="entry" aria-pressed={!chart.current?.hidden.has(line.channel)}
                onClick={() => (chart.current?.show(line.channel, chart.current.hidden.has(line.channel)), again())}>
                <span class={`key ${line.colour}${line.dash ? " dashed" : ""}`} aria-hidden="true" />
                {line.label} <b>{read.values[nth] == null ? ABSENT : figure(read.values[nth])}</b>
              </button>
            </li>
          ))}
          <li class="muted">{notes.filter(Boolean).join("; ")}</li>
        </ul>
      </figcaption>
    </figure>
  );
}

/** The wheel with Ctrl or Shift zooms, a double click shows what is live; one finger moves, two zoom. */
function moves(element, chart) {
  const over = chart.plot.over;
  const at = (x) => {
    const [from, to] = shown();
    const { left, width } = over.getBoundingClientRect();
    return from + ((x - left) / width) * (to - from);
  };
  const wheel = (event) => {
    if (!event.ctrlKey && !event.shiftKey) return;
    event.preventDefault();
    zoom(event.deltaY + event.deltaX > 0 ? 1.25 : 0.8, at(event.clientX));
  };
  const fingers = new Map();
  const held = () => [...fingers.values()].sort((a, b) => a - b);
  const down = (event) => {
    if (event.pointerType !== "touch") return;
    fingers.set(event.pointerId, event.clientX);
    event.stopPropagation();
  };
  const move = (event) => {
    if (!fingers.has(event.pointerId)) return;
    const [before, width] = [held(), over.clientWidth];
    fingers.set(event.pointerId, event.clientX);
    const now = held();
    if (now.length === 1) pan((before[0] - now[0]) / width);
    else if (now.length === 2 && now[1] > now[0]) {
      const [from, to] = [at(before[0]), at(before[1])];
      const per = (to - from) / (now[1] - now[0]);
      const { left } = over.getBoundingClientRect();
      look(from - (now[0] - left) * per, from + (width - now[0] + left) * per);
    }
  };
  const up = (event) => fingers.delete(event.pointerId);
  const back = () => live();
  const all = { wheel, pointerdown: down, pointermove: move, pointerup: up, pointercancel: up, dblclick: back };
  for (const [name, act] of Object.entries(all)) over.addEventListener(name, act, { passive: false });
  return () => Object.entries(all).forEach(([name, act]) => over.removeEventListener(name, act));
}
