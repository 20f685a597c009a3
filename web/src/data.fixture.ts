// A small campaign for tests.
import type { Columns } from "./api";

export function campaign(values: Record<string, unknown[]>, verdicts: string[]): Columns {
  const names = ["passed", "failed", "errored", "interrupted"];
  const variants = Object.values(values)[0]!.length;
  return {
    summary: {} as Columns["summary"],
    reading: null,
    active: [],
    search: false,
    resume: "",
    wider: "",
    verdicts: names as Columns["verdicts"],
    reasons: ["", "goal not reached"],
    decided: [],
    causes: ["no reason is known", "goal not reached"],
    numbers: ["", ""],
    cause: [0, 1],
    variants: { name: Array.from({ length: variants }, (_, i) => `hall-${i + 1}`), entry: [], values },
    factors: Object.keys(values),
    units: {},
    runs: {
      variant: verdicts.map((_, run) => run % variants),
      number: verdicts.map((_, run) => Math.floor(run / variants)),
      verdict: verdicts.map((verdict) => names.indexOf(verdict)),
      reason: verdicts.map((verdict) => Number(verdict === "failed")),
      started: verdicts.map((_, run) => run),
      duration: verdicts.map((_, run) => (run === 1 ? null : 10 - run)),
      texts: { host: { title: "Host", texts: ["one", "two"], text: verdicts.map((_, run) => run % 2) } },
    },
  };
}
