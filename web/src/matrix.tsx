// Configurations in cells of two parameters, coloured by failure rate or by what was measured.
import type { ComponentChildren } from "preact";
import { useMemo } from "preact/hooks";
import type { Columns } from "./api";
import { cells, show, type Axis, type Cell, type Run, type Shown } from "./data";
import { percent, plural } from "./format";
import { Export, Select } from "./parts";
import { choose } from "./route";

interface MatrixProps {
  data: Columns;
  runs: Run[];
  names: string[];
  x: string;
  y: string;
  across: Axis;
  down: Axis;
  /** What the colour stands for; the failure rate when there is none. */
  measure: Shown | null;
  /** Chooses that. */
  chooser: ComponentChildren;
  /** Chosen cell, `column,row`. */
  chosen: string;
}

export function Matrix(props: MatrixProps) {
  const { data, runs, names, x, y, across, down, chooser, chosen } = props;
  const measure = props.measure?.name ?? "";
  const found = useMemo(
    () => cells(data, runs, across, down, props.measure?.of),
    [data, runs, across, down, props.measure],
  );
  const scale = scaleOf(found.flat(), measure);
  const options: [string, string][] = [["", "(all together)"], ...names.map((n): [string, string] => [n, n])];
  const rows = () => [
    [y || "all", x || "all", "runs", "not passed", "failure rate", measure && `mean ${measure}`],
    ...found.flatMap((row, j) =>
      row.map((cell, i) => [
        down.labels[j],
        across.labels[i],
        cell.runs,
        cell.bad,
        cell.runs ? cell.bad / cell.runs : null,
        measure && mean(cell),
      ]),
    ),
  ];
  return (
    <>
      <div class="tools">
        <Select label="Across" value={x} options={options} onChoose={(v) => choose({ x: v || "-", cell: "" })} />
        <Select label="Down" value={y} options={options} onChoose={(v) => choose({ y: v || "-", cell: "" })} />
        {chooser}
        <Legend measure={measure} scale={scale} />
        <Export name={`${data.summary.name}-matrix`} rows={rows} />
      </div>
      <div class="scroll" tabIndex={0} role="region" aria-label="Matrix of configurations">
        <table class={`matrix ${measure ? "measure" : "rate"}`} onKeyDown={moveFocus}>
          <caption class="hidden">
            {measure ? `Mean ${measure}` : "Failure rate"} by {x || "all"} across and {y || "all"} down
          </caption>
          <thead>
            <tr>
              <td class="corner">
                {y && <span>{y} ↓</span>} {x && <span>{x} →</span>}
              </td>
              {across.labels.map((label) => (
                <th key={label} scope="col">
                  {label}
                </th>
              ))}
            </tr>
          </thead>
          <tbody>
            {found.map((row, j) => (
              <tr key={down.labels[j]}>
                <th scope="row">{down.labels[j]}</th>
                {row.map((cell, i) => (
                  <CellOf
                    key={i}
                    cell={cell}
                    id={`${i},${j}`}
                    place={[across.labels[i]!, down.labels[j]!]}
                    measure={measure}
                    share={scale.share(cell)}
                    chosen={chosen === `${i},${j}`}
                    tabbable={chosen ? chosen === `${i},${j}` : i === 0 && j === 0}
                  />
                ))}
              </tr>
            ))}
          </tbody>
        </table>
      </div>
    </>
  );
}

interface CellProps {
  cell: Cell;
  id: string;
  place: [string, string];
  measure: string;
  share: number | null;
  chosen: boolean;
  tabbable: boolean;
}

function CellOf({ cell, id, place, measure, share, chosen, tabbable }: CellProps) {
  const value = measure ? mean(cell) : cell.runs ? cell.bad / cell.runs : null;
  const text = value === null ? "" : measure ? show(Number(value.toPrecision(3))) : percent(value);
  const where = place.filter(Boolean).join(", ");
  const title = `${where}: ${plural(cell.runs, "run")}, ${cell.bad} not passed`;
  return (
    <td class={chosen ? "chosen" : undefined}>
      <button
        type="button"
        data-cell={id}
        tabIndex={tabbable ? 0 : -1}
        aria-pressed={chosen}
        title={title}
        class={cell.runs ? undefined : "empty"}
        style={share === null ? undefined : { "--share": `${(100 * share).toFixed(1)}%` }}
        onClick={() => choose({ cell: chosen ? "" : id })}
      >
        <span class="hidden">{where}: </span>
        {text || <span class="hidden">no runs</span>}
        {!measure && cell.runs > 0 && (
          <small>
            {cell.bad}/{cell.runs}
          </small>
        )}
      </button>
    </td>
  );
}

interface Scale {
  low: number;
  high: number;
  share: (cell: Cell) => number | null;
}

function mean(cell: Cell): number | null {
  return cell.measured ? cell.sum / cell.measured : null;
}

/** From no to full colour: rates from 0 to 1, what was measured from its least to its most. */
function scaleOf(all: Cell[], measure: string): Scale {
  if (!measure) {
    return { low: 0, high: 1, share: (cell) => (cell.runs ? cell.bad / cell.runs : null) };
  }
  const values = all.map(mean).filter((value) => value !== null);
  const low = values.length ? Math.min(...values) : 0;
  const high = values.length ? Math.max(...values) : 0;
  const share = (cell: Cell) => {
    const value = mean(cell);
    return value === null ? null : high > low ? (value - low) / (high - low) : 0.5;
  };
  return { low, high, share };
}

function Legend({ measure, scale }: { measure: string; scale: Scale }) {
  const text = (value: number) => (measure ? show(Number(value.toPrecision(3))) : percent(value));
  return (
    <span class={`legend ${measure ? "measure" : "rate"}`}>
      {text(scale.low)} <span class="ramp" aria-hidden="true" /> {text(scale.high)}
    </span>
  );
}

/** Arrow keys go from cell to cell. */
function moveFocus(event: KeyboardEvent): void {
  const step = { ArrowRight: [1, 0], ArrowLeft: [-1, 0], ArrowDown: [0, 1], ArrowUp: [0, -1] }[event.key];
  const current = (event.target as Element).getAttribute("data-cell");
  if (!step || !current) return;
  event.preventDefault();
  const [i, j] = current.split(",").map(Number);
  const next = `${i! + step[0]!},${j! + step[1]!}`;
  (event.currentTarget as Element).querySelector<HTMLElement>(`[data-cell="${next}"]`)?.focus();
}
