import { expect, it } from "vitest";
import type { Compared, Comparison } from "./api";
import { ordered, rowsOf } from "./compare-several";

type Change = Comparison["variants"][number]["change"];

function compared(name: string, changes: Record<string, Change>): Compared {
  const sample = { runs: 4, bad: 2, duration: null };
  const difference = { a: sample, b: sample, p: 1, low: 0, high: 0 };
  const variants = Object.entries(changes).map(([variant, change]) => ({
    ...{ name_a: variant, name_b: `${name}-${variant}`, difference, adjusted_p: 1, change, more_runs: null },
  }));
  return { name, comparison: { variants } as unknown as Comparison };
}

const rows = rowsOf([
  compared("one", { "a-1": "same", "a-2": "unclear", "a-3": "worse", "a-10": "worse" }),
  compared("two", { "a-1": "better", "a-2": "unclear", "a-10": "worse", "a-4": "same" }),
]);
const names = (sort: string) => ordered(rows, sort).map((row) => rows[row]!.name);

it("has a row for each configuration that any campaign has", () => {
  expect(rows.map(({ name, after }) => [name, ...after.map((one) => one?.name_b ?? "–")])).toEqual([
    ["a-1", "one-a-1", "two-a-1"],
    ["a-2", "one-a-2", "two-a-2"],
    ["a-3", "one-a-3", "–"],
    ["a-10", "one-a-10", "two-a-10"],
    ["a-4", "–", "two-a-4"],
  ]);
});

it("lists first what got worse, in the most campaigns", () => {
  expect(names("")).toEqual(["a-10", "a-3", "a-2", "a-1", "a-4"]);
  expect(names("variant")).toEqual(["a-1", "a-2", "a-3", "a-4", "a-10"]);
  expect(names("-variant")[0]).toBe("a-10");
});
