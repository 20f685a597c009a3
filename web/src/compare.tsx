// Campaigns beside an earlier one: what got worse, and whether chance explains it.
import { useMemo } from "preact/hooks";
import { address, type Campaigns, type Columns, type Comparison, type Difference } from "./api";
import { Changes } from "./about";
import { show, variantOf, type Run } from "./data";
import { duration, percent } from "./format";
import { Grid, type Column } from "./grid";
import { useAnswer } from "./live";
import { isInCell, useAxes, type Axes } from "./factors";
import { Matrix } from "./matrix";
import { Several } from "./compare-several";
import { Export, Select, Waiting, type Option } from "./parts";
import { Pick } from "./pick";
import { choose, joined, link, split } from "./route";
import { COMMON, COMPARE } from "./text";



/** `after` holds the names of one or several campaigns. */
export function ComparePage({ before, after, query }: { before: string; after: string; query: URLSearchParams }) {
  const known = useAnswer<Campaigns>(address(["campaigns"]));
  const later = split(after);
  const names = [...new Set([...Object.keys(known.data?.campaigns ?? {}), before, ...later])].filter(Boolean);
  const options = names.map((name): Option => [name, name]);
  const toggle = (name: string, on: boolean) =>
    choose({ b: joined(on ? [...later, name] : later.filter((one) => one !== name)), cell: "", sort: "" });
  return (
    <>
      <div class="head">
        <h1>{COMPARE.title}</h1>
        <div class="tools">
          <Select label={COMPARE.before} value={before} options={options} onChoose={(name) => choose({ a: name })} />
          <Pick
            label={COMPARE.after}
            text={later.length === 1 ? later[0]! : String(later.length)}
            several
            options={options.filter(([name]) => name !== before || later.includes(name))}
            chosen={later}
            onChoose={toggle}
          />
        </div>
      </div>
      {later.length === 0 && <p class="hint">{COMPARE.choose(before)}</p>}
      {later.length === 1 && <Pair a={before} b={later[0]!} query={query} />}
      {later.length > 1 && <Several {...{ before, later, query }} />}
    </>
  );
}

function Pair({ a, b, query }: { a: string; b: string; query: URLSearchParams }) {
  const { data, error } = useAnswer<Comparison>(address(["compare"], { a, b }));
  const later = useAnswer<Columns>(address(["campaigns", b]));
  if (!data || !later.data) return <Waiting error={error ?? later.error} />;
  return <Result data={data} later={later.data} a={a} b={b} query={query} />;
}

interface ResultProps {
  data: Comparison;
  /** The later campaign. */
  later: Columns;
  a: string;
  b: string;
  query: URLSearchParams;
}

function Result({ data, later, a, b, query }: ResultProps) {
  const sort = query.get("sort") ?? "";
  const cell = query.get("cell") ?? "";
  const axes = useAxes(later, query, a);
  const rows = useMemo(() => {
    const places = new Map(later.variants.name.map((name, place) => [name, place]));
    const isShown = (row: number) => isInCell(axes, cell, places.get(data.variants[row]!.name_b)!);
    return order(data, sort).filter(isShown);
  }, [data, later, sort, cell, axes.across, axes.down]);
  const worse = data.variants.filter((variant) => variant.change === "worse").length;
  const better = data.variants.filter((variant) => variant.change === "better").length;
  const columns = columnsOf(data, a, b);
  return (
    <>
      <p class="statement">{data.statement}</p>
      <Interval found={data.overall} />
      <p>
        {COMPARE.counts(data.variants.length, worse, better)}
        {COMPARE.test}
        {powerOf(data)}
        {data.only_a.length > 0 && COMPARE.onlyBefore(data.only_a.length)}
        {data.only_b.length > 0 && COMPARE.onlyAfter(data.only_b.length)}
      </p>
      <Changes a={a} b={b} />
      {axes.names.length > 0 && <Differences {...{ data, later, axes, cell }} />}
      <h2>{COMMON.configurations}</h2>
      <div class="tools">
        {cell && (
          <button type="button" onClick={() => choose({ cell: "" })}>
            {COMMON.onlyCell}
          </button>
        )}
        <Export name={`${a}-${b}`} rows={() => exported(data, rows)} />
      </div>
      {rows.length > 0 && (
        <Grid
          label={COMPARE.grid}
          columns={columns}
          rows={rows}
          sort={sort || "p"}
          onSort={(next) => choose({ sort: next })}
          open={(row) => (location.hash = variantLink(b, data.variants[row]!.name_b))}
        />
      )}
    </>
  );
}

/** Which changes so many runs could have shown at all. */
function powerOf({ variants, visible, least_p, needed_runs, detectable }: Comparison): string {
  if (variants.length === 0) return "";
  const few = COMPARE.power(variants.length, visible, show(Number(least_p.toPrecision(3))), needed_runs);
  return few + (detectable === null ? "" : COMPARE.detectable(detectable));
}

interface DifferencesProps {
  data: Comparison;
  later: Columns;
  axes: Axes;
  cell: string;
}

/** Where the failure rate changed, over any two parameters. */
function Differences({ data, later, axes, cell }: DifferencesProps) {
  const measure = useMemo(() => {
    const points = new Map(
      data.variants.map(({ name_b, difference: { a, b } }) => [name_b, 100 * (rate(b) - rate(a))]),
    );
    const of = (run: Run) => points.get(variantOf(later, run)) ?? null;
    return { name: COMPARE.measure, of };
  }, [data, later]);
  const runs = useMemo(() => later.runs.number.map((_, run) => run), [later]);
  return (
    <>
      <h2>{COMPARE.byParameter}</h2>
      <Matrix
        {...{ data: later, runs, axes, measure }}
        chooser={<span class="quiet">{COMPARE.legend}</span>}
        signed
        chosen={cell}
      />
    </>
  );
}

function variantLink(campaign: string, variant: string): string {
  return link(["campaign", campaign], { q: `variant=${variant}` });
}

/** The interval of the difference, drawn around nothing. */
function Interval({ found }: { found: Difference }) {
  const most = Math.max(0.05, Math.abs(found.low), Math.abs(found.high)) * 1.1;
  const x = (value: number) => 200 + (200 * value) / most;
  const change = rate(found.b) - rate(found.a);
  const label = COMPARE.interval(change, found.low, found.high);
  return (
    <svg class="interval" viewBox="-20 0 440 58" role="img" aria-label={label}>
      <line x1={0} x2={400} y1={24} y2={24} class="axis" />
      <line x1={200} x2={200} y1={8} y2={40} class="axis" />
      <line x1={x(found.low)} x2={x(found.high)} y1={24} y2={24} class="range" />
      <circle cx={x(change)} cy={24} r={6} class="point" />
      <text x={0} y={54}>{COMPARE.words.better}</text>
      <text x={200} y={54} text-anchor="middle">{COMPARE.noDifference}</text>
      <text x={400} y={54} text-anchor="end">{COMPARE.words.worse}</text>
    </svg>
  );
}

function rate(sample: { runs: number; bad: number }): number {
  return sample.runs ? sample.bad / sample.runs : 0;
}

function valueOf(data: Comparison, row: number, column: string): number | string {
  const variant = data.variants[row]!;
  const { a, b, p } = variant.difference;
  switch (column) {
    case "a":
      return rate(a);
    case "b":
      return rate(b);
    case "difference":
      return rate(b) - rate(a);
    case "duration":
      return (b.duration ?? 0) - (a.duration ?? 0);
    case "variant":
      return variant.name_b;
    case "change":
      return variant.change;
    case "more":
      return variant.change === "unclear" ? (variant.more_runs ?? Infinity) : -1;
    default:
      return p;
  }
}

function order(data: Comparison, sort: string): number[] {
  const down = sort.startsWith("-");
  const column = sort.replace(/^-/, "") || "p";
  const sign = down ? -1 : 1;
  const compare = (left: number | string, right: number | string) => (left < right ? -1 : left > right ? 1 : 0);
  return data.variants
    .map((_, row) => row)
    .sort((i, j) => sign * compare(valueOf(data, i, column), valueOf(data, j, column)) || i - j);
}

function columnsOf(data: Comparison, a: string, b: string): Column[] {
  const of = (row: number) => data.variants[row]!;
  const shares = (sample: { runs: number; bad: number }) => (
    <>
      {sample.runs ? percent(rate(sample)) : "–"} <small>{`${sample.bad}/${sample.runs}`}</small>
    </>
  );
  const points = (row: number) => {
    const difference = 100 * (valueOf(data, row, "difference") as number);
    return (difference > 0 ? "+" : "") + difference.toFixed(1);
  };
  return [
    { id: "change", label: COMPARE.change, cell: (row) => <span class={`change ${of(row).change}`}>{COMPARE.changes[of(row).change]}</span> },
    {
      id: "variant",
      label: COMMON.configuration,
      cell: (row) => <a href={variantLink(b, of(row).name_b)}>{of(row).name_b}</a>,
    },
    {
      id: "a",
      label: COMPARE.unsuccessfulBefore,
      kind: "number",
      cell: (row) => <a href={variantLink(a, of(row).name_a)}>{shares(of(row).difference.a)}</a>,
    },
    { id: "b", label: COMPARE.unsuccessfulAfter, kind: "number", cell: (row) => shares(of(row).difference.b) },
    { id: "difference", label: COMPARE.points, kind: "number", cell: points },
    { id: "p", label: COMMON.pValue, kind: "number", cell: (row) => show(Number(of(row).difference.p.toPrecision(3))) },
    {
      id: "adjusted",
      label: COMPARE.corrected,
      kind: "number",
      cell: (row) => show(Number(of(row).adjusted_p.toPrecision(3))),
    },
    { id: "more", label: COMPARE.moreRuns, kind: "number", cell: (row) => moreRuns(of(row)) },
    {
      id: "duration",
      label: COMPARE.medianDuration,
      kind: "number",
      cell: (row) => `${duration(of(row).difference.a.duration)} → ${duration(of(row).difference.b.duration)}`,
    },
  ];
}

/** How many further runs of each campaign decide what is unclear. */
function moreRuns({ change, more_runs }: Comparison["variants"][number]): string {
  return change === "unclear" ? (more_runs === null ? COMPARE.tooMany : String(more_runs)) : "";
}

function exported(data: Comparison, rows: number[]): unknown[][] {
  
  const line = (row: number) => {
    const { name_a, name_b, change, adjusted_p, difference } = data.variants[row]!;
    const { a, b, p } = difference;
    return [name_a, name_b, change, a.runs, a.bad, b.runs, b.bad, p, adjusted_p, a.duration, b.duration];
  };
  return [COMPARE.head, ...rows.map(line)];
}
