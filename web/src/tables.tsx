// The CSV files of a run, drawn.
import { useMemo } from "preact/hooks";
import { address, fileAddress, type FileEntry, type Table } from "./api";
import { show } from "./data";
import { plural } from "./format";
import { useAnswer } from "./live";
import { Select, Waiting } from "./parts";
import { Plot, type Curve } from "./plot";
import { choose } from "./route";

const CURVES = 4;
const PREVIEW = 12;

export function Tables({ files, query }: { files: FileEntry[]; query: URLSearchParams }) {
  const path = query.get("table") ?? files[0]!.path;
  const columns = (query.get("columns") ?? "").split("\n").filter(Boolean);
  const x = query.get("over") ?? "";
  const wanted = columns.length || x ? [x, ...columns].filter(Boolean) : [];
  const { data, error } = useAnswer<Table>(address(["table"], { path, column: wanted }));
  const options = files.map((file): [string, string] => [file.path, file.name]);
  return (
    <>
      <div class="tools">
        <Select
          label="Table"
          value={path}
          options={options}
          onChoose={(table) => choose({ table, columns: "", over: "" })}
        />
        {data && <Choices data={data} x={x} columns={columns} />}
        <a class="button" href={fileAddress(path)} download>
          Save CSV
        </a>
      </div>
      {data ? <Drawn data={data} x={x} columns={columns} /> : <Waiting error={error} />}
    </>
  );
}

/** The column that others are drawn over: the chosen one, else the first that only grows. */
function overColumn(data: Table, x: string): string {
  const numeric = numericColumns(data);
  if (numeric.includes(x)) return x;
  const times = numeric.find((name) => /^(time|timestamp|stamp|step|t)$/i.test(name));
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

function Choices({ data, x, columns }: { data: Table; x: string; columns: string[] }) {
  const over = overColumn(data, x);
  const drawn = columns.length ? columns : numericColumns(data).filter((n) => n !== over).slice(0, CURVES);
  const toggle = (name: string) => {
    const next = drawn.includes(name) ? drawn.filter((one) => one !== name) : [...drawn, name];
    choose({ columns: next.join("\n"), over });
  };
  const options = data.names.map((name): [string, string] => [name, name]);
  return (
    <>
      <Select
        label="Over"
        value={over}
        options={options}
        onChoose={(value) => choose({ over: value, columns: drawn.join("\n") })}
      />
      <details class="menu">
        <summary>Columns</summary>
        <fieldset>
          <legend class="hidden">Columns to draw</legend>
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

function Drawn({ data, x, columns }: { data: Table; x: string; columns: string[] }) {
  const over = overColumn(data, x);
  const [axis, curves] = useMemo(() => {
    const names = numericColumns(data).filter((name) => name !== over);
    const drawn = columns.length ? names.filter((name) => columns.includes(name)) : names.slice(0, CURVES);
    return sortedCurves(data, over, drawn);
  }, [data, over, columns.join()]);
  const kept = Object.values(data.columns)[0]?.length ?? 0;
  return (
    <>
      {curves.length > 0 && <Plot label="Columns of the table" x={axis} curves={curves} />}
      <p class="quiet">
        {plural(data.rows, "row")}
        {data.stride > 1 && `, every ${data.stride}th is shown`}, {plural(data.names.length, "column")}
      </p>
      <div class="scroll" tabIndex={0} role="region" aria-label="First rows of the table">
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
function sortedCurves(data: Table, over: string, drawn: string[]): [Curve, Curve[]] {
  const x = data.columns[over] ?? [];
  const places = x.map((_, place) => place).filter((place) => typeof x[place] === "number");
  places.sort((a, b) => (x[a] as number) - (x[b] as number));
  const column = (name: string): Curve => ({
    label: name,
    values: places.map((place) => {
      const value = data.columns[name]?.[place];
      return typeof value === "number" ? value : null;
    }),
  });
  return [column(over), drawn.map(column)];
}
