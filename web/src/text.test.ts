// Views take what a user reads from text.ts: there it can be reviewed in one place.
import { expect, it } from "vitest";
import { parseSync } from "vite";

type Node = { type: string; [key: string]: unknown };

const SOURCES = import.meta.glob<string>("./**/*.tsx", { query: "?raw", import: "default", eager: true });

/** Attributes and properties that are shown or read out. */
const SHOWN = new Set(["title", "placeholder", "label", "alt", "what", "aria-label", "aria-valuetext", "aria-description"]);
/** What may stand in a view; it needs no review. */
const ALLOWED = new Set<string>([]);

/** Texts in an expression that become its value, or a part of it. */
function values(node: Node): string[] {
  const of = (...keys: string[]) => keys.flatMap((key) => values(node[key] as Node));
  switch (node.type) {
    case "Literal":
      return typeof node.value === "string" ? [node.value] : [];
    case "TemplateLiteral":
      return [
        ...(node.quasis as Node[]).map((quasi) => (quasi.value as { raw: string }).raw),
        ...(node.expressions as Node[]).flatMap(values),
      ];
    case "ConditionalExpression":
      return of("consequent", "alternate");
    case "LogicalExpression":
      return node.operator === "&&" ? of("right") : of("left", "right");
    case "BinaryExpression":
      return node.operator === "+" ? of("left", "right") : [];
    case "ArrayExpression":
      return (node.elements as Node[]).flatMap(values);
    case "JSXExpressionContainer":
    case "TSAsExpression":
    case "TSNonNullExpression":
    case "ParenthesizedExpression":
      return of("expression");
    default:
      return [];
  }
}

function shown(node: Node): string[] {
  switch (node.type) {
    case "JSXText":
      return [node.value as string];
    case "JSXElement":
    case "JSXFragment":
      return (node.children as Node[]).filter(({ type }) => type === "JSXExpressionContainer").flatMap(values);
    case "JSXAttribute":
      return SHOWN.has((node.name as { name: string }).name) && node.value ? values(node.value as Node) : [];
    case "Property":
      return SHOWN.has((node.key as { name: string }).name) ? values(node.value as Node) : [];
    default:
      return [];
  }
}

function textsOf(value: unknown): string[] {
  if (Array.isArray(value)) return value.flatMap(textsOf);
  if (value === null || typeof value !== "object") return [];
  const below = Object.values(value).flatMap(textsOf);
  return "type" in value ? [...shown(value as Node), ...below] : below;
}

/** Words that a component shows by itself. */
function wordsOf(name: string, source: string): string[] {
  const { program, errors } = parseSync(name, source);
  expect(errors, name).toEqual([]);
  return textsOf(program).map((text) => text.trim()).filter((text) => /\p{L}/u.test(text) && !ALLOWED.has(text));
}

it("holds all texts that views show", () => {
  expect(Object.keys(SOURCES).length).toBeGreaterThan(30);
  for (const [name, source] of Object.entries(SOURCES)) expect(wordsOf(name, source), name).toEqual([]);
});

it.each([
  ["<p>Some words</p>", "Some words"],
  ["<p>{a ? 'one' : b}</p>", "one"],
  ["<p>{a && `${b} s`}</p>", "s"],
  ["<a title='one'>{b}</a>", "one"],
  ["<a aria-label={`one ${b}`}>{b}</a>", "one"],
  ["const a = { label: 'one', id: 'two' }", "one"],
])("would be noticed to lack the text of %s", (source, text) => {
  expect(wordsOf("a.tsx", source)).toEqual([text]);
});

it("leaves names alone that nobody reads", () => {
  expect(wordsOf("a.tsx", "<a class='one' href={link('two')} aria-current={b ? 'page' : undefined}>{c}: {show('d')}</a>")).toEqual([]);
});
