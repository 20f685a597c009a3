import { expect, test } from "vitest";
import { contour } from "./contours";

test("a line runs where neighbours are on either side of the level", () => {
  const line = contour([0, 0, 0, 10, 10, 10], [0, 0.5, 1], [0, 1], 5);
  expect(line).toEqual([
    [0.5, 0.5, 0, 0.5],
    [1, 0.5, 0.5, 0.5],
  ]);
});

test("there is none where all are on one side, or where there is one row", () => {
  expect(contour([7, 8, 9, 9], [0, 1], [0, 1], 5)).toEqual([]);
  expect(contour([0, 10], [0, 1], [0.5], 5)).toEqual([]);
});

test("a saddle has two lines", () => {
  expect(contour([0, 10, 10, 0], [0, 1], [0, 1], 5)).toHaveLength(2);
});
