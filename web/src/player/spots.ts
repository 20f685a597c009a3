// Places where several runs ended close to each other.
import type { Run } from "../data";
import type { Box } from "./camera";
import type { Point } from "./drive";

/** Places that fit side by side on a map. */
const ACROSS = 14;

export interface Spot {
  key: string;
  /** Their mean [m]. */
  x: number;
  y: number;
  runs: Run[];
}

/** Size of a place [m]. */
export function edgeOf([left, low, right, high]: Box): number {
  return Math.max(right - left, high - low, 1) / ACROSS;
}

/** Ends of runs, gathered in the squares of a grid over the map; those with most runs come last, on top. */
export function spotsOf(ends: { run: Run; at: Point }[], box: Box): Spot[] {
  const [left, low] = box;
  const edge = edgeOf(box);
  const spots = new Map<string, Spot>();
  for (const { run, at } of ends) {
    const key = `${Math.floor((at[0] - left) / edge)},${Math.floor((at[1] - low) / edge)}`;
    const spot = spots.get(key) ?? { key, x: 0, y: 0, runs: [] };
    const count = spot.runs.push(run);
    spot.x += (at[0] - spot.x) / count;
    spot.y += (at[1] - spot.y) / count;
    spots.set(key, spot);
  }
  return [...spots.values()].sort((a, b) => a.runs.length - b.runs.length);
}
