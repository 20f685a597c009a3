import { expect, it } from "vitest";
import { campaign } from "../data.fixture";
import { inBrush, moved, nearest, outcomes, readBrush, scaleOf, writeBrush } from "./scales";

const data = campaign({ speed: [1, 2, 4, null], map: ["b", "a", "a", "c"] }, [
  "passed", "failed", "passed", "passed", "failed", "failed", "interrupted", "passed",
]);
const found = outcomes(data, [0, 1, 2, 3, 4, 5, 6, 7], null);
const scale = (id: string) => scaleOf(data, found, id, null);

it("places numbers by size and text by name, and nothing where nothing is known", () => {
  expect([...scale("p:speed")!.places].map((place) => Number(place.toFixed(3)))).toEqual([0, 0.333, 1, NaN]);
  expect([...scale("p:map")!.places]).toEqual([0.5, 0, 0, 1]);
  expect([...found.rate]).toEqual([0.5, 1, 0, 0]);
  const unmeasured = outcomes(data, [0, 1, 2], null);
  expect(scaleOf(data, unmeasured, "duration", null)!.places[1]).toBeNaN();
  expect(scale("p:constructor")).toBeNull();
  expect(scale("measure")).toBeNull();
});

it("places lists item by item", () => {
  const lists = campaign({ size: [[10, 2], [2, 1], [2, 10]] }, ["passed", "passed", "passed"]);
  const { places, low, high } = scaleOf(lists, outcomes(lists, [0, 1, 2], null), "p:size", null)!;
  expect([[...places], low, high]).toEqual([[1, 0, 0.5], "2, 1", "10, 2"]);
});

it("chooses what lies in every chosen part", () => {
  const chosen = (brush: object) => found.variants.filter(inBrush(readBrush(JSON.stringify(brush)), scale));
  expect(chosen({ "p:speed": [2, 4] })).toEqual([1, 2]);
  expect(chosen({ "p:speed": [2, 4], rate: [0, 0.5] })).toEqual([2]);
  expect(chosen({ "p:map": ["a", "b"] })).toEqual([0, 1, 2]);
  expect(chosen({ "p:gone": [1, 2] })).toEqual([0, 1, 2, 3]);
});

it("reads what an address holds, or nothing", () => {
  const brush = readBrush(writeBrush({ "p:a,b": [1, 2] }));
  expect(brush).toEqual({ "p:a,b": [1, 2] });
  for (const text of ["", "{", "null", "[]", '{"a":1}', '{"a":[1]}', '{"a":[{},2]}']) expect(readBrush(text)).toEqual({});
  expect(writeBrush({})).toBe("");
});

it("moves axes, not beyond the ends", () => {
  expect(moved(["a", "b", "c"], "a", 1)).toEqual(["b", "a", "c"]);
  expect(moved(["a", "b", "c"], "c", -1)).toEqual(["c", "a", "b"]);
  expect(moved(["a", "b", "c"], "a", 9)).toEqual(["b", "c", "a"]);
});

it("finds the line at the pointer", () => {
  const scales = [scale("p:speed")!, scale("rate")!];
  expect(nearest(found.variants, scales, 0, 0.34, 0.05)).toBe(1);
  expect(nearest(found.variants, scales, 1, 0.02, 0.05)).toBe(2);
  expect(nearest(found.variants, scales, 0, 0.6, 0.05)).toBe(-1);
});
