// What the server says of a search; the names are those of the Python side.

export interface Dimension {
  name: string;
  type: "float" | "int" | "choice" | "bool";
  ticks: [place: number, text: string][];
}

export interface Criterion {
  kind: string;
  label: string;
  current: number | null;
  limit: number;
  fired: boolean;
}

export interface SearchAnswer {
  version: number;
  /** What stands before and behind the number of batches in the command that continues it. */
  more: [string, string] | null;
  /** Batches that are scored. */
  batches: number;
  strategy: string;
  /** Whether the strategy comes with RoboVAST; others are not executed by the page. */
  built_in: boolean;
  seed: number;
  objectives: { name: string; direction: "maximize" | "minimize" }[];
  dimensions: Dimension[];
  measures: string[];
  /** What the strategy makes. */
  shown: "map" | "archive" | "";
  evaluated: number;
  left_out: number;
  errors: [config: string, error: string][];
  criteria: Criterion[];
  ended: { kind: string; reason: string } | null;
  /** Numbers after each batch, by name. */
  report: Record<string, (number | null)[]>;
  /** Of each batch: how many sets, from how many evaluations, by which version of which strategy. */
  proposed: [sets: number, told: number, version: string, strategy: string][];
}

export interface SetsAxis {
  name: string;
  ticks: [number, string][];
  /** From 0 to 1; -1 for a set that has no such number. */
  places: number[];
  /** Parts of an archive's axis; 0 where it has no parts. */
  bins: number;
}

export interface SetsAnswer {
  x: SetsAxis;
  y: SetsAxis;
  config: string[];
  value: number[];
  runs: number[];
  batch: number[];
  best: number[];
}

export interface Critical {
  name: string;
  value: number | null;
  low: number | null;
  high: number | null;
  /** What to expect above the value: it "fails", or it "passes". */
  above: string | null;
  crossing: number;
  /** The ends of the interval that are ends of the space. */
  open: "low" | "high" | "both" | null;
}

/** An interval; an end beyond which the value may lie, since the space ends there, says so. */
export function intervalText({ low, high, open }: Critical, number: (value: number | null) => string): string {
  if (low === null) return "–";
  return `${open === "low" || open === "both" ? "≤ " : ""}${number(low)} to ${open === "high" || open === "both" ? "≥ " : ""}${number(high)}`;
}

/** Rates are in thousandths, row by row from the lowest. */
export interface MapAnswer {
  width: number;
  height: number;
  x: number[];
  y: number[];
  level: number;
  rate: number[];
  low: number[];
  high: number[];
  critical: Critical[];
  /** Where the sliders are. */
  values: Record<string, unknown>;
}

/** The curves of a report, those that belong together in one group: a number and its interval. */
export function curveGroups(report: SearchAnswer["report"]): string[][] {
  const left = new Set(["batch", "batches", "evaluations", "elapsed"]);
  const groups: string[][] = [];
  for (const name of Object.keys(report)) {
    if (left.has(name)) continue;
    const group = [name, `${name}_low`, `${name}_high`].filter((one) => Object.hasOwn(report, one));
    group.forEach((one) => left.add(one));
    groups.push(group);
  }
  return groups;
}

/** The axes that a search is first looked at with. */
export function usualAxes(search: SearchAnswer): [string, string] {
  const dimensions = search.dimensions.map(({ name }) => name);
  const objectives = search.objectives.map(({ name }) => name);
  const first =
    search.shown === "archive"
      ? [...search.measures, ...objectives]
      : objectives.length > 1
        ? objectives
        : [...dimensions, ...objectives];
  return [first[0]!, first[1]!];
}

/** The dot next to a place, if it is nearer than `most`; places and distance are in pixels. */
export function nearest(dots: { x: number; y: number }[], x: number, y: number, most: number): number | null {
  let found: number | null = null;
  let best = most ** 2;
  dots.forEach((dot, index) => {
    const distance = (dot.x - x) ** 2 + (dot.y - y) ** 2;
    if (distance <= best) [found, best] = [index, distance];
  });
  return found;
}

/** The dot that an arrow key leads to: the nearest one on that side. */
export function beside(dots: { x: number; y: number }[], from: number | null, [right, down]: [number, number]): number | null {
  if (from === null) return dots.length ? 0 : null;
  const start = dots[from]!;
  let found: number | null = null;
  let best = Infinity;
  dots.forEach((dot, index) => {
    const [x, y] = [dot.x - start.x, dot.y - start.y];
    const along = x * right + y * down;
    const aside = Math.abs(x * down) + Math.abs(y * right);
    const cost = along + 2 * aside;
    if (along > 0 && cost < best) [found, best] = [index, cost];
  });
  return found ?? from;
}
