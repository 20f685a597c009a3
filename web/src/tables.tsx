// The CSV files of a run, drawn.
import { useMemo } from "preact/hooks";
import { address, fileAddress, type FileEntry, type Table } from "./api";
import { show } from "./data";

import { useAnswer } from "./live";
import { Overlay, pathIn, type Family } from "./overlay";
import { Select, Waiting } from "./parts";
import { Plot, type Curve } from "./plot";
import { choose } from "./route";
import { COMMON, TABLES } from "./text";
import { isTime, sinceStart } from "./times";

const CURVES = 4;
const PREVIEW = 12;

interface TablesProps {
  files: FileEntry[];
  query: URLSearchParams;
  /** When the run started [s since the epoch]. */
  start: number | null;
  family: Family;
}

export function Tables({ files, query, start, family }: TablesProps) {
  const path = query.get("table") ?? mostTelling(files).path;
  const columns = (query.get("columns") ?? "").split("\n").filter(Boolean);
  const x = query.get("over") ?? "";
  const wanted = columns.length || x ? [x, ...columns].filter(Boolean) : [];
  const { data, error } = useAnswer<Table>(address(["table"], { path, column: wanted }));
  const canOverlay = family.siblings.length > 1 && pathIn(family, path, 0) !== null;
  const everyone = canOverlay && query.get("everyone") === "1";
  const options = files.map((file): [string, string] => [file.path, file.name]);
  return (
    <>
      <div class="tools">
        <Select
          label={TABLES.table}
          value={path}
          options={options}
          onChoose={(table) => choose({ table, columns: "", over: "" })}
        />
        {data && <Choices data={data} x={x} columns={columns} />}
        {canOverlay && (
          <button
            type="button"
            aria-pressed={everyone}
            title={TABLES.allRunsTitle}
            onClick={() => choose({ everyone: everyone ? "" : "1" })}
          >
            {COMMON.allRuns}
          </button>
        )}
        <a class="button" href={fileAddress(path)} download>
          {COMMON.saveCsv}
        </a>
      </div>
      {data ? <Drawn {...{ data, x, columns, start, path }} family={everyone ? family : null} /> : <Waiting error={error} />}
    </>
  );
}

/** A table of the robot's places, else the largest: in one row there is no curve. */
function mostTelling(files: FileEntry[]): FileEntry {
  const ofPlaces = files.filter(({ name }) => /odom|pose|position/i.test(name));
  const [first, ...others] = ofPlaces.length ? ofPlaces : files;
  return others.reduce((best, one) => (one.size > best.size ? one : best), first!);
}

/** The column that others are drawn over: the chosen one, else a time, else the first that only grows. */
function overColumn(data: Table, x: string): string {
  const numeric = numericColumns(data);
  if (numeric.includes(x)) return x;
  const times = numeric.find((name) => isTime(name) || /^step$/i.test(name));
  return times ?? numeric.find((name) => grows(data.columns[name]!)) ?? numeric[0] ?? "";
}

function grows(values: (number | string | null)[]): boolean {
  return values.every((value, place) => place === 0 || (value ?? 0) >= (values[place - 1] ?? 0));
}

function numericColumns(data: Table): string[] {
  return Object.keys(data.columns).filter((name) =>
    data.columns[name]!.some((value) => typeof value === "number"),
  );
}

/** Columns that are drawn unless others are chosen: the first that change, and are no times. */
function defaultColumns(data: Table, over: string): string[] {
  const names = numericColumns(data).filter((name) => name !== over && !isTime(name));
  const changing = names.filter((name) => new Set(data.columns[name]).size > 1);
  return (changing.length ? changing : names).slice(0, CURVES);
}

function Choices({ data, x, columns }: { data: Table; x: string; columns: string[] }) {
  const over = overColumn(data, x);
  const drawn = columns.length ? columns : defaultColumns(data, over);
  const toggle = (name: string) => {
    const next = drawn.includes(name) ? drawn.filter((one) => one !== name) : [...drawn, name];
    choose({ columns: next.join("\n"), over });
  };
  const options = data.names.map((name): [string, string] => [name, name]);
  return (
    <>
      <Select
        label={TABLES.over}
        value={over}
        options={options}
        onChoose={(value) => choose({ over: value, columns: drawn.join("\n") })}
      />
      <details class="menu">
        <summary>{TABLES.columns}</summary>
        <fieldset>
          <legend class="hidden">{TABLES.columnsToPlot}</legend>
          {data.names.map((name) => (
            <label key={name}>
              <input type="checkbox" checked={drawn.includes(name)} onChange={() => toggle(name)} />
              {name}
            </label>
          ))}
        </fieldset>
      </details>
    </>
  );
}

interface DrawnProps {
  data: Table;
  x: string;
  columns: string[];
  start: number | null;
  path: string;
  /** Whose runs are drawn too. */
  family: Family | null;
}

function Drawn({ data, x, columns, start, path, family }: DrawnProps) {
  const over = overColumn(data, x);
  const drawn = useMemo(() => {
    const names = numericColumns(data).filter((name) => columns.includes(name) && name !== over);
    return columns.length ? names : defaultColumns(data, over);
  }, [data, over, columns.join()]);
  const [axis, curves] = useMemo(() => sortedCurves(data, over, drawn, start), [data, over, drawn, start]);
  const kept = Object.values(data.columns)[0]?.length ?? 0;
  return (
    <>
      {family && <Overlay {...{ family, path, data, over, drawn, start }} />}
      {!family && data.rows > 1 && curves.length > 0 && <Plot label={TABLES.plot} x={axis} curves={curves} />}
      <p class="quiet">
        {TABLES.size(data.rows, data.names.length, data.stride)}
      </p>
      <div class="scroll" tabIndex={0} role="region" aria-label={TABLES.firstRows}>
        <table class="plain">
          <thead>
            <tr>
              {Object.keys(data.columns).map((name) => (
                <th key={name}>{name}</th>
              ))}
            </tr>
          </thead>
          <tbody>
            {Array.from({ length: Math.min(PREVIEW, kept) }, (_, row) => (
              <tr key={row}>
                {Object.entries(data.columns).map(([name, values]) => (
                  <td key={name} class={typeof values[row] === "number" ? "number" : undefined}>
                    {show(values[row])}
                  </td>
                ))}
              </tr>
            ))}
          </tbody>
        </table>
      </div>
    </>
  );
}

/** Columns in the order of x, as curves need it. */
export function sortedCurves(data: Table, over: string, drawn: string[], start: number | null): [Curve, Curve[]] {
  const recorded = data.columns[over] ?? [];
  const x = isTime(over) ? sinceStart(recorded, start) : recorded;
  const places = x.map((_, place) => place).filter((place) => typeof x[place] === "number");
  places.sort((a, b) => (x[a] as number) - (x[b] as number));
  const column = (label: string, values: (number | string | null)[]): Curve => ({
    label,
    values: places.map((place) => (typeof values[place] === "number" ? values[place] : null)),
  });
  const label = isTime(over) ? TABLES.time : over;
  return [column(label, x), drawn.map((name) => column(name, data.columns[name] ?? []))];
}
