import { expect, it } from "vitest";
import { sinceStart, stamped } from "./times";

it("counts seconds from the start of the run", () => {
  expect(sinceStart([1795396220.5, null, 1795396221], 1795396219)).toEqual([1.5, null, 2]);
});

it("reads nanoseconds, of the epoch and of a simulation", () => {
  expect(sinceStart([1795396220500000000, 1795396221000000000], 1795396219)).toEqual([1.5, 2]);
  expect(sinceStart([0, 100000000, 200000000], 1795396219)).toEqual([0, 0.1, 0.2]);
});

it("leaves simulated seconds, and begins at the first time of another clock", () => {
  expect(sinceStart([0, 0.1], 1795396219)).toEqual([0, 0.1]);
  expect(sinceStart([1600000000, 1600000001], 1795396219)).toEqual([0, 1]);
  expect(sinceStart([], null)).toEqual([]);
});

it("takes the stamps out of a line of a log", () => {
  const line = "[ERROR] [100000012.500000] [run]: [INFO] [100000012.400000123] [robot]: on";
  expect(stamped(line, 100000010)).toEqual({ at: "2.500", text: "[ERROR] [run]: [INFO] [robot]: on" });
  expect(stamped("plain", 100000010)).toEqual({ at: "", text: "plain" });
});
