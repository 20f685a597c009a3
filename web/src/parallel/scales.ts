// The axes of parallel coordinates: where each configuration lies on them. Pure functions.
import type { Columns } from "../api";
import { brief, order, show, titled, verdictOf, type Run, type Shown } from "../data";
import { COMMON } from "../text";

/** A parameter is an axis `p:name`; these are what came of the configurations. */
export const RESULTS = ["duration", "measure", "rate"] as const;

/** A value on an axis: a number, or the text of what is no number. */
export type Bound = number | string;
/** What is chosen of axes: from the one value to the other. */
export type Brush = Record<string, [Bound, Bound]>;

export interface Scale {
  id: string;
  label: string;
  /** Least and largest value, as text. */
  low: string;
  high: string;
  /** From 0 to 1 by configuration; NaN where nothing is known. */
  places: Float32Array;
  /** The value at a place. */
  at: (place: number) => Bound;
  /** The place of a value; NaN where there is none. */
  of: (value: Bound) => number;
}

/** What came of each configuration, by its place in the columns; NaN where nothing is known. */
export interface Outcomes {
  /** Those that have runs with a verdict. */
  variants: number[];
  rate: Float32Array;
  duration: Float32Array;
  measure: Float32Array;
}

export function outcomes(data: Columns, runs: Run[], measure: Shown | null): Outcomes {
  const size = data.variants.name.length;
  const [count, bad] = [new Uint32Array(size), new Uint32Array(size)];
  const [duration, measured] = [new Mean(size), new Mean(size)];
  for (const run of runs) {
    const verdict = verdictOf(data, run);
    if (verdict === "interrupted") continue;
    const variant = data.runs.variant[run]!;
    count[variant]! += 1;
    bad[variant]! += Number(verdict !== "passed");
    duration.add(variant, data.runs.duration[run]);
    if (measure) measured.add(variant, measure.of(run));
  }
  const variants = data.variants.name.map((_, variant) => variant).filter((variant) => count[variant]);
  const rate = Float32Array.from(count, (runs, variant) => bad[variant]! / runs);
  return { variants, rate, duration: duration.means(), measure: measured.means() };
}

class Mean {
  private readonly sums: Float64Array;
  private readonly counts: Uint32Array;

  constructor(size: number) {
    this.sums = new Float64Array(size);
    this.counts = new Uint32Array(size);
  }

  add(place: number, value: unknown): void {
    if (typeof value !== "number") return;
    this.sums[place]! += value;
    this.counts[place]! += 1;
  }

  means(): Float32Array {
    return Float32Array.from(this.sums, (sum, place) => sum / this.counts[place]!);
  }
}

/** The axis of an address, or null: the campaign may be another one. */
export function scaleOf(data: Columns, found: Outcomes, id: string, measure: Shown | null): Scale | null {
  if (id === "rate") return numberScale(id, COMMON.failureRate, found.rate);
  if (id === "duration") return numberScale(id, COMMON.meanDuration, found.duration);
  if (id === "measure") return measure && numberScale(id, COMMON.mean(measure.name), found.measure);
  const name = id.slice(2);
  if (!id.startsWith("p:") || !Object.hasOwn(data.variants.values, name)) return null;
  return parameterScale(id, titled(data, name), data.variants.values[name]!);
}

function parameterScale(id: string, label: string, values: unknown[]): Scale {
  const isKnown = (value: unknown) => value !== null && value !== undefined;
  if (values.every((value) => typeof value === "number" || !isKnown(value))) {
    return numberScale(id, label, Float32Array.from(values, (value) => (isKnown(value) ? Number(value) : NaN)));
  }
  const texts = values.map((value) => (isKnown(value) ? show(value) : null));
  const different = new Map(values.filter(isKnown).map((value) => [show(value), value]));
  const ordered = [...different].sort((a, b) => order(a[1], b[1])).map(([text]) => text);
  const most = ordered.length - 1;
  const end = (place: number) => brief(different.get(ordered[place] ?? "") ?? "");
  const place = new Map(ordered.map((text, index) => [text, most ? index / most : 0.5]));
  return {
    id,
    label,
    low: end(0),
    high: end(most),
    places: Float32Array.from(texts, (text) => (text === null ? NaN : place.get(text)!)),
    at: (share) => ordered[Math.round(share * most)] ?? "",
    of: (value) => place.get(String(value)) ?? NaN,
  };
}

function numberScale(id: string, label: string, values: Float32Array): Scale {
  let [low, high] = [Infinity, -Infinity];
  for (const value of values) {
    if (value < low) low = value;
    if (value > high) high = value;
  }
  const of = (value: number) => (high > low ? (value - low) / (high - low) : 0.5);
  const text = (number: number) => (Number.isFinite(number) ? String(short(number)) : "");
  return {
    id,
    label,
    low: text(low),
    high: text(high),
    places: values.map((value) => (Number.isNaN(value) ? NaN : of(value))),
    at: (share) => short(low + share * (high - low)),
    of: (value) => of(Number(value)),
  };
}

function short(number: number): number {
  return Number(number.toPrecision(4));
}

/** A test for configurations: whether they lie in every chosen part. */
export function inBrush(brush: Brush, scaleOf: (id: string) => Scale | null): (variant: number) => boolean {
  const parts = Object.entries(brush).flatMap(([id, [from, to]]) => {
    const scale = scaleOf(id);
    if (!scale) return [];
    const ends = [scale.of(from), scale.of(to)];
    if (ends.some(Number.isNaN)) return [];
    // What is written in four digits includes what was rounded.
    return { places: scale.places, low: Math.min(...ends) - 1e-3, high: Math.max(...ends) + 1e-3 };
  });
  return (variant) => parts.every(({ places, low, high }) => places[variant]! >= low && places[variant]! <= high);
}

/** The brush that an address holds; nothing where it was cut or made up. */
export function readBrush(text: string): Brush {
  try {
    const found = Object.entries(JSON.parse(text || "{}") as object);
    const isBound = (value: unknown) => typeof value === "number" || typeof value === "string";
    return Object.fromEntries(
      found.filter(([, ends]) => Array.isArray(ends) && ends.length === 2 && ends.every(isBound)),
    ) as Brush;
  } catch {
    return {};
  }
}

export function writeBrush(brush: Brush): string {
  return Object.keys(brush).length ? JSON.stringify(brush) : "";
}

/** The axes with one of them at another place. */
export function moved(ids: string[], id: string, to: number): string[] {
  const rest = ids.filter((one) => one !== id);
  return rest.toSpliced(Math.max(0, Math.min(to, rest.length)), 0, id);
}

/** The configuration whose line is nearest to a point, at most `reach` of the height away; -1 if none is. */
export function nearest(variants: number[], scales: Scale[], column: number, place: number, reach: number): number {
  const left = Math.max(0, Math.min(Math.floor(column), scales.length - 2));
  const [a, b] = [scales[left]!.places, (scales[left + 1] ?? scales[left]!).places];
  const part = Math.max(0, Math.min(1, column - left));
  let [best, least] = [-1, reach];
  for (const variant of variants) {
    const away = Math.abs(a[variant]! * (1 - part) + b[variant]! * part - place);
    if (away <= least) [best, least] = [variant, away];
  }
  return best;
}
