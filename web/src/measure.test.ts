import { expect, test } from "vitest";
import { optionsOf } from "./measure";

test("a column with one value everywhere is offered last", () => {
  const columns = { constructor: ["a"], poses: ["t", "z", "x"] };
  expect(optionsOf({ columns, same: { poses: ["z"] } })).toEqual([
    ["constructor/a", "a", "constructor"],
    ["poses/t", "t", "poses"],
    ["poses/x", "x", "poses"],
    ["poses/z", "poses: z", "Constant"],
  ]);
});
