import { describe, expect, it } from "vitest";
import type { Columns } from "./api";
import { axis, cells, csv, matcher, parameters, sorted } from "./data";

function campaign(values: Record<string, unknown[]>, verdicts: string[]): Columns {
  const names = ["passed", "failed", "errored", "interrupted"];
  const variants = Object.values(values)[0]!.length;
  return {
    summary: {} as Columns["summary"],
    active: [],
    verdicts: names as Columns["verdicts"],
    reasons: ["", "goal not reached"],
    variants: { name: Array.from({ length: variants }, (_, i) => `hall-${i + 1}`), entry: [], values },
    runs: {
      variant: verdicts.map((_, run) => run % variants),
      number: verdicts.map((_, run) => Math.floor(run / variants)),
      verdict: verdicts.map((verdict) => names.indexOf(verdict)),
      reason: verdicts.map((verdict) => Number(verdict === "failed")),
      started: verdicts.map((_, run) => run),
      duration: verdicts.map((_, run) => (run === 1 ? null : 10 - run)),
    },
  };
}

const all = (data: Columns) => data.runs.number.map((_, run) => run);

describe("filter", () => {
  const data = campaign({ speed: [1, 2], map: ["hall", "Office"] }, ["passed", "failed", "passed", "errored"]);
  const found = (text: string) => all(data).filter(matcher(data, text));

  it("finds words in names, values, reasons and verdicts", () => {
    expect(found("hall-2")).toEqual([1, 3]);
    expect(found("office")).toEqual([1, 3]);
    expect(found("not reached")).toEqual([1]);
    expect(found("errored")).toEqual([3]);
  });

  it("compares numbers as numbers, and asks for all conditions", () => {
    expect(found("speed>1")).toEqual([1, 3]);
    expect(found("speed>1 duration<8")).toEqual([3]);
    expect(found("map!=hall")).toEqual([1, 3]);
    expect(found("speed=2.0")).toEqual([1, 3]);
  });
});

describe("order", () => {
  it("puts what is missing last, upwards and downwards", () => {
    const data = campaign({ speed: [1] }, ["passed", "passed", "passed"]);
    expect(sorted(data, all(data), "duration")).toEqual([2, 0, 1]);
    expect(sorted(data, all(data), "-duration")).toEqual([0, 2, 1]);
  });

  it("puts the worst verdict first", () => {
    const data = campaign({ speed: [1] }, ["passed", "interrupted", "errored", "failed"]);
    expect(sorted(data, all(data), "verdict")).toEqual([3, 2, 1, 0]);
  });

  it("names parameters that vary first", () => {
    expect(parameters(campaign({ fixed: [1, 1], speed: [1, 2] }, []))).toEqual(["speed", "fixed"]);
  });
});

describe("matrix", () => {
  it("counts bad runs in their cells, without interrupted ones", () => {
    const data = campaign({ x: [1, 2], y: ["a", "b"] }, ["passed", "failed", "interrupted", "errored"]);
    const [x, y] = [axis(data, "x"), axis(data, "y")];
    const found = cells(data, all(data), x, y, (run) => data.runs.duration[run]);
    expect(found.map((row) => row.map(({ runs, bad }) => [runs, bad]))).toEqual([
      [[1, 0], [0, 0]],
      [[0, 0], [2, 2]],
    ]);
    expect(found[1]![1]!.measured).toBe(1);
  });

  it("puts many numbers into ranges that hold every one", () => {
    const values = Array.from({ length: 500 }, (_, index) => (index * 37) % 500);
    const { labels, group } = axis(campaign({ x: values }, []), "x");
    expect(labels).toHaveLength(10);
    for (const place of labels.keys()) expect(group.filter((one) => one === place)).toHaveLength(50);
  });
});

it("writes CSV that keeps commas, quotes and lines", () => {
  expect(csv([["a", 'say "x", y\n'], [null, { b: 1 }]])).toBe('a,"say ""x"", y\n"\r\n,"{""b"":1}"\r\n');
});
