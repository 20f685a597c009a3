import { describe, expect, it } from "vitest";
import { chosen } from "./expansion";

const variants = {
  name: ["hall-1", "hall-2", "hall-10", "office-1", "a*b", "a.b", "a[1]"],
  entry: ["hall", "hall", "hall", "office", "odd", "odd", "odd"],
  values: {},
};
const found = (pattern: string) => chosen(variants, pattern).map((place) => variants.name[place]);

describe("a pattern", () => {
  it.each([
    ["", variants.name],
    ["hall", ["hall-1", "hall-2", "hall-10"]],
    ["hall-1", ["hall-1"]],
    ["hall-?", ["hall-1", "hall-2"]],
    ["*-1", ["hall-1", "office-1"]],
    ["hall-[12]", ["hall-1", "hall-2"]],
    ["hall-[!1]", ["hall-2"]],
    ["hall-[2-9]", ["hall-2"]],
    ["hall-[9-2]", []],
    ["off*", ["office-1"]],
    ["a*b", ["a*b"]],
    ["a.?", ["a.b"]],
    ["a[[]1]", ["a[1]"]],
    ["a[[]1", []],
    ["hall-1 ", []],
    ["^hall", []],
    ["(", []],
  ])("%s", (pattern, names) => expect(found(pattern)).toEqual(names));
});
