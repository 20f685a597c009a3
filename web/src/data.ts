// Runs of a campaign: filtered, sorted, put into cells. Pure functions over the server's columns.
import type { Columns, Verdict } from "./api";
import { COMMON } from "./text";

/** A run is its place in the columns. */
export type Run = number;

export function verdictOf(data: Columns, run: Run): Verdict {
  return data.verdicts[data.runs.verdict[run]!]!;
}

export function variantOf(data: Columns, run: Run): string {
  return data.variants.name[data.runs.variant[run]!]!;
}

/** Value of a run in a column: `variant`, `run`, `verdict`, `duration`, … or a parameter. */
export function valueOf(data: Columns, run: Run, column: string): unknown {
  const { runs } = data;
  switch (column) {
    case "variant":
      return variantOf(data, run);
    case "run":
      return runs.number[run];
    case "verdict":
      return verdictOf(data, run);
    case "duration":
      return runs.duration[run];
    case "started":
      return runs.started[run];
    case "decided":
      return data.decided[runs.variant[run]!];
    case "reason":
      return data.reasons[runs.reason[run]!];
    default:
      return textOf(data, run, column) ?? data.variants.values[column.replace(/^p:/, "")]?.[runs.variant[run]!];
  }
}

/** Text of a run in one of the further columns; undefined without such a column. */
function textOf({ runs }: Columns, run: Run, column: string): string | undefined {
  const found = column.startsWith("t:") ? runs.texts[column.slice(2)] : undefined;
  return found && found.texts[found.text[run]!];
}

/** Names of the factors that have more than one value, then the others. */
export function factors(data: Pick<Columns, "variants" | "factors">): string[] {
  const known = new Map(data.factors.map((name) => [name, varies(data, name)]));
  return [...data.factors].sort((a, b) => Number(known.get(b)) - Number(known.get(a)));
}

/** Names of the parameters that are no factors: they follow from them. */
export function others(data: Pick<Columns, "variants" | "factors">): string[] {
  const known = new Set(data.factors);
  return Object.keys(data.variants.values).filter((name) => !known.has(name));
}

/** A column's name with its unit. */
export function titled(data: Pick<Columns, "units">, name: string): string {
  const unit = unitOf(data, name);
  return unit ? `${name} [${unit}]` : name;
}

/** The unit of a column, or nothing; a column may be named as what every object has, such as `constructor`. */
export function unitOf({ units }: Pick<Columns, "units">, name: string): string {
  return Object.hasOwn(units, name) ? units[name]! : "";
}

/** Whether a parameter has more than one value. */
export function varies(data: Pick<Columns, "variants">, name: string): boolean {
  return distinct(data.variants.values[name]!) > 1;
}

function distinct(values: unknown[]): number {
  return new Set(values.map(identity)).size;
}

/** What is equal for equal values; quicker than their text. */
function identity(value: unknown): unknown {
  return value !== null && typeof value === "object" ? `\0${JSON.stringify(value)}` : value;
}

/** Texts of different values; text is in quotes where another value has the same. */
function labelsOf(values: unknown[]): string[] {
  const texts = values.map(brief);
  const counts = new Map<string, number>();
  for (const text of texts) counts.set(text, (counts.get(text) ?? 0) + 1);
  return texts.map((text, index) => {
    const isAmbiguous = typeof values[index] === "string" && counts.get(text)! > 1;
    return isAmbiguous ? JSON.stringify(text) : text;
  });
}

/** A value as text. */
export function show(value: unknown): string {
  if (value === null || value === undefined) return "–";
  if (typeof value === "number") return shortNumber(value);
  return typeof value === "object" ? JSON.stringify(value) : String(value);
}

/** A value in few letters: of poses the place, of lists how long they are. */
export function brief(value: unknown): string {
  if (value === null || typeof value !== "object") return show(value);
  if (Array.isArray(value)) {
    const simple = value.length <= 4 && value.every((item) => typeof item !== "object");
    return simple ? value.map(show).join(", ") : COMMON.items(value.length);
  }
  const { position = value } = value as { position?: unknown };
  const { x, y } = (position ?? {}) as { x?: unknown; y?: unknown };
  const short = (number: number) => String(Number(number.toFixed(2)));
  return typeof x === "number" && typeof y === "number" ? `${short(x)}, ${short(y)}` : show(value);
}

function shortNumber(value: number): string {
  if (Number.isInteger(value)) return String(value);
  // Of times since 1970, six digits would be the same for months.
  return String(Number(Math.abs(value) < 1000 ? value.toPrecision(6) : value.toFixed(3)));
}

/** Numbers by size, text by its numbers and letters, lists by their first different items; what is missing comes last. */
export function order(a: unknown, b: unknown): number {
  const missing = Number(a === null || a === undefined) - Number(b === null || b === undefined);
  if (missing || a === null || a === undefined) return missing;
  if (typeof a === "number" && typeof b === "number") return a - b;
  const areLists = Number(Array.isArray(a)) - Number(Array.isArray(b));
  if (areLists) return areLists;
  return Array.isArray(a) ? orderOfLists(a, b as unknown[]) : collator.compare(show(a), show(b));
}

function orderOfLists(a: unknown[], b: unknown[]): number {
  const first = a.findIndex((item, place) => place >= b.length || order(item, b[place]));
  if (first < 0) return a.length - b.length;
  return first < b.length ? order(a[first], b[first]) : 1;
}

const collator = new Intl.Collator("en", { numeric: true });

const WORST_FIRST: Record<string, number> = { failed: 0, errored: 1, interrupted: 2, passed: 3 };

/** Runs sorted by a column; `-duration` is downwards. Equal ones stay in their order. */
export function sorted(data: Columns, runs: Run[], by: string, measure?: Shown | null): Run[] {
  if (!by) return runs;
  const down = by.startsWith("-");
  const column = down ? by.slice(1) : by;
  const { ranks, most } = ranksOf(runs.map((run) => keyOf(data, run, column, measure)));
  const place = (rank: number) => (down && rank < most ? most - 1 - rank : rank);
  const ends = new Uint32Array(most + 2);
  for (const rank of ranks) ends[place(rank) + 1]! += 1;
  for (let one = 0; one < most; one++) ends[one + 1]! += ends[one]!;
  const found = new Array<Run>(runs.length);
  runs.forEach((run, index) => (found[ends[place(ranks[index]!)]!++] = run));
  return found;
}

/** The places of some values among the different ones, of which there are `most`; that of a missing one is `most`. */
function ranksOf(values: unknown[]): { ranks: Uint32Array; most: number } {
  const keys = values.map(identity);
  const different = new Map<unknown, unknown>();
  let areNumbers = true;
  values.forEach((value, index) => {
    if (value === null || value === undefined || different.has(keys[index])) return;
    different.set(keys[index], value);
    areNumbers &&= typeof value === "number";
  });
  const ordered = areNumbers
    ? [...Float64Array.from(different.keys() as Iterable<number>).sort()]
    : [...different].sort((a, b) => order(a[1], b[1])).map(([key]) => key);
  const places = new Map<unknown, number>(ordered.map((key, rank) => [key, rank]));
  return { ranks: Uint32Array.from(keys, (key) => places.get(key) ?? ordered.length), most: ordered.length };
}

/** Those of some runs that are chosen, in their order. */
export function among(runs: Run[], chosen: Run[]): Run[] {
  const isChosen = new Uint8Array(runs.length);
  for (const run of chosen) isChosen[run] = 1;
  return runs.filter((run) => isChosen[run]);
}

function keyOf(data: Columns, run: Run, column: string, measure?: Shown | null): unknown {
  if (column === "m") return measure?.of(run);
  return column === "verdict" ? WORST_FIRST[verdictOf(data, run)] : valueOf(data, run, column);
}

const CONDITION = /^([^<>=!]+)(<=|>=|!=|=|<|>)(.*)$/;

/** A word that a user types, as tests for runs. */
interface Word {
  test: (run: Run) => boolean;
  /** The same, as far as it asks for configurations; null when it asks how runs went. */
  ofVariant: ((run: Run) => boolean) | null;
}

/** A test for runs from what a user types: words, and conditions such as `speed>2` or `map=hall`. */
export function matcher(data: Columns, text: string): (run: Run) => boolean {
  return every(wordsOf(data, text).map(({ test }) => test));
}

/** The part of it that asks for configurations: rates among runs chosen by their end would be false. */
export function variantMatcher(data: Columns, text: string): (run: Run) => boolean {
  return every(wordsOf(data, text).flatMap(({ ofVariant }) => ofVariant ?? []));
}

function every(tests: ((run: Run) => boolean)[]): (run: Run) => boolean {
  return (run) => tests.every((test) => test(run));
}

function wordsOf(data: Columns, text: string): Word[] {
  return text.split(/\s+/).filter(Boolean).map((word) => wordTest(data, word));
}

function wordTest(data: Columns, word: string): Word {
  const condition = CONDITION.exec(word);
  const column = condition && columnNamed(data, condition[1]!);
  if (condition && column) {
    const test = conditionTest(data, column, condition[2]!, condition[3]!);
    return { test, ofVariant: OF_OUTCOME.has(column) ? null : test };
  }
  const needle = word.toLowerCase();
  const reasons = data.reasons.map((reason) => reason.toLowerCase().includes(needle));
  const variants = data.variants.name.map(
    (name, place) => name.toLowerCase().includes(needle) || hasValue(data, place, needle),
  );
  const ofVariant = (run: Run) => variants[data.runs.variant[run]!]!;
  return {
    test: (run) => ofVariant(run) || reasons[data.runs.reason[run]!]! || verdictOf(data, run) === needle,
    ofVariant: variants.includes(true) ? ofVariant : null,
  };
}

/** What conditions ask for that no column is, and the column that is nearly called so, if there is one. */
export function misspelt(data: Columns, text: string): { name: string; like: string }[] {
  const names = [...COLUMNS, ...Object.keys(data.variants.values)];
  return text.split(/\s+/).flatMap((word) => {
    const name = CONDITION.exec(word)?.[1];
    if (!name || columnNamed(data, name)) return [];
    const like = names.map((one) => [one, distance(one.toLowerCase(), name.toLowerCase())] as const);
    const [nearest, away] = like.reduce((a, b) => (b[1] < a[1] ? b : a));
    return { name, like: away <= Math.max(1, name.length / 3) ? nearest : "" };
  });
}

/** How many letters must be changed, added or removed (Levenshtein). */
function distance(a: string, b: string): number {
  let row = Array.from({ length: b.length + 1 }, (_, place) => place);
  for (let i = 1; i <= a.length; i++) {
    const next = [i];
    for (let j = 1; j <= b.length; j++) {
      next[j] = Math.min(row[j]! + 1, next[j - 1]! + 1, row[j - 1]! + Number(a[i - 1] !== b[j - 1]));
    }
    row = next;
  }
  return row[b.length]!;
}

const COLUMNS = ["variant", "run", "verdict", "duration", "reason"];
const OF_OUTCOME = new Set(["verdict", "duration", "reason"]);

function hasValue(data: Columns, place: number, needle: string): boolean {
  return Object.values(data.variants.values).some((values) => {
    const value = values[place];
    return typeof value === "string" && value.toLowerCase().includes(needle);
  });
}

function columnNamed(data: Columns, name: string): string | null {
  if (Object.hasOwn(data.variants.values, name)) return `p:${name}`;
  return COLUMNS.includes(name) ? name : null;
}

function conditionTest(data: Columns, column: string, sign: string, text: string) {
  const number = Number(text);
  return (run: Run): boolean => {
    const value = valueOf(data, run, column);
    const comparable = typeof value === "number" && text !== "" && !Number.isNaN(number);
    const equal = comparable ? value === number : show(value).toLowerCase() === text.toLowerCase();
    if (sign === "=") return equal;
    if (sign === "!=") return !equal;
    if (!comparable) return false;
    if (sign === "<") return value < number;
    if (sign === ">") return value > number;
    return sign === "<=" ? value <= number : value >= number;
  };
}

/** Groups of values along an axis: each value, or ranges where there are too many numbers. */
export interface Axis {
  labels: string[];
  /** Group of each variant; -1 for none. */
  group: number[];
}

export const MOST_GROUPS = 24;
const RANGES = 10;

/** The axis of a parameter; without one, a single group. */
export function axis(data: Columns, parameter: string): Axis {
  const values = data.variants.values[parameter];
  if (!values) return { labels: [""], group: data.variants.name.map(() => 0) };
  const different = [...new Map(values.map((value) => [identity(value), value])).values()].sort(order);
  if (different.length <= MOST_GROUPS || !different.every((value) => typeof value === "number")) {
    const place = new Map(different.map((value, index) => [identity(value), index]));
    return { labels: labelsOf(different), group: values.map((value) => place.get(identity(value))!) };
  }
  return ranges(values as number[], different as number[]);
}

/** Ranges with about as many values each. */
function ranges(values: number[], ordered: number[]): Axis {
  const starts = Array.from(
    { length: RANGES },
    (_, index) => ordered[Math.floor((index * ordered.length) / RANGES)]!,
  );
  const short = (value: number) => String(Number(value.toPrecision(3)));
  const labels = starts.map((start, index) => {
    const end = starts[index + 1] ?? ordered[ordered.length - 1]!;
    return `${short(start)} … ${short(end)}`;
  });
  return { labels, group: values.map((value) => starts.findLastIndex((start) => value >= start)) };
}

export interface Cell {
  runs: number;
  bad: number;
  /** Sum of the measured column, and how many runs have it. */
  sum: number;
  measured: number;
}

/** What is measured of a run. */
export type Measure = (run: Run) => unknown;

/** Cells of a matrix, row by row; interrupted runs do not count. */
export function cells(
  data: Columns,
  runs: Run[],
  x: Axis,
  y: Axis,
  measure?: Measure,
  isBad: (run: Run) => boolean = (run) => verdictOf(data, run) !== "passed",
): Cell[][] {
  const found = y.labels.map(() =>
    x.labels.map((): Cell => ({ runs: 0, bad: 0, sum: 0, measured: 0 })),
  );
  for (const run of runs) {
    if (verdictOf(data, run) === "interrupted") continue;
    const variant = data.runs.variant[run]!;
    const cell = found[y.group[variant]!]?.[x.group[variant]!];
    if (!cell) continue;
    cell.runs += 1;
    cell.bad += Number(isBad(run));
    const value = measure?.(run);
    if (typeof value === "number") {
      cell.sum += value;
      cell.measured += 1;
    }
  }
  return found;
}

/** What the colour of a cell stands for, beside the failure rate. */
export interface Shown {
  name: string;
  of: Measure;
}

/** Rows as CSV (RFC 4180). */
export function csv(rows: unknown[][]): string {
  const cell = (value: unknown) => {
    const text = value === null || value === undefined ? "" : typeof value === "object" ? JSON.stringify(value) : String(value);
    return /[",\r\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text;
  };
  return rows.map((row) => row.map(cell).join(",") + "\r\n").join("");
}
