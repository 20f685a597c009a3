// Which configurations a name or a glob chooses; `vast exec local run --config` chooses the same.

import type { VariantColumns } from "./api";

/** Places of the configurations whose name, or whose entry's name, is the pattern, or else is like it. */
export function chosen({ name, entry }: VariantColumns, pattern: string): number[] {
  const places = name.map((_, place) => place);
  if (!pattern) return places;
  const exact = places.filter((place) => name[place] === pattern || entry[place] === pattern);
  if (exact.length) return exact;
  const like = glob(pattern);
  return places.filter((place) => like.test(name[place]!) || like.test(entry[place]!));
}

/** `*`, `?`, `[abc]`, `[a-c]` and `[!abc]`, as in Python's fnmatch. */
function glob(pattern: string): RegExp {
  const parts = pattern.match(/\[!?\]?[^\]]*\]|[^]/g) ?? [];
  const source = parts.map((part) => {
    if (part === "*") return ".*";
    if (part === "?") return ".";
    return part.length > 1 ? set(part) : part.replace(/[\\^$.|+()[\]{}]/, "\\$&");
  });
  try {
    return new RegExp(`^(?:${source.join("")})$`, "s");
  } catch {
    return /$^/; // a range from high to low matches nothing
  }
}

function set(part: string): string {
  const negated = part[1] === "!";
  const inner = part.slice(negated ? 2 : 1, -1).replace(/[\\^[\]&|~]/g, "\\$&");
  return `[${negated ? "^" : ""}${inner}]`;
}
