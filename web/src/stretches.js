// Curves of many ticks on few pixels: the lowest, the highest and the last value of each stretch, so that no extreme is lost.

/** Nothing of so many channels. */
export function nothing(channels) {
  const lists = () => channels.map(() => []);
  return { time: [], lowest: lists(), highest: lists(), last: lists() };
}

/** Adds the ticks of a ring within `(after, to]`, in stretches that begin at whole multiples of `step`. */
export function add_ticks(curves, ring, channels, after, to, step) {
  const [first, end] = ring.between(after, to);
  const { time, lowest, highest, last } = curves;
  const columns = channels.map((name) => ring.columns.get(name));
  let stretch = null;
  for (let tick = first; tick < end; tick += 1) {
    const at = tick % ring.capacity;
    const now = Math.floor(ring.time[at] / step);
    const is_new = now !== stretch;
    stretch = now;
    if (is_new) time.push(ring.time[at]);
    else time[time.length - 1] = ring.time[at];
    const place = time.length - 1;
    for (let nth = 0; nth < columns.length; nth += 1) {
      const column = columns[nth];
      const value = column && tick >= column.since ? column.values[at] : NaN;
      const is_there = value === value;
      if (is_new) {
        const begun = is_there ? value : null;
        lowest[nth].push(begun);
        highest[nth].push(begun);
        last[nth].push(begun);
      } else if (is_there) {
        const [low, high] = [lowest[nth][place], highest[nth][place]];
        if (low === null || value < low) lowest[nth][place] = value;
        if (high === null || value > high) highest[nth][place] = value;
        last[nth][place] = value;
      } else last[nth][place] = null;
    }
  }
  return curves;
}

/** Adds what the service remembers within `[from, to]`. */
export function add_history(curves, history, channels, from, to) {
  const places = channels.map((name) => history.channels.findIndex((of) => of.channel === name));
  history.time_s.forEach((time, nth) => {
    if (time < from || time > to) return;
    curves.time.push(time);
    places.forEach((place, channel) => {
      for (const which of ["lowest", "highest", "last"]) curves[which][channel].push(place < 0 ? null : history[which][place][nth] ?? null);
    });
  });
  return curves;
}

/** The lowest and highest of some channels, within an interval. */
export function extremes(curves, nths, from, to) {
  let [low, high] = [Infinity, -Infinity];
  for (let at = 0; at < curves.time.length; at += 1) {
    if (curves.time[at] < from || curves.time[at] > to) continue;
    for (const nth of nths) {
      const [lowest, highest] = [curves.lowest[nth][at], curves.highest[nth][at]];
      if (lowest !== null && lowest < low) low = lowest;
      if (highest !== null && highest > high) high = highest;
    }
  }
  return low <= high ? [low, high] : null;
}
