// What was varied, and which of it makes runs fail.
import { useMemo, useRef } from "preact/hooks";
import { address, type Columns, type Effect, type Factors } from "./api";
import { axis, factors, order, others, show, titled, unitOf, varies, type Axis } from "./data";

import { useAnswer } from "./live";
import type { Option } from "./parts";
import { choose } from "./route";
import { FACTORS, GROUPS } from "./text";

/** What chance alone shows as clearly less often than this explains failures. */
const LEVEL = 0.05;
/** Factors that are shown at most. */
const MOST = 8;

/** The factors of a campaign, and those that an address chooses for the axes. */
export interface Axes {
  /** Factors that vary, without those that others determine. */
  names: string[];
  x: string;
  y: string;
  across: Axis;
  down: Axis;
  options: Option[];
  /** Null while it is computed, or when it cannot be. */
  explained: Factors | null;
  /** Whether the axes are known; the usual ones are those that separate failures best. */
  ready: boolean;
}

/** The usual axes of `data` are those of the campaign `of`, which a comparison begins with. */
export function useAxes(data: Columns, query: URLSearchParams, of = data.summary.name): Axes {
  const { data: explained, error } = useAnswer<Factors>(
    address(["campaigns", of, "factors"]),
    (answer, versions) => (versions[of] ?? answer.version) !== answer.version,
  );
  const usual = useUsual(data, explained);
  const names = useMemo(() => {
    const known = explained?.factors.filter((name) => name in data.variants.values);
    return known?.length ? known : factors(data);
  }, [data, explained]);
  const x = axisName(query.get("x"), usual?.[0] ?? (error ? names[0] : ""));
  const y = axisName(query.get("y"), usual?.[1] ?? (error ? names[1] : ""));
  const across = useMemo(() => axis(data, x), [data, x]);
  const down = useMemo(() => axis(data, y), [data, y]);
  const options = useMemo(() => optionsOf(data, names, [x, y]), [data, names, x, y]);
  const ready = !data.reading && (usual !== null || error !== null || (query.has("x") && query.has("y")));
  return { names, x, y, across, down, options, explained, ready };
}

/** The usual axes; while a campaign runs they stay as they were. */
function useUsual(data: Columns, explained: Factors | null): string[] | null {
  const { name, state } = data.summary;
  const kept = useRef({ name: "", axes: [] as string[] });
  if (!explained) return null;
  if (state !== "running" || kept.current.name !== name) {
    const axes = explained.axes.filter((one) => one in data.variants.values);
    kept.current = { name, axes: inShownOrder(axes) };
  }
  return kept.current.axes;
}

/** Axes by their names in any order, as this tab showed them first. */
const shownAxes = new Map<string, string[]>();

/** The same two axes stay where they are, whichever separates the failures of a campaign better. */
function inShownOrder(axes: string[]): string[] {
  const key = JSON.stringify([...axes].sort());
  if (!shownAxes.has(key)) shownAxes.set(key, axes);
  return shownAxes.get(key)!;
}

/** `-` stands for no factor, nothing for the usual one. */
function axisName(asked: string | null, usual: string | undefined): string {
  return asked === "-" ? "" : asked || usual || "";
}

function optionsOf(data: Columns, names: string[], chosen: string[]): Option[] {
  const rest = [...others(data), ...chosen.filter((name) => name && data.factors.includes(name))];
  const more = [...new Set(rest)].filter((name) => !names.includes(name));
  return [["", FACTORS.none], ...namesAsOptions(data, names, more)];
}

/** What was varied, then other parameters, those with one value last. */
export function namesAsOptions(data: Columns, names: string[], rest: string[]): Option[] {
  const others = rest.map((name): Option => [name, name, varies(data, name) ? GROUPS.derived : GROUPS.constant]);
  return [
    ...names.map((name): Option => [name, titled(data, name), GROUPS.varied]),
    ...others.sort((a, b) => order(a[2], b[2])),
  ];
}

/** Whether a variant is in the cell `column,row`; every one is when there is no cell. */
export function isInCell({ across, down, ready }: Axes, cell: string, variant: number): boolean {
  const [i, j] = cell.split(",").map(Number);
  return !cell || !ready || (across.group[variant] === i && down.group[variant] === j);
}

/** Why the matrix begins with its axes; nothing where others were chosen. */
export function AxesNote({ axes }: { axes: Axes }) {
  const { explained, x, y } = axes;
  if (!explained || !x) return null;
  const usual = explained.axes.length === (y ? 2 : 1) && [x, y].every((name) => !name || explained.axes.includes(name));
  if (!usual) return null;
  return <p class="quiet note">{noteOf(explained)}</p>;
}

function noteOf({ axes, effects }: Factors): string {
  const isClear = (name: string) => effects.some(({ factor, p }) => factor === name && p < LEVEL);
  return FACTORS.axes(axes, effects.length > 0, axes.filter((name) => !isClear(name)));
}

/** How much more often runs fail with the worst values of each factor. */
export function Effects({ data, axes }: { data: Columns; axes: Axes }) {
  const found = axes.explained?.effects ?? [];
  if (found.length === 0) return null;
  return (
    <section class="effects" aria-labelledby="effects">
      <h2 id="effects">{FACTORS.title}</h2>
      <ul>
        {found.slice(0, MOST).map((effect) => (
          <Item key={effect.factor} {...{ data, effect }} chosen={effect.factor === axes.x} />
        ))}
      </ul>
    </section>
  );
}

function Item({ data, effect, chosen }: { data: Columns; effect: Effect; chosen: boolean }) {
  const { factor, worse, better, low, high, p, same } = effect;
  const clear = p < LEVEL;
  const unit = unitOf(data, factor);
  const points = (share: number) => Math.round(100 * share);
  const places = (from: number, to: number) => ({
    left: `${Math.max(0, 100 * from).toFixed(1)}%`,
    width: `${(100 * Math.max(0, Math.min(1, to) - Math.max(0, from))).toFixed(1)}%`,
  });
  const sure = FACTORS.interval(points(low), points(high), show(Number(p.toPrecision(2))));
  return (
    <li>
      <button
        type="button"
        class={clear ? undefined : "unclear"}
        aria-pressed={chosen}
        title={sure}
        onClick={() => choose({ x: factor, cell: "" })}
      >
        <span class="cause">
          {[factor, ...same].join(" = ")} {worse.condition}
          {unit && ` ${unit}`}
        </span>
        <span class="amount">{FACTORS.points(points(rate(worse) - rate(better)))}</span>
        <span class="gauge" aria-hidden="true">
          <span class="share" style={places(0, rate(worse) - rate(better))} />
          <span class="range" style={places(low, high)} />
        </span>
        <small>
          {FACTORS.rates(rate(worse), rate(better))}
          {clear ? FACTORS.sure(points(low), points(high)) : FACTORS.unclear}
        </small>
      </button>
    </li>
  );
}

function rate({ bad, runs }: { bad: number; runs: number }): number {
  return runs ? bad / runs : 0;
}
