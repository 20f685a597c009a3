// Several campaigns beside an earlier one: a column for each campaign, a row for each configuration.
import { useMemo } from "preact/hooks";
import { address, type Compared, type Comparison, type Sample } from "./api";
import { order, show } from "./data";
import { percent } from "./format";
import { Grid, type Column } from "./grid";
import { useAnswer } from "./live";
import { Export, Waiting } from "./parts";
import { choose, link } from "./route";
import { COMMON, COMPARE, SEVERAL } from "./text";

type Variant = Comparison["variants"][number];

/** The worst first; what is not compared comes last. */
const CHANGES = ["worse", "unclear", "better", "same"] as const;
const SIGNS = { worse: "▲", better: "▼", unclear: "?", same: "" };
/** Share of comparisons of equal campaigns that chance calls worse or better. */
const LEVEL = 0.05;

interface SeveralProps {
  before: string;
  later: string[];
  query: URLSearchParams;
}

/** A configuration: as it was before, and how it is in each campaign that has it. */
export interface Row {
  name: string;
  before: Sample;
  after: (Variant | null)[];
}

export function Several({ before, later, query }: SeveralProps) {
  const { data, error } = useAnswer<Compared[]>(address(["comparisons"], { a: before, b: later }));
  const all = useMemo(() => rowsOf(data ?? []), [data]);
  const sort = query.get("sort") ?? "";
  const rows = useMemo(() => ordered(all, sort), [all, sort]);
  if (!data) return <Waiting error={error} />;
  return (
    <>
      <div class="scroll" tabIndex={0} role="region" aria-label={COMMON.campaigns}>
        <table class="plain">
          <thead>
            <tr>
              <th scope="col">{COMMON.campaign}</th>
              <th scope="col" class="number">{COMMON.unsuccessful}</th>
              <th scope="col" class="number">{SEVERAL.points}</th>
              <th scope="col" class="number">{COMMON.pValue}</th>
              <th scope="col" class="number">{SEVERAL.worse}</th>
              <th scope="col" class="number">{SEVERAL.better}</th>
              <th scope="col" class="number">{SEVERAL.unclear}</th>
            </tr>
          </thead>
          <tbody>
            {data.map((one) => (
              <Summary key={one.name} before={before} compared={one} />
            ))}
          </tbody>
        </table>
      </div>
      <p class="quiet note">
        {SEVERAL.note(before, data.length, 1 - (1 - LEVEL) ** data.length)}
      </p>
      <h2>{COMMON.configurations}</h2>
      <div class="tools">
        <span class="quiet">{SEVERAL.legend}</span>
        <Export name={`beside-${before}`} rows={() => exported(before, later, rows.map((row) => all[row]!))} />
      </div>
      {rows.length > 0 ? (
        <Grid
          label={COMMON.configurations}
          columns={columnsOf(before, later, all)}
          rows={rows}
          sort={sort}
          onSort={(next) => choose({ sort: next })}
          open={(row) => (location.hash = configuration(before, all[row]!.name))}
          frozen={1}
        />
      ) : (
        <p class="hint">{SEVERAL.none(before)}</p>
      )}
    </>
  );
}

function Summary({ before, compared: { name, comparison } }: { before: string; compared: Compared }) {
  const { overall, variants } = comparison;
  const count = (change: Variant["change"]) => variants.filter((variant) => variant.change === change).length;
  
  const isCompared = overall.a.runs > 0 && overall.b.runs > 0;
  return (
    <tr>
      <th scope="row">
        <a href={link(["compare"], { a: before, b: encodeURIComponent(name) })}>{name}</a>
      </th>
      <td class="number">
        {rate(overall.b)} <small>{isCompared && SEVERAL.insteadOf(rate(overall.a))}</small>
      </td>
      <td class="number">
        {isCompared ? SEVERAL.range(share(overall.b) - share(overall.a), overall.low, overall.high) : "–"}
      </td>
      <td class="number">{isCompared ? show(Number(overall.p.toPrecision(2))) : "–"}</td>
      <td class="number">{count("worse")}</td>
      <td class="number">{count("better")}</td>
      <td class="number">{count("unclear")}</td>
    </tr>
  );
}

/** The configurations that are in any of the campaigns. */
export function rowsOf(compared: Compared[]): Row[] {
  const rows = new Map<string, Row>();
  compared.forEach(({ comparison }, place) => {
    for (const variant of comparison.variants) {
      const name = variant.name_a;
      if (!rows.has(name)) rows.set(name, { name, before: variant.difference.a, after: compared.map(() => null) });
      rows.get(name)!.after[place] = variant;
    }
  });
  return [...rows.values()];
}

/** Places of rows: the worst change first, and of equal ones what has it in more campaigns; or by a column. */
export function ordered(rows: Row[], sort: string): number[] {
  const column = sort.replace(/^-/, "");
  const sign = sort.startsWith("-") ? -1 : 1;
  const keys = rows.map((row) => keyOf(row, column));
  return rows.map((_, place) => place).sort((i, j) => sign * order(keys[i], keys[j]) || i - j);
}

function keyOf(row: Row, column: string): string | number | null {
  if (column === "variant") return row.name;
  if (column === "before") return row.before.runs ? share(row.before) : null;
  if (column) {
    const variant = row.after[Number(column)];
    return variant?.difference.b.runs ? share(variant.difference.b) : null;
  }
  const changes = row.after.map((variant) => CHANGES.indexOf(variant?.change ?? "same"));
  const worst = Math.min(...changes);
  return worst - changes.filter((change) => change === worst).length / (changes.length + 1);
}

function columnsOf(before: string, later: string[], rows: Row[]): Column[] {
  return [
    {
      id: "variant",
      label: COMMON.configuration,
      cell: (row) => <a href={configuration(before, rows[row]!.name)}>{rows[row]!.name}</a>,
    },
    { id: "before", label: before, kind: "number", cell: (row) => <Rate of={rows[row]!.before} /> },
    ...later.map((name, place): Column => ({
      id: String(place),
      label: name,
      kind: "number",
      cell: (row) => {
        const variant = rows[row]!.after[place];
        return variant ? <After {...{ name, variant }} /> : "–";
      },
    })),
  ];
}

function After({ name, variant: { name_b, change, difference } }: { name: string; variant: Variant }) {
  return (
    <a href={configuration(name, name_b)}>
      <Rate of={difference.b} />{" "}
      {SIGNS[change] && (
        <span class={`change ${change}`} role="img" aria-label={COMPARE.words[change]}>
          {SIGNS[change]}
        </span>
      )}
    </a>
  );
}

function Rate({ of }: { of: Sample }) {
  return (
    <>
      {rate(of)} <small>{`${of.bad}/${of.runs}`}</small>
    </>
  );
}

function configuration(campaign: string, variant: string): string {
  return link(["campaign", campaign], { q: `variant=${variant}` });
}

function share(sample: Sample): number {
  return sample.bad / sample.runs;
}

function rate(sample: Sample): string {
  return sample.runs ? percent(share(sample)) : "–";
}

function exported(before: string, later: string[], rows: Row[]): unknown[][] {
  const heads = later.flatMap((name) => [...SEVERAL.head(name), SEVERAL.headOfChange(name)]);
  return [
    ["configuration", ...SEVERAL.head(before), ...heads],
    ...rows.map(({ name, before, after }) => [
      name,
      before.bad,
      before.runs,
      ...after.flatMap((one) => (one ? [one.difference.b.bad, one.difference.b.runs, one.change] : [null, null, null])),
    ]),
  ];
}
