// Times as people read them: seconds since the run's start.

const DAY = 86_400;
/** Larger is no number of seconds since the epoch. */
const NANOSECONDS = 1e12;
/** Of a table's times in seconds, a longer span would be of 11 days. */
const SPAN = 1e6;
const EPOCH = 1e8;

const STAMP = /\[(\d{9,10}\.\d{3,9})\] ?/g;

export type Cell = number | string | null;

/** Whether a column is named as times are. */
export function isTime(name: string): boolean {
  return /^(time|timestamp|stamp|t)$/i.test(name);
}

/** Times in seconds since the start [s since the epoch], or since the first one where clocks differ. */
export function sinceStart(values: Cell[], start: number | null): Cell[] {
  const times = values.filter((value) => typeof value === "number");
  if (!times.length) return values;
  const least = times.reduce((a, b) => Math.min(a, b));
  const span = times.reduce((a, b) => Math.max(a, b)) - least;
  const unit = least > NANOSECONDS || span > SPAN ? 1e-9 : 1;
  const first = least * unit;
  const near = start !== null && Math.abs(first - start) < DAY;
  const origin = near ? start : first > EPOCH ? first : 0;
  return values.map((value) => (typeof value === "number" ? Number((value * unit - origin).toFixed(6)) : value));
}

/** When a line of a log was written, in seconds since the start, and the line without its stamps. */
export function stamped(line: string, start: number): { at: string; text: string } {
  const stamp = STAMP.exec(line)?.[1];
  STAMP.lastIndex = 0;
  return stamp ? { at: (Number(stamp) - start).toFixed(3), text: line.replaceAll(STAMP, "") } : { at: "", text: line };
}
