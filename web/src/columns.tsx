// Which columns the table of runs has: the usual ones, until one chooses others; that is remembered.
import { useMemo, useState } from "preact/hooks";
import type { Columns } from "./api";
import { brief, others, show, titled, valueOf, variantOf, varies, verdictOf, type Run, type Shown } from "./data";
import { duration, moment } from "./format";
import type { Column } from "./grid";
import { Mark, type Option } from "./parts";
import { Pick } from "./pick";
import { choose, joined, link, split } from "./route";
import { COLUMNS, COMMON, GROUPS } from "./text";

/** Parameters that have a column without being chosen. */
const USUAL = 8;
const MEMORY = "robovast-columns";

/** What was chosen beside the usual: whether a column is shown. */
type Choices = Record<string, boolean>;

interface Choosable extends Column {
  /** Nothing of columns that every table has. */
  group?: string;
  usual: boolean;
}

interface Chosen {
  all: Choosable[];
  shown: Choosable[];
  choices: Choices;
  /** Takes what differs from the usual, as the address has it. */
  save: (text: string) => void;
}

export function useColumns(data: Columns, names: string[], measure: Shown | null, address: string): Chosen {
  const all = useMemo(() => columnsOf(data, names, measure), [data, names, measure]);
  const [kept, keep] = useState(remembered);
  return useMemo(() => {
    const choices = read(address || kept);
    const shown = all.filter((column) => !column.group || (choices[column.id] ?? column.usual));
    const save = (text: string) => {
      remember(text);
      keep(text);
      choose({ columns: text });
    };
    return { all, shown, choices, save };
  }, [all, address, kept]);
}

export function ColumnsPick({ all, shown, choices, save }: Chosen) {
  const options = all.flatMap(({ id, label, group }): Option[] => (group ? [[id, label, group]] : []));
  const chosen = shown.map(({ id }) => id);
  const toggle = (id: string, on: boolean) => {
    const isUsual = on === all.find((one) => one.id === id)!.usual;
    const rest = Object.entries(choices).filter(([one]) => one !== id);
    save(joined([...rest, ...(isUsual ? [] : [[id, on] as const])].map(([id, on]) => (on ? "+" : "-") + id)));
  };
  return (
    <Pick
      label={COLUMNS.label}
      text={String(shown.length)}
      several
      options={options}
      chosen={chosen}
      onChoose={toggle}
      onReset={() => save("")}
    />
  );
}

function read(text: string): Choices {
  return Object.fromEntries(split(text).map((one) => [one.slice(1), one.startsWith("+")]));
}

/** A browser may refuse to keep anything; then the address alone knows. */
function remembered(): string {
  try {
    return localStorage.getItem(MEMORY) ?? "";
  } catch {
    return "";
  }
}

function remember(text: string): void {
  try {
    localStorage.setItem(MEMORY, text);
  } catch {
    // It is in the address.
  }
}

export function runLink(data: Columns, run: Run): string {
  return link(["campaign", data.summary.name, variantOf(data, run), data.runs.number[run]!]);
}

function columnsOf(data: Columns, names: string[], measure: Shown | null): Choosable[] {
  const varied = names.map((name, place) => parameter(data, name, GROUPS.varied, place < USUAL));
  const rest = others(data).filter((name) => varies(data, name) && !names.includes(name));
  return [
    { id: "verdict", label: COMMON.verdict, usual: true, cell: (run) => <Mark verdict={verdictOf(data, run)} /> },
    { id: "variant", label: COLUMNS.run, usual: true, cell: (run) => <RunLink {...{ data, run }} /> },
    ...(data.decided.length
      ? [column("decided", COMMON.configuration, (run) => data.decided[data.runs.variant[run]!])]
      : []),
    column("reason", COMMON.reason, (run) => <Reason text={data.reasons[data.runs.reason[run]!]!} />),
    ...varied,
    ...rest.map((name) => parameter(data, name, GROUPS.derived, false)),
    { ...column("duration", COMMON.duration, (run) => duration(data.runs.duration[run])), kind: "number" },
    ...(measure ? [measured(measure)] : []),
    column("started", COMMON.started, (run) => moment(data.runs.started[run])),
    ...Object.entries(data.runs.texts).map(([name, { title }]) => further(data, `t:${name}`, title)),
  ];
}

function column(id: string, label: string, cell: Column["cell"]): Choosable {
  return { id, label, cell, group: GROUPS.run, usual: true };
}

/** A column that is shown when it is chosen. */
function further(data: Columns, id: string, title: string): Choosable {
  return { ...column(id, title, (run) => show(valueOf(data, run, id))), usual: false };
}

function parameter(data: Columns, name: string, group: string, usual: boolean): Choosable {
  const id = `p:${name}`;
  const kind = data.variants.values[name]!.some((one) => typeof one === "number") ? "number" : "text";
  const cell = (run: Run) => {
    const found = valueOf(data, run, id);
    return typeof found === "object" && found ? <span title={show(found)}>{brief(found)}</span> : show(found);
  };
  return { id, label: titled(data, name), kind, cell, group, usual };
}

/** What the matrix is coloured by is always shown. */
function measured({ name, of }: Shown): Choosable {
  return { id: "m", label: name, kind: "number", usual: true, cell: (run) => show(of(run)) };
}

function RunLink({ data, run }: { data: Columns; run: Run }) {
  return (
    <a href={runLink(data, run)}>
      {variantOf(data, run)}/{data.runs.number[run]}
    </a>
  );
}

function Reason({ text }: { text: string }) {
  return <span title={text}>{text || "–"}</span>;
}
