import { expect, it } from "vitest";
import { progress } from "./pending";

const awaited = (url: string, bytes = 0, since = 0) => ({ url: `api/${url}`, bytes, since });

it("says what has been waited for the longest, and how much of it is there", () => {
  expect(progress([], {}, 0)).toBe("");
  expect(progress([awaited("campaigns/hall/factors", 0, 9), awaited("campaigns/hall")], { hall: [3400, 10000] }, 2000)).toBe(
    "Loading the runs … 3\u202f400 of 10\u202f000 configurations of hall read",
  );
  expect(progress([awaited("campaigns/hall", 3_200_000)], { office: [1, 2] }, 2000)).toBe("Loading the runs … 3.2 MB so far");
  expect(progress([awaited("search/hall/map?x=a")], {}, 4200)).toBe("Loading the failure map … 4 s so far");
  expect(progress([awaited("else")], {}, 1000)).toBe("Loading the data … 1 s so far");
});
