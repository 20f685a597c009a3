import { describe, expect, it } from "vitest";
import type { Columns } from "./api";
import { campaign } from "./data.fixture";
import { axis, cells, csv, factors, matcher, misspelt, show, sorted, titled, variantMatcher } from "./data";
import { failedFor, failures } from "./failures";

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

  it("knows the further columns of a run", () => {
    expect(sorted(data, all(data), "t:host")).toEqual([0, 2, 1, 3]);
    expect(sorted(data, all(data), "-t:host")).toEqual([1, 3, 0, 2]);
  });

  it("compares numbers as numbers, and asks for all conditions", () => {
    expect(found("speed>1")).toEqual([1, 3]);
    expect(found("speed>1 duration<8")).toEqual([3]);
    expect(found("map!=hall")).toEqual([1, 3]);
    expect(found("speed=2.0")).toEqual([1, 3]);
  });
});

describe("a misspelt name", () => {
  const data = campaign({ speed: [1, 2], map_file: ["hall", "Office"] }, ["passed", "failed"]);

  it("is named, with the one that was meant", () => {
    expect(misspelt(data, "sped>1 duration<8 hall")).toEqual([{ name: "sped", like: "speed" }]);
    expect(misspelt(data, "Map_Files=a")).toEqual([{ name: "Map_Files", like: "map_file" }]);
    expect(misspelt(data, "colour=red")).toEqual([{ name: "colour", like: "" }]);
    expect(misspelt(data, "goal not reached speed=1")).toEqual([]);
  });
});

describe("rates", () => {
  const data = campaign({ speed: [1, 2], map: ["hall", "Office"] }, ["passed", "failed", "passed", "errored"]);
  const rated = (text: string) => all(data).filter(variantMatcher(data, text));

  it("are of the chosen configurations, however their runs ended", () => {
    expect(rated("speed>1")).toEqual([1, 3]);
    expect(rated("office")).toEqual([1, 3]);
  });

  it("are never of runs that were chosen by their end", () => {
    for (const text of ["failed", "verdict=failed", "duration>7", "reason=x", "not reached"]) {
      expect(rated(text)).toEqual(all(data));
    }
    expect(rated("speed>1 failed")).toEqual([1, 3]);
  });

  it("of a cause count its runs among all of a cell", () => {
    const [x, y] = [axis(data, "speed"), axis(data, "")];
    const found = cells(data, all(data), x, y, undefined, failedFor(data, "goal not reached"));
    expect(found.map((row) => row.map(({ runs, bad }) => [runs, bad]))).toEqual([[[2, 0], [2, 1]]]);
  });
});

describe("causes", () => {
  const data = campaign(
    { margin: [0.1, 0.02], map: ["a", "b"], pose: [{ x: 1 }, { x: 2 }], speed: [1, 1] },
    ["passed", "failed", "errored", "failed", "passed", "failed"],
  );
  const found = failures(data, all(data), factors(data));

  it("come with the most frequent first, and with what their runs have in common", () => {
    expect(found.map(({ cause, verdict, runs }) => [cause, verdict, runs])).toEqual([
      ["goal not reached", "failed", [1, 3, 5]],
      ["no reason is known", "errored", [2]],
    ]);
    expect(found[0]!.where).toEqual(["margin = 0.02"]); // map and pose are names of the same
    expect(found[1]!.where).toEqual([]);
  });
});

describe("order", () => {
  it("puts what is missing last, upwards and downwards", () => {
    const data = campaign({ speed: [1] }, ["passed", "passed", "passed"]);
    expect(sorted(data, all(data), "duration")).toEqual([2, 0, 1]);
    expect(sorted(data, all(data), "-duration")).toEqual([0, 2, 1]);
  });

  it("sorts numbers by size, text by its numbers, and equal ones as they were", () => {
    const data = campaign({ name: ["a-10", "a-9", null, "a-9"], size: [10, 9, -1, 9] }, Array(4).fill("passed"));
    const by = (column: string) => sorted(data, all(data), column);
    expect([by("p:name"), by("-p:name")]).toEqual([[1, 3, 0, 2], [0, 1, 3, 2]]);
    expect([by("p:size"), by("-p:size")]).toEqual([[2, 1, 3, 0], [0, 1, 3, 2]]);
  });

  it("sorts lists item by item, in tables and along axes", () => {
    const size = [[10, 2], [2, 1], [2], [2, 10], [2, 2], null, [], [[9], "b"], "a"];
    const data = campaign({ size }, Array(9).fill("passed"));
    expect(sorted(data, all(data), "p:size")).toEqual([8, 6, 2, 1, 4, 3, 0, 7, 5]);
    const upTo10 = axis(campaign({ size: [[10, 2], [2, 1], [2, 10]] }, []), "size");
    expect(upTo10).toEqual({ labels: ["2, 1", "2, 10", "10, 2"], group: [2, 0, 1] });
  });

  it("puts the worst verdict first", () => {
    const data = campaign({ speed: [1] }, ["passed", "interrupted", "errored", "failed"]);
    expect(sorted(data, all(data), "verdict")).toEqual([3, 2, 1, 0]);
  });

  it("names parameters that vary first", () => {
    expect(factors(campaign({ fixed: [1, 1], speed: [1, 2] }, []))).toEqual(["speed", "fixed"]);
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

  it("keeps a number, the text of the number, a list and the text of the list apart", () => {
    const { labels, group } = axis(campaign({ x: [1, "1", [1, 2], "1, 2", "[1,2]"] }, []), "x");
    expect(new Set(group).size).toBe(5);
    expect(new Set(labels).size).toBe(5);
    expect(labels).toContain('"1"');
  });

  it("puts many numbers into ranges that hold every one", () => {
    const values = Array.from({ length: 500 }, (_, index) => (index * 37) % 500);
    const { labels, group } = axis(campaign({ x: values }, []), "x");
    expect(labels).toHaveLength(10);
    for (const place of labels.keys()) expect(group.filter((one) => one === place)).toHaveLength(50);
  });
});

it("shows different times as different", () => {
  expect([1795341641.895, 1795341641.926, 0.1 + 0.2, 1 / 3].map(show)).toEqual([
    "1795341641.895",
    "1795341641.926",
    "0.3",
    "0.333333",
  ]);
});

it("writes CSV that keeps commas, quotes and lines", () => {
  expect(csv([["a", 'say "x", y\n'], [null, { b: 1 }]])).toBe('a,"say ""x"", y\n"\r\n,"{""b"":1}"\r\n');
});

describe("a column's title", () => {
  it("has the unit of the column, and none of what every object has", () => {
    const data = { units: { width: "m" } };
    expect(titled(data, "width")).toBe("width [m]");
    expect(titled(data, "constructor")).toBe("constructor");
  });
});
