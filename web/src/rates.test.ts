import { describe, expect, it } from "vitest";
import { anytime, intervalText, wilson, type Interval } from "./rates";

function expectClose(found: Interval, expected: Interval): void {
  expect(found[0]).toBeCloseTo(expected[0], 5);
  expect(found[1]).toBeCloseTo(expected[1], 5);
}

// Figures of robovast.base.statistics.
describe("intervals", () => {
  it("are Wilson's where the number of runs was fixed", () => {
    expectClose(wilson(0, 0), [0.000000, 1.000000]);
    expectClose(wilson(0, 1), [0.000000, 0.793451]);
    expectClose(wilson(3, 3), [0.438503, 1.000000]);
    expectClose(wilson(5, 40), [0.054595, 0.261121]);
    expectClose(wilson(30, 40), [0.598060, 0.858129]);
    expectClose(wilson(499, 1000), [0.468073, 0.529934]);
  });

  it("hold at any time where runs are added", () => {
    expectClose(anytime(0, 0), [0.000000, 1.000000]);
    expectClose(anytime(0, 1), [0.000000, 0.975000]);
    expectClose(anytime(3, 3), [0.232079, 1.000000]);
    expectClose(anytime(5, 40), [0.020768, 0.344384]);
    expectClose(anytime(30, 40), [0.511738, 0.914424]);
    expectClose(anytime(499, 1000), [0.443394, 0.554623]);
  });

  it("are short to read", () => {
    expect(intervalText([0.036, 0.62])).toBe("3.6 – 62 %");
    expect(intervalText([0, 1])).toBe("0 – 100 %");
    expect(intervalText([1e-17, 1 - 1e-16])).toBe("0 – 100 %");
    expect(intervalText([0.001, 0.996])).toBe("0.1 – 99.6 %");
    expect(intervalText([0.00001, 0.9996])).toBe("<0.1 – >99.9 %");
    expect(intervalText([0.0996, 0.9949])).toBe("10 – 99 %");
  });
});
