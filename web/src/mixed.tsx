// Configurations of which some runs passed and others did not: the least certain ones first.
import { useMemo } from "preact/hooks";
import type { Columns, Verdict } from "./api";
import { brief, order, show, titled, verdictOf, type Run } from "./data";
import { percent } from "./format";
import { Grid, type Column } from "./grid";
import { GLYPHS } from "./parts";
import { choose, link } from "./route";
import { COMMON, MIXED } from "./text";

/** Runs of a strip that are drawn. */
const MOST = 60;
const MOST_COLUMNS = 8;

interface Mixed {
  variant: number;
  verdicts: Verdict[];
  rate: number;
}

export function mixed(data: Columns, runs: Run[]): Mixed[] {
  const groups = new Map<number, Verdict[]>();
  for (const run of runs) {
    const verdict = verdictOf(data, run);
    if (verdict === "interrupted") continue;
    const variant = data.runs.variant[run]!;
    const known = groups.get(variant);
    if (known) known.push(verdict);
    else groups.set(variant, [verdict]);
  }
  const rated = [...groups].map(([variant, verdicts]) => {
    const bad = verdicts.filter((verdict) => verdict !== "passed").length;
    return { variant, verdicts, rate: bad / verdicts.length };
  });
  const certainty = ({ rate }: Mixed) => Math.abs(rate - 0.5);
  return rated.filter(({ rate }) => rate > 0 && rate < 1).sort((a, b) => certainty(a) - certainty(b) || b.rate - a.rate);
}

interface MixedProps {
  data: Columns;
  runs: Run[];
  names: string[];
  sort: string;
}

export function MixedList({ data, runs, names, sort }: MixedProps) {
  const found = useMemo(() => mixed(data, runs), [data, runs]);
  const rows = useMemo(() => sortedBy(data, found, sort), [data, found, sort]);
  if (found.length === 0) return <p class="hint">{MIXED.none}</p>;
  const value = (name: string, row: number) => data.variants.values[name]![found[row]!.variant];
  const only = (row: number) =>
    link(["campaign", data.summary.name], { q: `variant=${data.variants.name[found[row]!.variant]}` });
  const columns: Column[] = [
    { id: "variant", label: COMMON.configuration, cell: (row) => <a href={only(row)}>{data.variants.name[found[row]!.variant]}</a> },
    { id: "strip", label: COMMON.runs, cell: (row) => <Strip verdicts={found[row]!.verdicts} /> },
    { id: "rate", label: COMMON.unsuccessful, kind: "number", cell: (row) => percent(found[row]!.rate) },
    ...names.slice(0, MOST_COLUMNS).map((name): Column => ({
      id: `p:${name}`,
      label: titled(data, name),
      cell: (row) => <span title={show(value(name, row))}>{brief(value(name, row))}</span>,
    })),
  ];
  return (
    <Grid
      label={MIXED.label}
      columns={columns}
      rows={rows}
      sort={sort}
      onSort={(mixed) => choose({ mixed })}
      open={(row) => (location.hash = only(row))}
      frozen={1}
    />
  );
}

function sortedBy(data: Columns, found: Mixed[], sort: string): number[] {
  const rows = found.map((_, row) => row);
  const column = sort.replace(/^-/, "");
  if (!column || column === "strip") return rows;
  const key = (row: number): unknown => {
    const { variant, rate } = found[row]!;
    if (column === "rate") return rate;
    return column === "variant" ? data.variants.name[variant] : data.variants.values[column.slice(2)]?.[variant];
  };
  const sign = sort.startsWith("-") ? -1 : 1;
  return rows.sort((a, b) => sign * order(key(a), key(b)) || a - b);
}

function Strip({ verdicts }: { verdicts: Verdict[] }) {
  const bad = verdicts.filter((verdict) => verdict !== "passed").length;
  return (
    <span class="outcomes" role="img" aria-label={MIXED.strip(bad, verdicts.length)}>
      {verdicts.slice(0, MOST).map((verdict, place) => (
        <span key={place} class={verdict}>
          {GLYPHS[verdict]}
        </span>
      ))}
      {verdicts.length > MOST && "…"}
    </span>
  );
}
