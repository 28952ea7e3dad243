// The last ticks of the channels that are drawn, in memory that does not grow.

/** Instants and values of so many ticks. */
export class Ring {
  constructor(capacity = 8192) {
    this.capacity = capacity;
    this.clear();
  }

  clear() {
    this.time = new Float64Array(this.capacity);
    this.columns = new Map();
    /** Ticks so far: the last one stands at `(ticks - 1) % capacity`. */
    this.ticks = 0;
  }

  /** Begins anew with the same channels, as where ticks were missed. */
  restart() {
    const names = [...this.columns.keys()];
    this.clear();
    names.forEach((name) => this.want(name));
  }

  /** Keeps a channel from the next tick on. */
  want(name) {
    if (!this.columns.has(name)) this.columns.set(name, { since: this.ticks, values: new Float64Array(this.capacity) });
  }

  /** One more tick. Time that goes back begins anew. */
  push(time, values) {
    if (this.ticks > 0 && time < this.last()) this.restart();
    const at = this.ticks % this.capacity;
    this.time[at] = time;
    for (const [name, column] of this.columns) column.values[at] = values[name] ?? NaN;
    this.ticks += 1;
  }

  /** The instant of the last tick; NaN before the first. */
  last() {
    return this.ticks > 0 ? this.time[(this.ticks - 1) % this.capacity] : NaN;
  }

  /** From which instant on all of these channels are known; infinite where one is not. */
  since(names) {
    let first = Math.max(0, this.ticks - this.capacity);
    for (const name of names) first = Math.max(first, this.columns.get(name)?.since ?? Infinity);
    return first < this.ticks ? this.time[first % this.capacity] : Infinity;
  }

  /** The numbers of the ticks within `(after, to]`. */
  between(after, to) {
    const first = Math.max(0, this.ticks - this.capacity);
    const search = (limit) => {
      let [low, high] = [first, this.ticks];
      while (low < high) {
        const middle = (low + high) >> 1;
        if (this.time[middle % this.capacity] <= limit) low = middle + 1;
        else high = middle;
      }
      return low;
    };
    return [search(after), search(to)];
  }
}
