// Runs that did not pass, by cause, and the parameters that they have in common.
import type { Columns, Verdict } from "./api";
import { show, verdictOf, type Run } from "./data";

/** Runs that did not pass for one cause. */
export interface Failure {
  cause: string;
  /** The ranges of the numbers in which its reasons differ. */
  numbers: string;
  /** Of its first run. */
  verdict: Verdict;
  runs: Run[];
  /** Values that most of these runs have, and fewer of all: `margin = 0.02`. */
  where: string[];
}

/** Share of a cause's runs that must have a value, and how much more than of all runs. */
const MOST_OF_THEM = 0.75;
const MORE_THAN_OF_ALL = 0.2;
const MOST_VALUES = 2;

export function causeOf(data: Columns, run: Run): string {
  return data.causes[data.cause[data.runs.reason[run]!]!]!;
}

/** A test for runs that did not pass for a cause; without one, for all that did not pass. */
export function failedFor(data: Columns, cause: string): (run: Run) => boolean {
  const isBad = (run: Run) => verdictOf(data, run) !== "passed";
  return cause ? (run) => isBad(run) && causeOf(data, run) === cause : isBad;
}

/** The causes among runs, the most frequent first. */
export function failures(data: Columns, runs: Run[], names: string[]): Failure[] {
  const groups = new Map<string, Run[]>();
  for (const run of runs) {
    if (verdictOf(data, run) === "passed") continue;
    const cause = causeOf(data, run);
    const known = groups.get(cause);
    if (known) known.push(run);
    else groups.set(cause, [run]);
  }
  const all = perVariant(data, runs);
  return [...groups]
    .sort(([, a], [, b]) => b.length - a.length)
    .map(([cause, members]) => ({
      cause,
      numbers: data.numbers[data.cause[data.runs.reason[members[0]!]!]!]!,
      verdict: verdictOf(data, members[0]!),
      runs: members,
      where: members.length > 1 ? inCommon(data, names, perVariant(data, members), all) : [],
    }));
}

function perVariant(data: Columns, runs: Run[]): number[] {
  const found = data.variants.name.map(() => 0);
  for (const run of runs) found[data.runs.variant[run]!]! += 1;
  return found;
}

interface Common {
  text: string;
  /** How much more of them have it. */
  more: number;
  /** Which variants have it: two parameters may be names of one thing. */
  variants: string;
}

function inCommon(data: Columns, names: string[], group: number[], all: number[]): string[] {
  const found: Common[] = [];
  for (const name of names) {
    const common = commonValue(data, name, group, all);
    if (common && !found.some(({ variants }) => variants === common.variants)) found.push(common);
  }
  return found
    .sort((a, b) => b.more - a.more)
    .slice(0, MOST_VALUES)
    .map(({ text }) => text);
}

function commonValue(data: Columns, name: string, group: number[], all: number[]): Common | null {
  const values = data.variants.values[name]!;
  if (values.some((value) => typeof value === "object")) return null;
  const counts = new Map<unknown, [number, number]>();
  values.forEach((value, variant) => {
    const [ofGroup, ofAll] = counts.get(value) ?? [0, 0];
    counts.set(value, [ofGroup + group[variant]!, ofAll + all[variant]!]);
  });
  const sum = (numbers: number[]) => numbers.reduce((total, number) => total + number, 0);
  const [size, total] = [sum(group), sum(all)];
  for (const [value, [ofGroup, ofAll]] of counts) {
    const more = ofGroup / size - ofAll / total;
    if (ofGroup < MOST_OF_THEM * size || more < MORE_THAN_OF_ALL) continue;
    const variants = values.flatMap((one, variant) => (one === value ? [variant] : [])).join();
    return { text: `${name} = ${show(value)}`, more, variants };
  }
  return null;
}
