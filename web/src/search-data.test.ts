import { expect, test } from "vitest";
import { beside, curveGroups, intervalText, nearest } from "./search-data";

test("a number and its interval are drawn together", () => {
  const report = { batch: [0], "best failure_rate": [1], failing: [0.2], failing_low: [0.1], failing_high: [0.3], misjudged: [0.1], elapsed: [1] };
  expect(curveGroups(report)).toEqual([["best failure_rate"], ["failing", "failing_low", "failing_high"], ["misjudged"]]);
});

test("an interval says at which ends the space ends", () => {
  const text = (open: "low" | "high" | "both" | null) =>
    intervalText({ name: "speed", value: 2, low: 1, high: 4, above: "fails", crossing: 1, open }, String);
  expect([null, "low" as const, "high" as const, "both" as const].map(text)).toEqual(["1 to 4", "≤ 1 to 4", "1 to ≥ 4", "≤ 1 to ≥ 4"]);
  expect(intervalText({ name: "speed", value: null, low: null, high: null, above: null, crossing: 0, open: null }, String)).toBe("–");
});

const DOTS = [{ x: 0, y: 0 }, { x: 10, y: 0 }, { x: 12, y: 30 }];

test("a dot is found near the pointer alone", () => {
  expect(nearest(DOTS, 8, 1, 5)).toBe(1);
  expect(nearest(DOTS, 5, 15, 5)).toBeNull();
});

test("arrows lead from dot to dot and stop at the last one", () => {
  expect(beside(DOTS, null, [1, 0])).toBe(0);
  expect(beside(DOTS, 0, [1, 0])).toBe(1);
  expect(beside(DOTS, 1, [0, 1])).toBe(2);
  expect(beside(DOTS, 2, [0, 1])).toBe(2);
});
