// Configurations in cells of two parameters, coloured by failure rate or by what was measured.
import type { ComponentChildren } from "preact";
import { useMemo } from "preact/hooks";
import type { Columns } from "./api";
import { cells, show, titled, type Cell, type Run, type Shown } from "./data";
import type { Axes } from "./factors";
import { percent } from "./format";
import { Export, Select, Waiting } from "./parts";
import { anytime, intervalText, wilson, type Interval } from "./rates";
import { choose } from "./route";
import { COMMON, MATRIX } from "./text";

interface MatrixProps {
  data: Columns;
  runs: Run[];
  axes: Axes;
  /** What the colour stands for; the failure rate when there is none. */
  measure: Shown | null;
  /** Chooses that. */
  chooser: ComponentChildren;
  /** Chosen cell, `column,row`. */
  chosen: string;
  /** What counts as a failure, when not every run that did not pass does. */
  isBad?: (run: Run) => boolean;
  /** Whether what is measured is a difference: both signs have a colour, none has 0. */
  signed?: boolean;
}

export function Matrix(props: MatrixProps) {
  const { data, runs, chooser, chosen, isBad, signed = false } = props;
  const { x, y, across, down, options, ready } = props.axes;
  const measure = props.measure?.name ?? "";
  const found = useMemo(
    () => cells(data, runs, across, down, props.measure?.of, isBad),
    [data, runs, across, down, props.measure, isBad],
  );
  const intervalOf = data.wider ? anytime : wilson;
  const scale = scaleOf(found.flat(), measure, signed);
  const rows = () => [
    MATRIX.head(x, y, measure),
    ...found.flatMap((row, j) =>
      row.map((cell, i) => [
        down.labels[j],
        across.labels[i],
        cell.runs,
        cell.bad,
        cell.runs ? cell.bad / cell.runs : null,
        ...intervalOf(cell.bad, cell.runs),
        measure && mean(cell),
      ]),
    ),
  ];
  if (!ready) return <Waiting error={null} />;
  return (
    <>
      <div class="tools">
        <Select label={COMMON.across} value={x} options={options} onChoose={(v) => choose({ x: v || "-", cell: "" })} />
        <Select label={MATRIX.down} value={y} options={options} onChoose={(v) => choose({ y: v || "-", cell: "" })} />
        {chooser}
        <Legend measure={measure} scale={scale} signed={signed} />
        <Export name={`${data.summary.name}-matrix`} rows={rows} />
      </div>
      <div class="scroll" tabIndex={0} role="region" aria-label={MATRIX.label}>
        <table class={`matrix ${signed ? "" : measure ? "measure" : "rate"}`} onKeyDown={moveFocus}>
          <caption class="hidden">
            {MATRIX.caption(measure, Boolean(isBad), x, y)}
          </caption>
          <thead>
            <tr>
              <td class="corner">
                {y && <span>{titled(data, y)} ↓</span>} {x && <span>{titled(data, x)} →</span>}
              </td>
              {across.labels.map((label, i) => (
                <th key={i} scope="col">
                  {label || <span class="hidden">{MATRIX.all}</span>}
                </th>
              ))}
            </tr>
          </thead>
          <tbody>
            {found.map((row, j) => (
              <tr key={j}>
                <th scope="row">{down.labels[j] || <span class="hidden">{MATRIX.all}</span>}</th>
                {row.map((cell, i) => (
                  <CellOf
                    key={i}
                    cell={cell}
                    id={`${i},${j}`}
                    place={[across.labels[i]!, down.labels[j]!]}
                    measure={measure}
                    interval={intervalOf(cell.bad, cell.runs)}
                    share={scale.share(cell)}
                    signed={signed}
                    chosen={chosen === `${i},${j}`}
                    // The usual axes may be others when there are more runs.
                    onChoose={(cell) => choose({ x: x || "-", y: y || "-", cell })}
                    tabbable={chosen ? chosen === `${i},${j}` : i === 0 && j === 0}
                  />
                ))}
              </tr>
            ))}
          </tbody>
        </table>
      </div>
      {!measure && data.wider && <p class="quiet note">{data.wider}</p>}
    </>
  );
}

interface CellProps {
  cell: Cell;
  id: string;
  place: [string, string];
  measure: string;
  /** Of the share of runs that did not pass. */
  interval: Interval;
  share: number | null;
  signed: boolean;
  chosen: boolean;
  tabbable: boolean;
  onChoose: (cell: string) => void;
}

function CellOf({ cell, id, place, measure, interval, share, signed, chosen, tabbable, onChoose }: CellProps) {
  const value = measure ? mean(cell) : cell.runs ? cell.bad / cell.runs : null;
  const number = value === null ? "" : show(Number(value.toPrecision(3)));
  const plus = signed && value !== null && value > 0 ? "+" : "";
  const text = value === null ? "" : measure ? plus + number : percent(value);
  const where = place.filter(Boolean).join(", ");
  const title = MATRIX.cell(where, cell.runs, cell.bad, intervalText(interval));
  const colour = share === null ? undefined : { "--share": inPercent(Math.abs(share)), "--sure": "100%" };
  if (colour && !measure) colour["--sure"] = inPercent(1 - PALEST * (interval[1] - interval[0]));
  return (
    <td class={chosen ? "chosen" : undefined}>
      <button
        type="button"
        data-cell={id}
        tabIndex={tabbable ? 0 : -1}
        aria-pressed={chosen}
        title={title}
        class={share === null ? "empty" : signed ? (share < 0 ? "better" : "worse") : undefined}
        style={colour}
        onClick={() => onChoose(chosen ? "" : id)}
      >
        <span class="hidden">{where}: </span>
        {text || <span class="hidden">{MATRIX.noRuns}</span>}
        {!measure && cell.runs > 0 && (
          <>
            <small>
              {cell.bad}/{cell.runs}
            </small>
            <span class="sure">{intervalText(interval)}</span>
          </>
        )}
      </button>
    </td>
  );
}

/** How much of its colour a cell loses of whose rate nothing is known. */
const PALEST = 0.7;

function inPercent(share: number): string {
  return `${(100 * share).toFixed(1)}%`;
}

interface Scale {
  low: number;
  high: number;
  share: (cell: Cell) => number | null;
}

function mean(cell: Cell): number | null {
  return cell.measured ? cell.sum / cell.measured : null;
}

/**
 * From no to full colour: rates from 0 to 1, what was measured from its least to its most;
 * differences from 0 to the largest in either direction, as -1 to 1.
 */
function scaleOf(all: Cell[], measure: string, signed: boolean): Scale {
  if (!measure) {
    return { low: 0, high: 1, share: (cell) => (cell.runs ? cell.bad / cell.runs : null) };
  }
  const values = all.map(mean).filter((value) => value !== null);
  const low = values.length ? Math.min(...values) : 0;
  const high = values.length ? Math.max(...values) : 0;
  if (signed) {
    const most = Math.max(Math.abs(low), Math.abs(high)) || 1;
    const part = (cell: Cell) => (cell.measured ? mean(cell)! / most : null);
    return { low: -most, high: most, share: part };
  }
  const share = (cell: Cell) => {
    const value = mean(cell);
    return value === null ? null : high > low ? (value - low) / (high - low) : 0.5;
  };
  return { low, high, share };
}

function Legend({ measure, scale, signed }: { measure: string; scale: Scale; signed: boolean }) {
  const text = (value: number) => (measure ? show(Number(value.toPrecision(3))) : percent(value));
  return (
    <span class={`legend ${signed ? "signed" : measure ? "measure" : "rate"}`}>
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
