// What the cells of a matrix are coloured by: the failure rate, the duration, a column of a table.
import { useMemo } from "preact/hooks";
import { address, type Columns, type Metric, type MetricColumns } from "./api";
import { variantOf, type Run, type Shown } from "./data";
import { useAnswer } from "./live";
import { Select, type Option } from "./parts";
import { Pick } from "./pick";
import { choose } from "./route";
import { COMMON, GROUPS, MEASURE } from "./text";



/** A column is chosen as `table/column`; names of tables have no slash. */
function parts(colour: string): [string, string] | null {
  const [table, ...column] = colour.split("/");
  return table && column.length ? [table, column.join("/")] : null;
}

/** What an address says of the colour, as a measure of runs; null for the failure rate. */
export function useMeasure(data: Columns, colour: string, aggregate: string): Shown | null {
  const { name } = data.summary;
  const column = parts(colour);
  const url = column && address(["campaigns", name, "metric"], { table: column[0], column: column[1], aggregate });
  const metric = useAnswer<Metric>(url);
  return useMemo(() => {
    if (colour === "duration") {
      return { name: COMMON.durationInSeconds, of: (run: Run) => data.runs.duration[run] };
    }
    if (!column) return null;
    const found = metric.data ?? {};
    return {
      name: `${MEASURE.aggregates[aggregate]} ${column[1]}`,
      of: (run: Run) => found[`${variantOf(data, run)}/${data.runs.number[run]}`] ?? null,
    };
  }, [data, colour, aggregate, metric.data]);
}

/** Columns by their table; those with one value everywhere, which colour all cells alike, come last. */
export function optionsOf({ columns, same }: MetricColumns): Option[] {
  const all = Object.entries(columns).flatMap(([table, names]) => names.map((name) => [table, name] as const));
  const isSame = ([table, name]: readonly [string, string]) => Object.hasOwn(same, table) && same[table]!.includes(name);
  return [
    ...all.filter((one) => !isSame(one)).map(([table, name]): Option => [`${table}/${name}`, name, table]),
    ...all.filter(isSame).map(([table, name]): Option => [`${table}/${name}`, `${table}: ${name}`, GROUPS.constant]),
  ];
}

interface ChooserProps {
  campaign: string;
  colour: string;
  aggregate: string;
}

export function Chooser({ campaign, colour, aggregate }: ChooserProps) {
  const { data } = useAnswer<MetricColumns>(address(["campaigns", campaign, "metrics"]));
  const columns = useMemo(() => (data ? optionsOf(data) : []), [data]);
  const chosen = parts(colour);
  const options: Option[] = [["", COMMON.failureRate], ["duration", COMMON.meanDuration], ...columns];
  if (chosen && !columns.some(([key]) => key === colour)) options.push([colour, colour]);
  return (
    <>
      <Pick
        label={COMMON.color}
        text={options.find(([value]) => value === colour)?.[1] ?? ""}
        options={options}
        chosen={[colour]}
        onChoose={(value) => choose({ colour: value })}
      />
      {chosen && (
        <Select
          label={MEASURE.perRun}
          value={aggregate}
          options={Object.entries(MEASURE.aggregates)}
          onChoose={(value) => choose({ of: value === "mean" ? "" : value })}
        />
      )}
    </>
  );
}
