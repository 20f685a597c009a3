import { expect, it } from "vitest";
import { spotsOf } from "./spots";

it("gathers ends that are close, and has the largest place on top", () => {
  const ends = [[0.1, 0.1], [0.3, 0.1], [9, 9]].map(([x, y], run) => ({ run, at: [x!, y!] as [number, number] }));
  const spots = spotsOf(ends, [0, 0, 14, 14]);
  expect(spots.map(({ runs }) => runs)).toEqual([[2], [0, 1]]);
  expect(spots[1]).toMatchObject({ x: 0.2, y: 0.1 });
});
