import { expect, it } from "vitest";
import { moreRuns, usualRuns } from "./more-command";

it("configurations are named one by one, and as a shell takes them", () => {
  const command = moreRuns("vast exec local run --resume=r/hall", ["hall-1", "it's (2)"], usualRuns(10));
  expect(command).toBe(`vast exec local run --resume=r/hall --config=hall-1 --config='it'"'"'s (2)' --runs=20`);
  expect(moreRuns("vast", [], 5)).toBe("vast --runs=5");
});
