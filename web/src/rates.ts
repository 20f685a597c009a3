// How sure a failure rate is: the 95 % intervals of src/robovast/base/statistics.py.
import { percent } from "./format";

export type Interval = [low: number, high: number];

const Z = 1.959964;
const LEVEL = 0.05;

/** Of a rate whose number of runs was fixed beforehand. */
export function wilson(bad: number, runs: number): Interval {
  if (!runs) return [0, 1];
  const rate = bad / runs;
  const scale = 1 + (Z * Z) / runs;
  const centre = (rate + (Z * Z) / (2 * runs)) / scale;
  const half = (Z / scale) * Math.sqrt((rate * (1 - rate)) / runs + (Z * Z) / (4 * runs * runs));
  return [Math.max(0, centre - half), Math.min(1, centre + half)];
}

/** Of a rate that is looked at while runs are added: a beta-binomial confidence sequence. */
export function anytime(bad: number, runs: number): Interval {
  let constant = Math.log(runs + 1) - Math.log(LEVEL);
  for (let k = 1; k <= Math.min(bad, runs - bad); k += 1) constant += Math.log((runs - k + 1) / k);
  const times = (n: number, p: number) => (n ? n * Math.log(p) : 0);
  const isPossible = (p: number) => constant + times(bad, p) + times(runs - bad, 1 - p) >= 0;
  const limit = (end: number) => {
    let [inside, outside] = [runs ? bad / runs : 0.5, end];
    if (isPossible(end)) return end;
    for (let step = 0; step < 50; step += 1) {
      const middle = (inside + outside) / 2;
      if (isPossible(middle)) inside = middle;
      else outside = middle;
    }
    return inside;
  };
  return [limit(0), limit(1)];
}

/** `3.6 – 62 %` */
export function intervalText([low, high]: Interval): string {
  return `${percent(low).replace(" %", "")} – ${percent(high)}`;
}
